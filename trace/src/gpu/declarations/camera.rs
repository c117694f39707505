//! Camera rays: structures and constants that their kernels share with Rust.

use crate::camera_rays::CameraRays;
use crate::cpu::bins::Projector;
use crate::gpu::layout::{Layout, layout};
use bytemuck::Zeroable as _;
use std::mem::offset_of;

/// Edge of a square tile in pixels: a workgroup has a thread for each pixel, of which there are as
/// many as run in step on any device.
pub(in crate::gpu) const TILE: u32 = 8;
/// Pixels of a tile.
pub(in crate::gpu) const TILE_PIXELS: u32 = TILE * TILE;

/// Tiles of one dispatch, whose split pixels are in one uniform: a kernel that runs for seconds is
/// stopped by the driver.
pub(in crate::gpu) const TILES_PER_DISPATCH: u32 = 4096;
/// Pixels that may be split along the edge of a tile.
pub(in crate::gpu) const SPLIT_EDGE: u32 = TILE / CameraRays::RAYS_PER_AXIS;
/// Vectors of [`SplitPixels`]: a bit for each pixel.
const SPLIT_VECTORS: usize = (TILES_PER_DISPATCH * SPLIT_EDGE * SPLIT_EDGE / 128) as usize;

/// Lower bits of a distance that keys leave out: the bound of a distance is lower by at most one
/// part in 1,024, and a sort takes three passes, not six.
pub(in crate::gpu) const KEY_SHIFT: u32 = 13;
/// Bits of a key: a distance is not negative, so its sign is left out, too.
pub(in crate::gpu) const KEY_BITS: u32 = 31 - KEY_SHIFT;
/// Key of what nobody sees: above that of every finite distance.
pub(in crate::gpu) const FARTHEST_KEY: u32 = (1 << KEY_BITS) - 1;

/// Hits that wait in the registers of a pixel until they can be blended. More than are usually met
/// on a surface within the size of one Gaussian; a longer list costs registers, a shorter one more
/// searches.
pub(in crate::gpu) const PENDING: u32 = 16;

/// Hits of a chunk of the record.
pub(in crate::gpu) const CHUNK_HITS: u32 = 16;
/// Words of a chunk: the place of the one before it, and three for each hit.
pub(in crate::gpu) const CHUNK_WORDS: u32 = 1 + 3 * CHUNK_HITS;
/// Words of the record for each pixel: its last chunk, its number of hits, and the first chunk,
/// which nearly every pixel needs.
pub(in crate::gpu) const PIXEL_WORDS: u32 = 2 + CHUNK_WORDS;

/// A Gaussian relative to the camera, as [`crate::surfel::SeenSurfel`].
#[derive(Debug, Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(in crate::gpu) struct Seen {
    normal: [f32; 3],
    plane: f32,
    axis_u: [f32; 3],
    offset_u: f32,
    axis_v: [f32; 3],
    offset_v: f32,
    cut2: f32,
    opacity: f32,
    /// No hit is closer than this.
    nearest: f32,
    padding: f32,
}

impl Seen {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(Seen {
            normal: "vec3f",
            plane: "f32",
            axis_u: "vec3f",
            offset_u: "f32",
            axis_v: "vec3f",
            offset_v: "f32",
            cut2: "f32",
            opacity: "f32",
            nearest: "f32",
            padding: "f32",
        })
    }
}

/// A camera as kernels know it.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct View {
    origin: [f32; 3],
    width: u32,
    /// As in [`eagpt_scene::camera::RayFrame`].
    base: [f32; 3],
    height: u32,
    step_x: [f32; 3],
    tiles_x: u32,
    step_y: [f32; 3],
    tiles_y: u32,
    /// Rows of the projection, scaled by the focal lengths.
    right: [f32; 3],
    center_x: f32,
    down: [f32; 3],
    center_y: f32,
    forward: [f32; 3],
    num_surfels: u32,
    /// Inward unit normals of the planes through the origin and the image's edges.
    sides: [[f32; 4]; 4],
    /// As [`Projector::margin`].
    margin: f32,
    padding: u32,
    more_padding: [u32; 2],
}

