//! Counts and lists in messages.

/// A number with its noun, "1 file", "2 files".
pub fn counted(num: usize, noun: &str) -> String {
    let plural = if num == 1 { "" } else { "s" };
    format!("{num} {noun}{plural}")
}

/// Names for a message: all if there are at most `most`, else so many and the number of the others.
pub fn listed(names: &[impl AsRef<str>], most: usize) -> String {
    let shown: Vec<&str> = names.iter().take(most).map(AsRef::as_ref).collect();
    let shown = shown.join(", ");
    match names.len().saturating_sub(most) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
