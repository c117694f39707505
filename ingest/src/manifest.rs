//! `capture.toml`: which photographs belong together, said by the photographer.
//!
//! ```toml
//! exposures_s = [0.0025, 0.01, 0.04]        # optional: of the files of each stack, in their order, in place of EXIF
//! white_balance = [2.1, 1.0, 1.5]           # optional: factors of R, G, B, unless the program is told otherwise
//! vignetting = [-0.22, 0.05, -0.01]         # optional: a, b, c of 1 + a r² + b r⁴ + c r⁶
//!
//! [[stack]]
//! position = "p000"
//! condition = "front"                       # optional where there is one
//! files = ["front/p000_0.dng", "front/p000_1.dng", "front/p000_2.dng"]
//! exposures_s = [0.005, 0.02, 0.08]         # optional, for this stack
//! ```

use crate::stack::ONLY_CONDITION;
use eagpt_scene::Result;
use eagpt_scene::script::value::{Array, NonEmpty, Number, Positive, checked};
use eagpt_scene::script::{ScriptFile, Spanned};
use serde::{Deserialize, Deserializer};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Name of the file in the folder of a capture.
pub(crate) const FILE_NAME: &str = "capture.toml";

/// A manifest.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Manifest {
    /// Factors of white balance.
    pub white_balance: Option<[f32; 3]>,
    /// Coefficients of the lens' falloff.
    pub vignetting: Option<[f32; 3]>,
    /// Stacks in order.
    pub stacks: Vec<ListedStack>,
}

/// A stack of a manifest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ListedStack {
    /// Lighting condition.
    pub condition: String,
    /// Position of the camera.
    pub position: String,
    /// Files relative to the capture.
    pub files: Vec<String>,
    /// Exposure times in the order of the files.
    pub exposures_s: Option<Vec<f64>>,
}

/// A manifest as its file has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ManifestKeys {
    exposures_s: Option<Vec<Seconds>>,
    white_balance: Option<Array<Positive, 3>>,
    vignetting: Option<Array<Number, 3>>,
    stack: Vec<Spanned<StackKeys>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StackKeys {
    position: Name,
    condition: Option<Name>,
    files: Spanned<NonEmpty<String>>,
    exposures_s: Option<Spanned<Vec<Seconds>>>,
}

impl Manifest {
    /// Reads a manifest.
    ///
    /// # Errors
    /// [`eagpt_scene::SceneError`] with file, line and key: no TOML, an unknown key, a name that is
    /// no name of a file, a stack or a file that is listed twice, not as many exposures as files.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let file = ScriptFile::read(path)?;
        let keys: ManifestKeys = file.parse()?;
        let mut names = HashSet::new();
        let mut owners: HashMap<String, String> = HashMap::new();
        let mut stacks = Vec::with_capacity(keys.stack.len());
        for keyed in keys.stack {
            let span = keyed.span();
            let stack = stack(&file, keyed.into_inner(), keys.exposures_s.as_deref())?;
            let name = format!("{}/{}", stack.condition, stack.position);
            for path in &stack.files {
                if let Some(other) = owners.insert(path.clone(), name.clone()) {
                    return Err(file.error(span, format!("{path}: belongs to {other} already")));
                }
            }
            if !names.insert(name.clone()) {
                return Err(file.error(span, format!("{name} is listed twice")));
            }
            stacks.push(stack);
        }
        Ok(Self {
            white_balance: keys.white_balance.map(Into::into),
            vignetting: keys.vignetting.map(Into::into),
            stacks,
        })
    }
}

/// `common` are the exposures of stacks without their own.
fn stack(file: &ScriptFile, keys: StackKeys, common: Option<&[Seconds]>) -> Result<ListedStack> {
    let StackKeys {
        position,
        condition,
        files,
        exposures_s,
    } = keys;
    let span = exposures_s.as_ref().map_or(files.span(), Spanned::span);
    let seconds = exposures_s.as_ref().map(|own| own.get_ref().as_slice());
    let exposures_s: Option<Vec<f64>> = seconds
        .or(common)
        .map(|seconds| seconds.iter().map(|seconds| seconds.0).collect());
    let files = files.into_inner().0;
    if let Some(exposures_s) = &exposures_s
        && exposures_s.len() != files.len()
    {
        let (exposures, files) = (exposures_s.len(), files.len());
        return Err(file.error(span, format!("{exposures} exposures for {files} files")));
    }
    Ok(ListedStack {
        condition: condition.map_or_else(|| ONLY_CONDITION.to_owned(), |name| name.0),
        position: position.0,
        files,
        exposures_s,
    })
}

/// A name that can be that of a file on any system.
struct Name(String);

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |name: String| {
            let fine = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
            if !name.is_empty() && !name.starts_with('.') && name.chars().all(fine) {
                return Ok(Self(name));
            }
            Err(format!(
                "`{name}` is no name: letters, digits, `-`, `_`, `.` and spaces, not beginning with a `.`"
            ))
        })
    }
}

/// An exposure time, above 0.
struct Seconds(f64);

impl<'de> Deserialize<'de> for Seconds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |seconds: Number| match f64::from(seconds) {
            seconds if seconds > 0.0 => Ok(Self(seconds)),
            seconds => Err(format!("{seconds} s is not above 0")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Manifest> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE_NAME);
        std::fs::write(&path, text).unwrap();
        Manifest::read(&path)
    }

    #[test]
    fn a_manifest_is_read() {
        let manifest = read(
            "exposures_s = [0.5, 2]\nwhite_balance = [2.0, 1, 1.5]\n[[stack]]\nposition = \"a\"\nfiles = [\"a0\", \"a1\"]\n\
             [[stack]]\nposition = \"a\"\ncondition = \"front\"\nfiles = [\"f/a0\"]\nexposures_s = [1]\n",
        )
        .unwrap();
        assert_eq!(manifest.white_balance, Some([2.0, 1.0, 1.5]));
        assert_eq!(manifest.stacks[0].exposures_s, Some(vec![0.5, 2.0]));
        assert_eq!(manifest.stacks[0].condition, ONLY_CONDITION);
        assert_eq!(manifest.stacks[1].exposures_s, Some(vec![1.0]));
    }

    #[test]
    fn errors_have_lines() {
        let stack = "[[stack]]\nposition = \"a\"\nfiles = [\"x\"]\n";
        for (text, part) in [
            (
                "stak = 1",
                "line 1: stak: unknown field `stak`, expected one of `exposures_s`",
            ),
            ("", "line 1: (top level): missing field `stack`"),
            (
                "[[stack]]\nposition = \"a/b\"\nfiles = [\"x\"]",
                "line 2: stack[0].position: `a/b`",
            ),
            (
                "[[stack]]\nposition = \"a\"\nfiles = []",
                "line 3: stack[0].files: is empty",
            ),
            ("exposures_s = [0]\n", "line 1: exposures_s[0]: 0 s"),
            (
                &format!("exposures_s = [1, 2]\n{stack}"),
                "line 4: stack[0].files: 2 exposures for 1 files",
            ),
            (&format!("{stack}{stack}"), "x: belongs to all/a already"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    }
}
