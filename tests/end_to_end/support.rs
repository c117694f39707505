//! Running the program on a small room.

use eagpt_testkit::room::{self, RoomOptions};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

/// A folder, removed at the end of the test.
pub(crate) struct Workplace {
    dir: TempDir,
}

impl Workplace {
    /// With a dataset `room` in it, a room of 12 views of 48x32 pixels: two test views, ten
    /// training views.
    pub(crate) fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let options = RoomOptions {
            num_views: 12,
            width: 48,
            height: 32,
            num_samples: 16,
            num_points: 1500,
            seed: 1,
        };
        room::write(&dir.path().join("room"), &options, |_| ()).unwrap();
        Self { dir }
    }

    /// A folder with nothing in it.
    pub(crate) fn empty() -> Self {
        let dir = tempfile::tempdir().unwrap();
        Self { dir }
    }

    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.dir.path().join(relative)
    }

    /// The program, started in this folder so that arguments are short.
    pub(crate) fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_eagpt"));
        command
            .args(arguments.split_whitespace())
            .current_dir(self.dir.path())
            .env_remove("EAGPT_LOG")
            // Mesa's layer that puts devices in order complains of a missing display on standard
            // error.
            .env("NODEVICE_SELECT", "1")
            .stdin(Stdio::null());
        command
    }

    /// Runs the program to its end.
    pub(crate) fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs the program and asserts success; returns its standard output.
    #[track_caller]
    pub(crate) fn succeeds(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "eagpt {arguments}\n{stderr}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs the program and asserts that it refuses with exit code 1 and one line with all of
    /// `parts` in it.
    #[track_caller]
    pub(crate) fn fails(&self, arguments: &str, parts: &[&str]) {
        let output = self.run(&format!("{arguments} --quiet"));
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "eagpt {arguments}\n{stderr}");
        assert!(output.stdout.is_empty(), "eagpt {arguments}: {output:?}");
        let lines: Vec<&str> = stderr.lines().collect();
        assert!(
            lines.len() == 1 && lines[0].starts_with("error: "),
            "eagpt {arguments}: not one line:\n{stderr}"
        );
        for part in parts {
            assert!(lines[0].contains(part), "no `{part}` in: {}", lines[0]);
        }
    }

    /// As [`Self::fails`], and no file of the folder is other than before.
    #[track_caller]
    pub(crate) fn fails_cleanly(&self, arguments: &str, parts: &[&str]) {
        let before = self.contents("");
        self.fails(arguments, parts);
        let after = self.contents("");
        let changed = after
            .iter()
            .find(|&(name, bytes)| before.get(name) != Some(bytes));
        assert_eq!(changed.map(|(name, _)| name), None, "eagpt {arguments}");
        assert_eq!(before.len(), after.len(), "eagpt {arguments} removed files");
    }

    /// Trains a scene that shows the room roughly.
    #[track_caller]
    pub(crate) fn train(&self, out: &str) {
        self.succeeds(&format!("train room --out {out} {SHORT}"));
    }

    /// All files below a folder by their relative names, with their bytes.
    pub(crate) fn contents(&self, relative: &str) -> BTreeMap<String, Vec<u8>> {
        let root = self.path(relative);
        let mut files = BTreeMap::new();
        collect(&root, &root, &mut files);
        files
    }

    /// Names of all files below a folder.
    pub(crate) fn names(&self, relative: &str) -> Vec<String> {
        self.contents(relative).into_keys().collect()
    }

    pub(crate) fn bytes(&self, relative: &str) -> Vec<u8> {
        let path = self.path(relative);
        std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    pub(crate) fn write(&self, relative: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(relative), bytes).unwrap();
    }

    pub(crate) fn json(&self, relative: &str) -> Value {
        serde_json::from_slice(&self.bytes(relative)).unwrap()
    }

    /// Changes the room's `transforms.json`.
    pub(crate) fn edit_transforms(&self, edit: impl FnOnce(&mut Value)) {
        let mut value = self.json("room/transforms.json");
        edit(&mut value);
        self.write("room/transforms.json", value.to_string());
    }
}

/// A training run of a second or two.
pub(crate) const SHORT: &str =
    "--preset draft --iterations 150 --albedo-iterations 30 --set output.checkpoint_every=50";

fn collect(root: &Path, dir: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
    let Ok(entries) = std::fs::read_dir(dir) else {
        return;
    };
    for entry in entries {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(root, &path, files);
        } else {
            let name = path
                .strip_prefix(root)
                .unwrap()
                .to_str()
                .unwrap()
                .to_owned();
            files.insert(name, std::fs::read(&path).unwrap());
        }
    }
}
