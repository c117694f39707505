//! The rays of a tile of pixels, tested against binned Gaussians in SIMD lanes.
//!
//! A tile is divided into blocks of 4×4 pixels, one SIMD register of rays. Each Gaussian of the tile's list is tested against
//! all blocks at once, and then, block by block, against the rays of those it may cover. The hits of a block, and everything that
//! is done with them, stay in the processor's first cache.

use super::bins::{BinnedSurfel, TILE, TILE_PIXELS};
use super::hits::BlockHits;
use crate::blend::Face;
use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::surfel::{Payload, SeenSurfel, Surfel, SurfelSet, exp_of_negative};
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

/// Pixel grid of a tile: position and rays.
pub(super) struct TileRays {
    x0: u32,
    y0: u32,
    width: u32,
    height: u32,
    pub(super) origin: [f32; 3],
    /// Directions in blocks of one SIMD register. Pixels outside the image get rays, too.
    pub(super) blocks: [RayBlock; BLOCKS],
    grid: BlockGrid,
}

/// Directions of [`LANES`] rays, one array per axis.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct RayBlock {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
}

/// What [`LANES`] rays meet on the plane of one Gaussian.
struct BlockMet {
    t: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
    /// One byte for each ray, 1 where it hits: a comparison of vectors becomes this without shuffling lanes.
    hits: u128,
}

impl RayBlock {
    #[inline(always)]
    pub(super) fn direction(&self, lane: usize) -> [f32; 3] {
        [self.x[lane], self.y[lane], self.z[lane]]
    }

    fn set(&mut self, lane: usize, direction: Vec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = direction.into();
    }

    /// Separate loops over plain arrays: each becomes straight SIMD code.
    #[inline(always)]
    fn meet(&self, seen: &SeenSurfel) -> BlockMet {
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
            hits: u128::from_le_bytes(hits),
        }
    }
}

impl TileRays {
    pub(super) fn new(camera: &Camera, frame: &RayFrame, tiles_x: u32, tile: usize) -> Self {
        let (x0, y0) = (tile as u32 % tiles_x * TILE, tile as u32 / tiles_x * TILE);
        let mut rays = Self {
            x0,
            y0,
            width: camera.width,
            height: camera.height,
            origin: frame.origin.to_array(),
            blocks: [RayBlock::default(); BLOCKS],
            grid: BlockGrid::new(frame, x0, y0),
        };
        for block in 0..BLOCKS {
            for lane in 0..LANES {
                let (x, y) = rays.position(block, lane);
                let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
                rays.blocks[block].set(lane, direction);
            }
        }
        rays
    }

    fn position(&self, block: usize, lane: usize) -> (u32, u32) {
        pixel_position(self.x0, self.y0, block, lane)
    }

