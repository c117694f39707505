//! Shots of a capture, and their files.

/// One exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shot {
    pub(super) condition: usize,
    pub(super) position: usize,
    pub(super) exposure: usize,
}

impl Shot {
    /// Its file, relative to the capture, with "/".
    pub(super) fn file(&self, conditions: &[String]) -> String {
        let (condition, position) = (&conditions[self.condition], position_name(self.position));
        format!("{condition}/{position}_{}.dng", self.exposure)
    }
}

/// Name of a position.
pub(super) fn position_name(index: usize) -> String {
    format!("p{index:03}")
}
