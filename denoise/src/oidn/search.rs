//! Where the library of Open Image Denoise may be.

use std::path::{Path, PathBuf};

/// Names of the library, the most telling first.
pub(super) const NAMES: &[&str] = if cfg!(target_os = "windows") {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

/// The libraries that `path` may stand for: itself, or in it if it is a folder; with one, the
/// folders that an unpacked release has in it.
pub(super) fn within(path: &Path) -> Vec<PathBuf> {
    if !path.is_dir() {
        return vec![path.to_owned()];
    }
    let folders = [path.to_owned(), path.join("lib"), path.join("bin")];
    folders.iter().flat_map(|folder| existing(folder)).collect()
}

/// The libraries in the usual places of this system, and those places.
pub(super) fn usual() -> (Vec<PathBuf>, Vec<PathBuf>) {
    let folders = folders();
    let files = folders.iter().flat_map(|folder| existing(folder));
    (files.collect(), folders)
}

fn existing(folder: &Path) -> Vec<PathBuf> {
    let paths = NAMES.iter().map(|name| folder.join(name));
    paths.filter(|path| path.is_file()).collect()
}

fn folders() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = Vec::new();
    if cfg!(unix) {
        for folder in [
            "/usr/local/lib",
            "/usr/local/lib64",
            "/usr/lib",
            "/usr/lib64",
        ] {
            folders.push(folder.into());
        }
        // Debian's folders for one architecture.
        folders.push(format!("/usr/lib/{}-linux-gnu", std::env::consts::ARCH).into());
        folders.push("/opt/homebrew/lib".into());
        folders.extend(releases(Path::new("/opt")));
    }
    if let Some(home) = std::env::home_dir() {
        folders.push(home.join(".local/lib"));
        folders.extend(releases(&home.join(".local")));
    }
    folders.retain(|folder| folder.is_dir());
    folders
}

/// `lib` of every unpacked release in a folder (`oidn-2.3.0.x86_64.linux`), the last by name first.
fn releases(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut found: Vec<PathBuf> = entries
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("oidn"))
        .map(|entry| entry.path().join("lib"))
        .collect();
    found.sort();
    found.reverse();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_stands_for_the_library_in_it() {
        let dir = tempfile::tempdir().unwrap();
        let lib = dir.path().join("lib");
        std::fs::create_dir(&lib).unwrap();
        assert!(within(dir.path()).is_empty());
        let file = lib.join(NAMES[0]);
        std::fs::write(&file, "").unwrap();
        assert_eq!(within(dir.path()), std::slice::from_ref(&file));
        assert_eq!(within(&lib), std::slice::from_ref(&file));
        assert_eq!(within(&file), [file]);
        // A missing path is kept, so that the error names it.
        let absent = dir.path().join("absent.so");
        assert_eq!(within(&absent), [absent]);
    }

    #[test]
    fn releases_are_found_the_last_first() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["oidn-2.1.0", "oidn-2.3.0", "other"] {
            std::fs::create_dir(dir.path().join(name)).unwrap();
        }
        let names = ["oidn-2.3.0", "oidn-2.1.0"].map(|name| dir.path().join(name).join("lib"));
        assert_eq!(releases(dir.path()), names);
    }
}