    /// Whether some pixel of a block lies in the image.
    pub(super) fn is_in_image(&self, block: usize) -> bool {
        let (x, y) = self.position(block, 0);
        x < self.width && y < self.height
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
struct BlockGrid {
    /// Unnormalised directions through the middles of the blocks.
    centers: RayBlock,
    /// Change of direction from a block's middle to its outermost pixel centres.
    half: [Vec3; 2],
    /// Bound of the length of directions.
    length: f32,
}

impl BlockGrid {
    /// From a block's middle to the centres of its outermost pixels, in pixels; a little more than 1.5.
    const HALF: f32 = BLOCK as f32 / 2.0 - 0.49;
    /// Bound of the rounding of in-plane coordinates here and in [`SeenSurfel::meet`], relative to the terms they are differences of: each
    /// is a handful of operations of 6e-8.
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
    /// For a direction d, unnormalised, `u·(d·n)` is a linear function of d, and so is `v·(d·n)`: over a block each stays within its value in
    /// the middle plus or minus what the steps to the edges make. A block where even the smallest `u² + v²` is beyond the cut is not met.
    #[inline(always)]
    fn may_hit(&self, seen: &SeenSurfel) -> u128 {
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

/// A Gaussian that rays of a tile may meet: a slot of the tile.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct TileSurfel {
    pub(super) seen: SeenSurfel,
    /// Index in the scene.
    pub(super) index: u32,
    /// No hit is closer than this.
    nearest: f32,
}

/// The Gaussians of a tile, copied from the scene, and which of them each block may see. Memory is reused from tile to tile.
///
/// Copies are made in loops that do nothing else: the scene is larger than the caches, and loads that wait for nothing wait together.
#[derive(Default)]
pub(super) struct TileList {
    surfels: Vec<Surfel>,
    /// In order of index.
    pub(super) slots: Vec<TileSurfel>,
    /// Of each slot, with the normal turned towards the rays' origin.
    pub(super) payloads: Vec<Payload>,
    /// Blocks that may see each slot, one byte for each block.
    seen_by: Vec<u128>,
    /// Slots by distance.
    nearest_first: Vec<BinnedSurfel>,
    /// Slots of each block, nearest first.
    blocks: [Vec<u32>; BLOCKS],
}

impl TileList {
    /// Takes the Gaussians of a list that some block may see.
    #[inline(always)]
    pub(super) fn fill(&mut self, set: &SurfelSet, binned: &[BinnedSurfel], rays: &TileRays) {
        let surfels = binned
            .iter()
            .map(|entry| set.surfels[entry.index() as usize]);
        self.surfels.clear();
        self.surfels.extend(surfels);
        self.slots.clear();
        self.seen_by.clear();
        self.nearest_first.clear();
        for (entry, surfel) in binned.iter().zip(&self.surfels) {
            let seen = surfel.seen_from(rays.origin);
            let seen_by = rays.grid.may_hit(&seen);
            if seen_by != 0 {
                let slot = BinnedSurfel::new(entry.nearest(), self.slots.len() as u32);
                self.nearest_first.push(slot);
                self.seen_by.push(seen_by);
                self.slots.push(TileSurfel {
                    seen,
                    index: entry.index(),
                    nearest: entry.nearest(),
                });
            }
        }
        self.copy_payloads(set);
        self.nearest_first.sort_unstable();
        self.blocks.iter_mut().for_each(Vec::clear);
        for entry in &self.nearest_first {
            let mut left = self.seen_by[entry.index() as usize];
            while left != 0 {
                self.blocks[left.trailing_zeros() as usize / 8].push(entry.index());
                left &= left - 1;
            }
        }
    }

    #[inline(always)]
    fn copy_payloads(&mut self, set: &SurfelSet) {
        let payloads = self
            .slots
            .iter()
            .map(|slot| set.payloads[slot.index as usize]);
        self.payloads.clear();
        self.payloads.extend(payloads);
        for (payload, slot) in self.payloads.iter_mut().zip(&self.slots) {
            *payload = payload.turned(Face::of_plane(slot.seen.plane));
        }
    }

    /// Gives slots to the Gaussians of `indices`, in order of index.
    pub(super) fn name_slots(
        &mut self,
        set: &SurfelSet,
        origin: [f32; 3],
        indices: impl Iterator<Item = u32>,
    ) {
        let mut sorted: Vec<u32> = indices.collect();
        sorted.sort_unstable();
        sorted.dedup();
        let slots = sorted.into_iter().map(|index| TileSurfel {
            seen: set.surfels[index as usize].seen_from(origin),
            index,
            nearest: 0.0,
        });
        self.slots.clear();
        self.slots.extend(slots);
        self.copy_payloads(set);
    }

    /// The slot of a Gaussian that [`Self::name_slots`] has named.
    pub(super) fn slot_of(&self, index: u32) -> u32 {
        self.slots.partition_point(|surfel| surfel.index < index) as u32
    }

    /// Tests the Gaussians that `block` may see against its rays.
    #[inline(always)]
    pub(super) fn find_hits(&self, block: usize, rays: &RayBlock, hits: &mut BlockHits) {
        let mut closing = BlockClosing::OPEN;
        for (at, &slot) in self.blocks[block].iter().enumerate() {
            let surfel = &self.slots[slot as usize];
            if at % CLOSING_INTERVAL == 0 {
                // The list is sorted by this bound: once every ray has ended before it, nothing further can be seen.
                if closing.closed_before(surfel.nearest) {
                    break;
                }
                hits.make_room(CLOSING_INTERVAL);
            }
            let met = rays.meet(&surfel.seen);
            if met.hits == 0 {
                continue;
            }
            // The exponential only where some pixel is hit.
            let mut alpha = [0.0_f32; LANES];
            for k in 0..LANES {
                let r2 = met.u[k] * met.u[k] + met.v[k] * met.v[k];
                alpha[k] = surfel.seen.opacity * exp_of_negative(-0.5 * r2);
            }
            let mut left = closing.add(&met, &alpha);
            while left != 0 {
                let k = left.trailing_zeros() as usize / 8;
                left &= left - 1;
                hits.push(k, met.t[k], [alpha[k], met.u[k], met.v[k]], slot);
            }
        }
    }
}

/// Gaussians between two checks for whether a block is closed.
const CLOSING_INTERVAL: usize = 8;

/// Whether and where the rays of a block have become opaque, from hits in any order. Hits so light that a ray that goes on might skip them are
/// left out ([`Self::SURE_ALPHA`]); once the product of `1 − α` over the others is under the limit, the ray has ended at or
/// before the farthest of them, whatever else it met.
struct BlockClosing {
    transmittance: [f32; LANES],
    farthest: [f32; LANES],
}

impl BlockClosing {
    const OPEN: Self = Self {
        transmittance: [1.0; LANES],
        farthest: [0.0; LANES],
    };
    /// As long as a ray goes on, the weight of such a hit is above [`MIN_WEIGHT`]. The factor covers rounding.
    const SURE_ALPHA: f32 = 1.01 * MIN_WEIGHT / MIN_TRANSMITTANCE;
    /// Under the limit of a ray by enough to cover the rounding of products in another order.
    const LIMIT: f32 = 0.99 * MIN_TRANSMITTANCE;

    /// Takes note of hits and returns, one byte for each ray, those that are not behind the end of their ray.
    #[inline(always)]
    fn add(&mut self, met: &BlockMet, alpha: &[f32; LANES]) -> u128 {
        let hits = met.hits.to_le_bytes();
        let mut counted = [0_u8; LANES];
        for k in 0..LANES {
            let hit = (hits[k] == 1) & (alpha[k] >= Self::SURE_ALPHA);
            let open = self.transmittance[k] >= Self::LIMIT;
            let behind = met.t[k] > self.farthest[k];
            counted[k] = u8::from((hits[k] == 1) & (open | !behind));
            let passes = if hit { 1.0 - alpha[k] } else { 1.0 };
            let farther = hit & open & behind;
            self.farthest[k] = if farther { met.t[k] } else { self.farthest[k] };
            self.transmittance[k] *= if open { passes } else { 1.0 };
        }
        u128::from_le_bytes(counted)
    }

    #[inline(always)]
    fn closed_before(&self, distance: f32) -> bool {
        let mut open = 0_u32;
        for k in 0..LANES {
            let closed = (self.transmittance[k] < Self::LIMIT) & (self.farthest[k] < distance);
            open += u32::from(!closed);
        }
        open == 0
    }
}
