//! The rays of a tile of pixels, tested against binned Gaussians in SIMD lanes.

use super::bins::{BinnedSurfel, TILE, TILE_PIXELS};
use crate::blend::Hit;
use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::surfel::{SeenSurfel, SurfelSet};
use eagpt_scene::Camera;
use eagpt_scene::camera::RayFrame;
use multiversion::multiversion;

/// Pixel grid of a tile: position and rays.
pub(super) struct TileRays {
    x0: u32,
    y0: u32,
    width: u32,
    height: u32,
    pub(super) origin: [f32; 3],
    /// Directions in blocks of one SIMD register. Pixels outside the image get rays, too.
    blocks: [RayBlock; TILE_PIXELS / LANES],
}

/// Rays tested at once: two rows of a tile, one AVX-512 register.
const LANES: usize = 16;
/// Rows of a tile in a block.
const BLOCK_ROWS: u32 = LANES as u32 / TILE;

/// Directions of [`LANES`] rays, one array per axis.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
struct RayBlock {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
}

/// What [`LANES`] rays meet on the plane of one Gaussian.
struct BlockHits {
    t: [f32; LANES],
    /// Exponent of the Gaussian, `−(u² + v²)/2`.
    exponent: [f32; LANES],
    /// One byte for each ray, 1 where it hits: a comparison of vectors becomes this without shuffling lanes.
    hits: u128,
}

impl RayBlock {
    fn direction(&self, lane: usize) -> [f32; 3] {
        [self.x[lane], self.y[lane], self.z[lane]]
    }

    /// Separate loops over plain arrays: each becomes straight SIMD code.
    #[inline(always)]
    fn meet(&self, seen: &SeenSurfel) -> BlockHits {
        let mut t = [0.0_f32; LANES];
        let mut exponent = [0.0_f32; LANES];
        let mut hits = [0_u8; LANES];
        for k in 0..LANES {
            let met = seen.meet([self.x[k], self.y[k], self.z[k]]);
            t[k] = met.t;
            exponent[k] = -0.5 * (met.u * met.u + met.v * met.v);
            hits[k] = u8::from(seen.counts(&met));
        }
        BlockHits {
            t,
            exponent,
            hits: u128::from_le_bytes(hits),
        }
    }
}

impl TileRays {
    pub(super) fn new(camera: &Camera, frame: &RayFrame, tiles_x: u32, tile: usize) -> Self {
        let (x0, y0) = (tile as u32 % tiles_x * TILE, tile as u32 / tiles_x * TILE);
        let mut blocks = [RayBlock::default(); TILE_PIXELS / LANES];
        for p in 0..TILE_PIXELS {
            let (x, y) = (x0 + p as u32 % TILE, y0 + p as u32 / TILE);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let (block, lane) = (&mut blocks[p / LANES], p % LANES);
            (block.x[lane], block.y[lane], block.z[lane]) = direction.into();
        }
        Self {
            x0,
            y0,
            width: camera.width,
            height: camera.height,
            origin: frame.origin.to_array(),
            blocks,
        }
    }

    pub(super) fn direction(&self, pixel: usize) -> [f32; 3] {
        self.blocks[pixel / LANES].direction(pixel % LANES)
    }

    /// The tile's pixels that lie in the image: (pixel of the tile, pixel of the image).
    pub(super) fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..TILE_PIXELS).filter_map(|p| {
            let (x, y) = (self.x0 + p as u32 % TILE, self.y0 + p as u32 / TILE);
            (x < self.width && y < self.height).then_some((p, (y * self.width + x) as usize))
        })
    }
}

/// Tests the binned Gaussians against all rays of a tile; hits carry slots, which are positions in `list`.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
pub(super) fn find_hits_in_tile(
    set: &SurfelSet,
    list: &[BinnedSurfel],
    rays: &TileRays,
    hits: &mut [Vec<Hit>],
) {
    let mut closing = [BlockClosing::OPEN; TILE_PIXELS / LANES];
    for (slot, entry) in list.iter().enumerate() {
        // The list is sorted by this bound: once every ray has ended before it, nothing further can be seen.
        if slot % CLOSING_INTERVAL == 0
            && closing
                .iter()
                .all(|block| block.closed_before(entry.nearest))
        {
            break;
        }
        let seen = set.surfels[entry.index as usize].seen_from(rays.origin);
        let first = entry.first_row.saturating_sub(rays.y0) / BLOCK_ROWS;
        let end = (entry.end_row - rays.y0).min(TILE).div_ceil(BLOCK_ROWS);
        for block in first as usize..end as usize {
            let met = rays.blocks[block].meet(&seen);
            if met.hits == 0 {
                continue;
            }
            // The exponential only where some pixel is hit.
            let alpha = met
                .exponent
                .map(|e| seen.opacity * crate::surfel::exp_of_negative(e));
            closing[block].add(&met, &alpha);
            let mut left = met.hits;
            while left != 0 {
                let k = left.trailing_zeros() as usize / 8;
                left &= left - 1;
                hits[block * LANES + k].push(Hit::new(met.t[k], slot as u32, alpha[k]));
            }
        }
    }
}

/// Gaussians between two checks for whether a tile is closed.
const CLOSING_INTERVAL: usize = 16;

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

    #[inline(always)]
    fn add(&mut self, met: &BlockHits, alpha: &[f32; LANES]) {
        let hits = met.hits.to_le_bytes();
        for k in 0..LANES {
            let hit = (hits[k] == 1) & (alpha[k] >= Self::SURE_ALPHA);
            let open = self.transmittance[k] >= Self::LIMIT;
            let passes = if hit { 1.0 - alpha[k] } else { 1.0 };
            let farther = hit & open & (met.t[k] > self.farthest[k]);
            self.farthest[k] = if farther { met.t[k] } else { self.farthest[k] };
            self.transmittance[k] *= if open { passes } else { 1.0 };
        }
    }

    fn closed_before(&self, distance: f32) -> bool {
        (0..LANES).all(|k| self.transmittance[k] < Self::LIMIT && self.farthest[k] < distance)
    }
}
