//! The stacks of a capture, and everything that is wrong about them.

use crate::manifest::Manifest;
use crate::problem::Problem;
use crate::stack::Stack;

/// The stacks of a capture.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Gathered {
    pub(crate) stacks: Vec<Stack>,
    pub(crate) problems: Vec<Problem>,
    pub(crate) notes: Vec<String>,
    pub(crate) manifest: Option<Manifest>,
}
