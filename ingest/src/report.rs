//! The report for people and machines: which shots to take again.
use crate::capture::Capture;
use crate::error::Result;
use crate::output::{write_json, write_text};
use std::path::Path;
pub(crate) fn write(
    out: &Path,
    _capture: &Path,
    result: &Capture,
    _thumbnails: &[&str],
) -> Result<()> {
    write_json(&out.join("report.json"), result)?;
    write_text(&out.join("report.html"), "")
}
