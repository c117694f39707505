//! Emission masks: which pixels of a photograph show a light rather than a lit surface.
//!
//! A mask contains the pixels above a level of linear radiance (`threshold`), given or found in the
//! scene (`level`), but surfaces that a lamp close by lights as brightly (`halo`), plus the pixels
//! labelled by a person or a network, minus those labelled as reflections, followed by
//! morphological clean-up: `mask`. A lamp emits in all directions and a reflection does not, so
//! masks of posed views are then compared with each other (`consistency`). A view without any
//! information gets no mask, which differs from an empty mask.
//!
//! [`make_masks`] does all of it for a dataset, with overlays and a `report`.
//!
//! Emission-aware Gaussians are trained on these masks (EAG-PT, arXiv 2601.23065, section 3).

mod consistency;
mod error;
mod halo;
mod job;
mod labels;
mod level;
mod mask;
mod options;
mod overlay;
mod report;
mod threshold;

pub use consistency::Verdict;
pub use error::{MaskError, Result};
pub use job::{MaskProgress, MaskRequest, MaskSummary, make_masks, planned_files};
pub use mask::{Mask, Region};
pub use options::{Border, CheckOptions, Inconsistent, MaskOptions, MaskSource, Rule};
pub use report::ViewVerdict;
