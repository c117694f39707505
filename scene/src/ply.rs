//! PLY: Gaussians, point clouds, previews for splat viewers, and Gaussians of other programs.
//!
//! Readers take ascii and both binary byte orders, properties in any order and of any type, and
//! ignore what they do not know: other properties, lists, other elements. Counts in a header are
//! believed only as far as the file has bytes for them. Writers write binary little endian.

mod gaussians;
mod header;
mod points;
mod preview;
mod splats;
mod values;

#[cfg(test)]
mod tests;

pub use gaussians::{read_gaussians, write_gaussians};
pub use points::{PointCloud, read_points, write_points};
pub use preview::{Preview, write_preview};
pub use splats::{NUM_SPLAT_FUNCTIONS, SH_DEGREE_0, Splat, Splats, read_splats};
