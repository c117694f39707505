//! Data that are too large for the repository.

use std::io::Write;
use std::path::{Path, PathBuf};

/// A folder of the test data, or `None` after saying on standard error that `test` is skipped.
///
/// The data lie beside the repository, in `../shared/data`, or where the variable `EAGPT_DATA`
/// says.
pub fn test_data(test: &str, folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("EAGPT_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(folder);
    if path.is_dir() {
        return Some(path);
    }
    // Straight to the stream: what `eprintln!` writes is hidden unless the test fails.
    let notice = format!("skipped: {test}: no folder {}\n", path.display());
    std::io::stderr()
        .write_all(notice.as_bytes())
        .expect("the error stream takes a line");
    None
}
