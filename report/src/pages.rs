//! Links to pages of scenes, as `eagpt export --format html` writes them into the folder of a run.

use crate::error::{ReportError, Result};
use crate::run::folders;
use serde::Serialize;
use std::ffi::OsString;
use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

/// Folders of a run that scenes are in.
const FOLDERS: [&str; 4] = ["", folders::TRAIN, folders::EDIT, folders::BAKE];

/// The page of a scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct ScenePage {
    /// The scene's file in the run's folder, without its extension: `bake/evening`.
    pub(crate) scene: String,
    /// Address of the page, relative to the report.
    pub(crate) href: String,
}

/// Pages of the scenes of the run in `dir`, for a report in the folder `from`: each file
/// `NAME.html` beside a scene `NAME.ply`.
///
/// # Errors
/// [`ReportError`] naming the folder that cannot be read.
pub(crate) fn find(dir: &Path, from: &Path) -> Result<Vec<ScenePage>> {
    let from = absolute(from)?;
    let mut pages = Vec::new();
    for name in FOLDERS {
        let folder = dir.join(name);
        if !folder.is_dir() {
            continue;
        }
        let there = absolute(&folder)?;
        for file in names(&folder)? {
            let page = folder.join(&file);
            let is_page = page
                .extension()
                .is_some_and(|extension| extension == "html");
            if is_page && page.with_extension("ply").is_file() {
                let scene = Path::new(name).join(&file).with_extension("");
                pages.push(ScenePage {
                    scene: scene.display().to_string(),
                    href: href(&there.join(&file), &from),
                });
            }
        }
    }
    Ok(pages)
}

/// Names of the files and folders in a folder, in order.
fn names(folder: &Path) -> Result<Vec<OsString>> {
    let failed = |error: std::io::Error| ReportError::content(folder, &error);
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    let names = entries.map(|entry| Ok(entry.map_err(failed)?.file_name()));
    let mut names = names.collect::<Result<Vec<_>>>()?;
    names.sort_unstable();
    Ok(names)
}

fn absolute(folder: &Path) -> Result<PathBuf> {
    // The parent of a file without a folder is "".
    let here = Some(folder).filter(|folder| *folder != Path::new(""));
    here.unwrap_or(Path::new("."))
        .canonicalize()
        .map_err(|error| ReportError::content(folder, &error))
}

/// The way from the folder `from` to `file`, as a page has it; both absolute.
fn href(file: &Path, from: &Path) -> String {
    let same = file.components().zip(from.components());
    let num_same = same.take_while(|(a, b)| a == b).count();
    let up = from.components().skip(num_same).map(|_| "..".to_owned());
    let down = file.components().skip(num_same).map(encoded);
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// A name with all but the unreserved characters of RFC 3986 (section 2.3) as %XX.
fn encoded(name: Component<'_>) -> String {
    let mut text = String::new();
    for byte in name.as_os_str().as_encoded_bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => {
                text.push(char::from(*byte));
            }
            // Text takes any text.
            _ => drop(write!(text, "%{byte:02X}")),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_lie_beside_their_scenes() {
        let dir = tempfile::tempdir().unwrap();
        let run = dir.path().join("run");
        std::fs::create_dir_all(run.join("bake")).unwrap();
        for file in [
            "report.html",
            "bake/b.ply",
            "bake/a é.ply",
            "bake/a é.html",
            "bake/c.html",
        ] {
            std::fs::write(run.join(file), "").unwrap();
        }
        let page = |href: &str| ScenePage {
            scene: "bake/a é".to_owned(),
            href: href.to_owned(),
        };
        assert_eq!(find(&run, &run).unwrap(), [page("bake/a%20%C3%A9.html")]);
        assert_eq!(
            find(&run, dir.path()).unwrap(),
            [page("run/bake/a%20%C3%A9.html")]
        );
        let other = dir.path().join("reports");
        std::fs::create_dir(&other).unwrap();
        assert_eq!(
            find(&run, &other).unwrap(),
            [page("../run/bake/a%20%C3%A9.html")]
        );
        assert!(find(&run, &dir.path().join("none")).is_err());
    }
}
