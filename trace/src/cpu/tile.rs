//! The rays of a tile of pixels, in blocks that fit a SIMD register, and the tests of a Gaussian
//! against all rays of a block and all blocks of a tile.

use super::bins::{TILE, TILE_PIXELS};
use crate::camera_rays::CameraRays;
use crate::surfel::SeenSurfel;
use eagpt_scene::Camera;
use eagpt_scene::camera::RayFrame;
use glam::Vec3;

/// Rays tested at once: one AVX-512 register.
pub(super) const LANES: usize = 16;
/// Edge of a block of pixels.
const BLOCK: u32 = 4;
/// Blocks in a row of a tile.
const BLOCKS_X: u32 = TILE / BLOCK;
/// Blocks of a tile.
pub(super) const BLOCKS: usize = TILE_PIXELS / LANES;

const _: () = assert!(BLOCK * BLOCK == LANES as u32 && BLOCKS == LANES);

/// The rays of a tile of their grid.
pub(super) struct TileRays {
    pub(super) origin: [f32; 3],
    /// In blocks of one SIMD register.
    pub(super) blocks: [RayBlock; BLOCKS],
    pub(super) grid: BlockGrid,
}

/// Directions of [`LANES`] rays, one array per axis.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct RayBlock {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
    /// One byte for each lane, 1 where there is a ray: not outside the image.
    rays: u128,
}

/// Intersections of [`LANES`] rays with the plane of one Gaussian.
pub(super) struct BlockMet {
    pub(super) t: [f32; LANES],
    pub(super) u: [f32; LANES],
    pub(super) v: [f32; LANES],
    /// One byte for each ray, 1 where it hits: a comparison of vectors becomes this without
    /// shuffling lanes.
    pub(super) hits: u128,
}

impl RayBlock {
    #[inline(always)]
    pub(super) fn direction(&self, lane: usize) -> [f32; 3] {
        [self.x[lane], self.y[lane], self.z[lane]]
    }

    #[inline(always)]
    pub(super) fn has_ray(&self, lane: usize) -> bool {
        self.rays.to_le_bytes()[lane] == 1
    }

    /// One byte for each lane, 1 where there is a ray.
    #[inline(always)]
    pub(super) fn rays(&self) -> u128 {
        self.rays
    }

    fn set(&mut self, lane: usize, direction: Vec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = direction.into();
    }

    /// Separate loops over arrays of floats: each becomes straight SIMD code.
    #[inline(always)]
    pub(super) fn meet(&self, seen: &SeenSurfel) -> BlockMet {
        let mut t = [0.0_f32; LANES];
        let mut u = [0.0_f32; LANES];
        let mut v = [0.0_f32; LANES];
        let mut hits = [0_u8; LANES];
        for k in 0..LANES {
            let met = seen.meet([self.x[k], self.y[k], self.z[k]]);
            t[k] = met.t;
            u[k] = met.u;
            v[k] = met.v;
            hits[k] = u8::from(seen.counts(&met));
        }
        BlockMet {
            t,
            u,
            v,
            hits: u128::from_le_bytes(hits) & self.rays,
        }
    }
}

impl TileRays {
    /// The rays of a tile of `grid`, the grid of `rays`, whose directions are those of `frame`.
    pub(super) fn new(rays: &CameraRays, (grid, frame): (&Camera, &RayFrame), tile: usize) -> Self {
        let tiles_x = grid.width.div_ceil(TILE);
        let (x0, y0) = (tile as u32 % tiles_x * TILE, tile as u32 / tiles_x * TILE);
        let block = |block: usize| {
            let mut made = RayBlock::default();
            let mut has_ray = [0_u8; LANES];
            for lane in 0..LANES {
                let (x, y) = pixel_position(x0, y0, block, lane);
                if x < grid.width
                    && y < grid.height
                    && let Some(offset) = rays.offset(x, y)
                {
                    has_ray[lane] = 1;
                    made.set(lane, frame.direction(x as f32 + offset, y as f32 + offset));
                }
            }
            made.rays = u128::from_le_bytes(has_ray);
            made
        };
        Self {
            origin: frame.origin.to_array(),
            blocks: std::array::from_fn(block),
            grid: BlockGrid::new(frame, x0, y0),
        }
    }
}

/// Column and row of a pixel, given the tile's first.
fn pixel_position(x0: u32, y0: u32, block: usize, lane: usize) -> (u32, u32) {
    let (block, lane) = (block as u32, lane as u32);
    (
        x0 + block % BLOCKS_X * BLOCK + lane % BLOCK,
        y0 + block / BLOCKS_X * BLOCK + lane / BLOCK,
    )
}

