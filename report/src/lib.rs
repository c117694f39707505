//! The report of a run: one HTML file with everything that a person wants to see of it.
//!
//! [`write()`] reads what the commands have left in the folder of a run (`run.json`, metrics,
//! pictures, records) and puts it on one page that needs no network, no other file and, for all but
//! the sliders, no script. Pictures are embedded as JPEG, at most a display's size.
//!
//! - [`mod@run`]: `run.json`, what was made from what.
//! - `gather`: what is on the page, and how it is read.
//! - [`lamps`]: the table of the lamps of a scene.
//! - `pages`: links to pages of scenes, the only other files.
//! - [`picture`], `curve`: pictures and curves as text.
//! - `page`: the template.

mod curve;
mod error;
mod gather;
pub mod lamps;
mod mirrors;
mod page;
mod pages;
pub mod picture;
pub mod run;

pub use error::{ReportError, Result};

use eagpt_scene::files;
use std::path::Path;

/// Writes the report of the run in `dir` to `out`.
///
/// # Errors
/// [`ReportError`] naming the file that is missing or is not what the commands write.
pub fn write(dir: &Path, out: &Path) -> Result<()> {
    let mut content = gather::gather(dir)?;
    let pages = pages::find(dir, out.parent().unwrap_or(dir))?;
    content["pages"] = serde_json::json!(pages);
    let html = page::render(&content)?;
    Ok(files::write_bytes_atomic(out, html.as_bytes())?)
}
