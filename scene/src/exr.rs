//! OpenEXR: float images on disk.
//!
//! Reads any flat file whatever its channels are called, half, float or 32-bit unsigned, scan lines
//! or tiles, one part or many, and every compression the `exr` crate decodes. Images have the size
//! of the file's display window; where its data window is smaller the rest is 0. Deep data and
//! subsampled channels are refused. Writes one part, ZIP16, lossless.
//!
//! Colours become linear Rec.709: from the primaries of the attribute `chromaticities`, adapted to
//! its white by Bradford where that is another; without it they are taken for Rec.709.
//!
//! Channels are chosen by name. Colour is the first group of `R G B`, else of `X Y Z`, else a lone
//! channel three times; a single value is a lone channel (opacity `A` beside it does not count),
//! else the first channel of such a group. The group without a layer name goes first, then one
//! called `Combined` as Blender has it, then the order in the file.

mod blocks;
mod channels;
mod read;
mod write;

#[cfg(test)]
mod tests;

pub use read::{read_rgb, read_rgb_unclipped, read_single, read_size, read_vectors};
pub use write::{Precision, write_rgb, write_single};
