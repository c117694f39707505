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
use eagpt_scene::script::{Node, Text};
use eagpt_scene::{Result, files};
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

impl Manifest {
    /// Reads a manifest.
    ///
    /// # Errors
    /// [`eagpt_scene::SceneError`] with file, line and key: no TOML, an unknown key, a name that is
    /// no name of a file, a stack or a file that is listed twice, not as many exposures as files.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let text = Text::new(path, &bytes)?;
        let value = text.parse()?;
        let root = Node::root(text, &value);
        let table = root.table(&["exposures_s", "white_balance", "vignetting", "stack"])?;
        let exposures = table
            .get("exposures_s")
            .map(|node| exposures(&node))
            .transpose()?;
        let three = |key| table.get(key).map(|node| node.vec3()).transpose();
        let mut manifest = Self {
            white_balance: three("white_balance")?.map(|v| v.to_array()),
            vignetting: three("vignetting")?.map(|v| v.to_array()),
            stacks: Vec::new(),
        };
        if let (Some(factors), Some(node)) = (manifest.white_balance, table.get("white_balance"))
            && factors.iter().any(|v| *v <= 0.0)
        {
            return Err(node.error(format!("{factors:?} are not all above 0")));
        }
        let mut names = HashSet::new();
        let mut owners: HashMap<String, String> = HashMap::new();
        for node in table.need("stack")?.array()? {
            let stack = stack(&node, exposures.as_ref())?;
            let name = format!("{}/{}", stack.condition, stack.position);
            for file in &stack.files {
                if let Some(other) = owners.insert(file.clone(), name.clone()) {
                    return Err(node.error(format!("{file}: belongs to {other} already")));
                }
            }
            if !names.insert(name.clone()) {
                return Err(node.error(format!("{name} is listed twice")));
            }
            manifest.stacks.push(stack);
        }
        Ok(manifest)
    }
}

fn stack(node: &Node<'_>, common: Option<&Vec<f64>>) -> Result<ListedStack> {
    let table = node.table(&["position", "condition", "files", "exposures_s"])?;
    let files_node = table.need("files")?;
    let mut files = Vec::new();
    for file in files_node.array()? {
        files.push(file.string()?.to_owned());
    }
    if files.is_empty() {
        return Err(files_node.error("is empty"));
    }
    let own = table.get("exposures_s");
    let exposures_s = own
        .as_ref()
        .map(exposures)
        .transpose()?
        .or_else(|| common.cloned());
    if let Some(exposures_s) = &exposures_s
        && exposures_s.len() != files.len()
    {
        return Err(own.unwrap_or(files_node).error(format!(
            "{} exposures for {} files",
            exposures_s.len(),
            files.len()
        )));
    }
    let condition = table.get("condition").map(|node| name(&node)).transpose()?;
    Ok(ListedStack {
        condition: condition.unwrap_or_else(|| ONLY_CONDITION.to_owned()),
        position: name(&table.need("position")?)?,
        files,
        exposures_s,
    })
}

/// A name that can be that of a file on any system.
fn name(node: &Node<'_>) -> Result<String> {
    let name = node.string()?;
    let fine = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
    if name.is_empty() || name.starts_with('.') || !name.chars().all(fine) {
        return Err(node.error(format!(
            "`{name}` is no name: letters, digits, `-`, `_`, `.` and spaces, not beginning with a `.`"
        )));
    }
    Ok(name.to_owned())
}

fn exposures(node: &Node<'_>) -> Result<Vec<f64>> {
    let mut values = Vec::new();
    for node in node.array()? {
        let value = node.double()?;
        if value <= 0.0 {
            return Err(node.error(format!("{value} s is not above 0")));
        }
        values.push(value);
    }
    Ok(values)
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
            ("stak = 1", "line 1: stak: no such key"),
            ("", "`stack` is missing"),
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
