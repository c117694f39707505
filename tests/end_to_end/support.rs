//! Running the program on a small room.

use eagpt_testkit::room::{self, RoomOptions};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, LazyLock, Mutex, OnceLock};
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

/// Exit code of the program at a failpoint.
#[cfg(debug_assertions)]
const FAILPOINT_EXIT_CODE: i32 = 86;
/// Shared folders of builds that were made so long ago are removed.
const SHARED_FOR: Duration = Duration::from_secs(24 * 3600);

/// Folder of what tests share, of this build of program and tests alone. Tests may run in one
/// process or in one each.
static SHARED: LazyLock<PathBuf> = LazyLock::new(|| {
    let built = [
        env!("CARGO_BIN_EXE_eagpt").into(),
        std::env::current_exe().unwrap(),
    ]
    .map(|path| fs::metadata(path).unwrap().modified().unwrap())
    .map(|time| {
        time.duration_since(SystemTime::UNIX_EPOCH)
            .unwrap()
            .as_nanos()
    });
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("end_to_end");
    let shared = root.join(format!("{:x}-{:x}", built[0], built[1]));
    fs::create_dir_all(&shared).unwrap();
    for other in fs::read_dir(&root).unwrap().flatten() {
        let made = other.metadata().and_then(|folder| folder.modified());
        if made.is_ok_and(|made| made.elapsed().is_ok_and(|age| age > SHARED_FOR)) {
            // Another process may be removing it as well.
            fs::remove_dir_all(other.path()).ok();
        }
    }
    shared
});

/// The shared folder `name`, which `make` makes at first use. Tests copy it, and leave it as it is.
fn shared(name: &'static str, make: impl FnOnce() -> Workplace) -> PathBuf {
    static MADE: Mutex<BTreeMap<&str, Arc<OnceLock<PathBuf>>>> = Mutex::new(BTreeMap::new());
    let made = Arc::clone(MADE.lock().unwrap().entry(name).or_default());
    let folder = made.get_or_init(|| {
        let folder = SHARED.join(name);
        if !folder.is_dir() {
            // Renamed whole: another process may be making the same.
            let partial = tempfile::tempdir_in(&*SHARED).unwrap();
            copy(make().dir.path(), partial.path());
            let renamed = fs::rename(partial.path(), &folder);
            assert!(renamed.is_ok() || folder.is_dir(), "{name}: {renamed:?}");
        }
        folder
    });
    folder.clone()
}

/// A folder, removed at the end of the test.
pub(crate) struct Workplace {
    dir: TempDir,
}

impl Workplace {
    /// A copy of what `make` has made for all tests that share `name`.
    pub(crate) fn shared(name: &'static str, make: impl FnOnce() -> Self) -> Self {
        let place = Self::empty();
        copy(&shared(name, make), place.dir.path());
        place
    }

    /// With a dataset `room` in it, a room of 12 views of 48x32 pixels: two test views, ten
    /// training views.
    pub(crate) fn new() -> Self {
        Self::shared("room", || {
            let place = Self::empty();
            let options = RoomOptions {
                num_views: 12,
                width: 48,
                height: 32,
                num_samples: 16,
                num_points: 1500,
                seed: 1,
            };
            room::write(&place.path("room"), &options, |_| ()).unwrap();
            place
        })
    }

    /// With the same dataset, and `run`: [`SHORT`] training on it.
    pub(crate) fn trained() -> Self {
        Self::shared("trained", || {
            let place = Self::new();
            place.succeeds(&format!("train room --out run {SHORT}"));
            place
        })
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
            .env_remove("EAGPT_FAILPOINT")
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

    /// Runs the program up to a failpoint, `TASK=N`: when that task of its progress has advanced N
    /// times it ends as if it was killed. Asserts that it did.
    #[cfg(debug_assertions)]
    #[track_caller]
    pub(crate) fn is_killed_at(&self, failpoint: &str, arguments: &str) {
        let mut command = self.command(arguments);
        let output = command.env("EAGPT_FAILPOINT", failpoint).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(FAILPOINT_EXIT_CODE),
            "eagpt {arguments}: {failpoint} was not reached\n{stderr}"
        );
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

    pub(crate) fn text(&self, relative: &str) -> String {
        String::from_utf8(self.bytes(relative)).unwrap()
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

/// Options of a training run of a second or two, which shows the room roughly.
pub(crate) const SHORT: &str =
    "--preset draft --iterations 150 --albedo-iterations 30 --set output.checkpoint_every=50";

/// Copies a folder's content.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

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