impl View {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(View {
            origin: "vec3f",
            width: "u32",
            base: "vec3f",
            height: "u32",
            step_x: "vec3f",
            tiles_x: "u32",
            step_y: "vec3f",
            tiles_y: "u32",
            right: "vec3f",
            center_x: "f32",
            down: "vec3f",
            center_y: "f32",
            forward: "vec3f",
            num_surfels: "u32",
            sides: "array<vec4f, 4>",
            margin: "f32",
            padding: "u32",
            more_padding: "vec2u",
        })
    }

    pub(in crate::gpu) fn new(rays: &CameraRays, num_surfels: u32) -> Self {
        let camera = rays.grid();
        let frame = camera.ray_frame();
        let projector = Projector::new(rays);
        Self {
            origin: projector.origin.to_array(),
            width: camera.width,
            base: frame.base.to_array(),
            height: camera.height,
            step_x: frame.step_x.to_array(),
            tiles_x: camera.width.div_ceil(TILE),
            step_y: frame.step_y.to_array(),
            tiles_y: camera.height.div_ceil(TILE),
            right: projector.right.to_array(),
            center_x: projector.center.0,
            down: projector.down.to_array(),
            center_y: projector.center.1,
            forward: projector.forward.to_array(),
            num_surfels,
            sides: projector.sides.map(|side| side.extend(0.0).to_array()),
            margin: projector.margin,
            padding: 0,
            more_padding: [0; 2],
        }
    }
}

/// Which pixels of the tiles of a dispatch have a ray at each of their places of the grid; see
/// [`CameraRays`]. A bit for each, tiles in order, pixels of a tile row by row.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct SplitPixels {
    bits: [[u32; 4]; SPLIT_VECTORS],
}

impl SplitPixels {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(SplitPixels {
            bits: "array<vec4u, 512>",
        })
    }

    /// Those of each dispatch for `rays`. Where no pixel is split, each place of the grid has its
    /// ray as if all were.
    pub(in crate::gpu) fn of(rays: &CameraRays) -> Vec<Self> {
        let grid = rays.grid();
        let tiles_x = grid.width.div_ceil(TILE);
        let num_tiles = tiles_x * grid.height.div_ceil(TILE);
        let num = num_tiles.div_ceil(TILES_PER_DISPATCH) as usize;
        let Some(split) = rays.split() else {
            return vec![
                Self {
                    bits: [[u32::MAX; 4]; SPLIT_VECTORS]
                };
                num
            ];
        };
        let mut all = vec![Self::zeroed(); num];
        let width = rays.camera().width;
        for (pixel, _) in split.iter().enumerate().filter(|(_, is_split)| **is_split) {
            let (x, y) = (pixel as u32 % width, pixel as u32 / width);
            let tile = y / SPLIT_EDGE * tiles_x + x / SPLIT_EDGE;
            let within = y % SPLIT_EDGE * SPLIT_EDGE + x % SPLIT_EDGE;
            let bit = tile % TILES_PER_DISPATCH * SPLIT_EDGE * SPLIT_EDGE + within;
            let words = all[(tile / TILES_PER_DISPATCH) as usize]
                .bits
                .as_flattened_mut();
            words[(bit / 32) as usize] |= 1 << (bit % 32);
        }
        all
    }
}

/// Some tiles of an image, in the order of tiles, and where things of theirs begin.
#[derive(Debug, Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct Band {
    pub(in crate::gpu) first_tile: u32,
    pub(in crate::gpu) end_tile: u32,
    /// Pixel that buffers of the band begin with.
    pub(in crate::gpu) first_pixel: u32,
    /// Word of the record that chunks beside the pixels' own begin with.
    pub(in crate::gpu) first_chunk: u32,
    /// Place in the lists that rows of gradients begin with.
    pub(in crate::gpu) first_place: u32,
}

impl Band {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(Band {
            first_tile: "u32",
            end_tile: "u32",
            first_pixel: "u32",
            first_chunk: "u32",
            first_place: "u32",
        })
    }
}

/// Numbers that kernels hand on to others and to the host.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Counters {
    /// Gaussians of the scene.
    pub num_gaussians: u32,
    /// Entries that the lists of tiles need.
    pub entries: u32,
    /// Chunks that the record of hits needs beside one for each pixel.
    pub chunks: u32,
    /// Overflow flag: not 0 once something did not fit, until buffers have grown.
    pub failed: u32,
}

/// Places of the counters in a buffer of words.
pub(in crate::gpu) const PLACES: [(&str, u32); 4] = [
    ("COUNTER_ENTRIES", ENTRIES),
    ("COUNTER_CHUNKS", word(offset_of!(Counters, chunks))),
    ("COUNTER_FAILED", word(offset_of!(Counters, failed))),
    ("NUM_COUNTERS", word(size_of::<Counters>())),
];
/// Place of the number of Gaussians.
pub(in crate::gpu) const GAUSSIANS: u32 = word(offset_of!(Counters, num_gaussians));
/// Place of the number of entries.
pub(in crate::gpu) const ENTRIES: u32 = word(offset_of!(Counters, entries));

const fn word(offset: usize) -> u32 {
    (offset / size_of::<u32>()) as u32
}
