//! Emission masks: which pixels of a photograph show a light rather than a lit surface.
//!
//! A mask is what exceeds a level of linear radiance, given or [found in the scene](level),
//! together with what a person or a network has labelled, less what is labelled as reflection,
//! tidied up: [`mod@mask`]. As a lamp shines from wherever it is looked at and a reflection does
//! not, masks of posed views are then [compared with each other](consistency). A view of which
//! nothing is known gets no mask, which is not the same as one without emitters.
//!
//! [`make_masks`] does all of it for a dataset, with overlays to look at and a [`report`].
//!
//! Emission-aware Gaussians are trained on these masks (EAG-PT, arXiv 2601.23065, section 3).

pub mod consistency;
pub mod error;
mod job;
pub mod labels;
pub mod level;
pub mod mask;
pub mod options;
mod overlay;
pub mod report;

pub use error::{MaskError, Result};
pub use job::{MaskProgress, MaskRequest, MaskSummary, make_masks, planned_files};
pub use options::{Border, CheckOptions, Inconsistent, MaskOptions, Rule, Source};
