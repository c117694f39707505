//! PLY: Gaussians, point clouds, and previews for splat viewers.
//!
//! Readers take ascii and both binary byte orders, properties in any order and of any type, and
//! ignore what they do not know: other properties, lists, other elements. Counts in a header are
//! believed only as far as the file has bytes for them. Writers write binary little endian.

mod gaussians;
mod header;
mod points;
mod preview;
mod values;

#[cfg(test)]
mod tests;

pub use gaussians::{read_gaussians, write_gaussians};
pub use points::{PointCloud, read_points, write_points};
pub use preview::{Preview, write_preview};
