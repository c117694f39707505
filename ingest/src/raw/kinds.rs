//! Which files of a folder are photographs, by their extensions.

use std::path::Path;

/// Kind of a file, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FileKind {
    /// A camera's RAW file.
    Raw,
    /// TIFF, PNG or EXR: light in linear numbers, or 8 bits for display.
    Linear,
    /// A camera's JPEG, for display.
    Jpeg,
    /// A picture for display of another format, which cannot be used.
    Display,
}

const RAW: [&str; 36] = [
    "3fr", "ari", "arw", "cr2", "cr3", "crm", "crw", "dcr", "dcs", "dng", "erf", "fff", "iiq",
    "kdc", "mdc", "mef", "mos", "mrw", "nef", "nrw", "orf", "ori", "pef", "qtk", "raf", "raw",
    "rw2", "rwl", "rwz", "sr2", "srf", "srw", "tfr", "x3f", "ptx", "gpr",
];
const LINEAR: [&str; 4] = ["exr", "png", "tif", "tiff"];
const JPEG: [&str; 2] = ["jpeg", "jpg"];
const DISPLAY: [&str; 6] = ["avif", "bmp", "gif", "heic", "heif", "webp"];

/// Kind of a file, by its extension; `None` if it is not an image.
pub(crate) fn kind_of(path: &Path) -> Option<FileKind> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    let is_in = |list: &[&str]| list.contains(&extension.as_str());
    if is_in(&RAW) {
        Some(FileKind::Raw)
    } else if is_in(&LINEAR) {
        Some(FileKind::Linear)
    } else if is_in(&JPEG) {
        Some(FileKind::Jpeg)
    } else if is_in(&DISPLAY) {
        Some(FileKind::Display)
    } else {
        None
    }
}