/// The pixels of a tile that lie in the image: (pixel of the tile, pixel of the image, row by row).
pub(super) fn pixels_of_tile(
    camera: &Camera,
    tile: usize,
) -> impl DoubleEndedIterator<Item = (usize, usize)> + use<> {
    let (width, height) = (camera.width, camera.height);
    let tiles_x = width.div_ceil(TILE);
    let (x0, y0) = (tile as u32 % tiles_x * TILE, tile as u32 / tiles_x * TILE);
    (0..TILE_PIXELS).filter_map(move |p| {
        let (x, y) = pixel_position(x0, y0, p / LANES, p % LANES);
        (x < width && y < height).then(|| (p, y as usize * width as usize + x as usize))
    })
}

/// The blocks of a tile on the image plane, for finding out which of them a Gaussian may cover.
pub(super) struct BlockGrid {
    /// Unnormalised directions through the middles of the blocks.
    centers: RayBlock,
    /// Change of direction from a block's middle to its outermost pixel centres.
    half: [Vec3; 2],
    /// Bound of the length of directions.
    length: f32,
}

impl BlockGrid {
    /// From a block's middle to the centres of its outermost pixels, in pixels; a little more than
    /// 1.5.
    const HALF: f32 = BLOCK as f32 / 2.0 - 0.49;
    /// Bound of the rounding of in-plane coordinates here and in [`SeenSurfel::meet`], relative to
    /// the terms they are differences of: each is a handful of operations of 6e-8.
    const ROUNDING: f32 = 2e-6;

    fn new(frame: &RayFrame, x0: u32, y0: u32) -> Self {
        let mut centers = RayBlock::default();
        let mut length = 0.0_f32;
        for block in 0..BLOCKS {
            let (x, y) = pixel_position(x0, y0, block, 0);
            let middle = BLOCK as f32 / 2.0;
            let direction = frame.base
                + frame.step_x * (x as f32 + middle)
                + frame.step_y * (y as f32 + middle);
            centers.set(block, direction);
            length = length.max(direction.length());
        }
        let half = [frame.step_x * Self::HALF, frame.step_y * Self::HALF];
        Self {
            centers,
            half,
            length: length + half[0].length() + half[1].length(),
        }
    }

    /// One byte for each block, 1 where one of its rays may hit.
    ///
    /// For a direction d, unnormalised, `u·(d·n)` is a linear function of d, and so is `v·(d·n)`:
    /// over a block each stays within its value in the middle plus or minus what the steps to the
    /// edges make. A block where even the smallest `u² + v²` is beyond the cut is not met.
    #[inline(always)]
    pub(super) fn may_hit(&self, seen: &SeenSurfel) -> u128 {
        let normal = Vec3::from(seen.normal);
        let (axis_u, axis_v) = (Vec3::from(seen.axis_u), Vec3::from(seen.axis_v));
        let reach = |function: Vec3, terms: f32| {
            function.dot(self.half[0]).abs()
                + function.dot(self.half[1]).abs()
                + Self::ROUNDING * self.length * terms
        };
        let norm = |axis: Vec3| axis.abs().element_sum();
        let function_u = axis_u * seen.plane - normal * seen.offset_u;
        let function_v = axis_v * seen.plane - normal * seen.offset_v;
        let reach_u = reach(
            function_u,
            norm(axis_u) * seen.plane.abs() + seen.offset_u.abs(),
        );
        let reach_v = reach(
            function_v,
            norm(axis_v) * seen.plane.abs() + seen.offset_v.abs(),
        );
        let reach_n = reach(normal, 1.0);
        // In front of the origin the plane and the cosine have the same sign.
        let facing = if seen.plane < 0.0 { -normal } else { normal };
        let mut hits = [0_u8; LANES];
        for k in 0..LANES {
            let d = [self.centers.x[k], self.centers.y[k], self.centers.z[k]];
            let along = |f: Vec3| d[0] * f.x + d[1] * f.y + d[2] * f.z;
            let cosine = along(facing) + reach_n;
            let u = along(function_u).abs() - reach_u;
            let v = along(function_v).abs() - reach_v;
            let (u, v) = (if u > 0.0 { u } else { 0.0 }, if v > 0.0 { v } else { 0.0 });
            hits[k] = u8::from((cosine > 0.0) & (u * u + v * v <= seen.cut2 * (cosine * cosine)));
        }
        u128::from_le_bytes(hits)
    }
}
