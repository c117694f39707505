//! Blended sums of all pixels of a camera, and their adjoint.
//!
//! Pixels are taken in tiles of 8×8. A search fills one list of hits per pixel, the lists are sorted by true distance, and
//! [`crate::blend`] does the rest. For the adjoint a compact record of the blended hits is kept; gradients gather in one
//! row per tile and Gaussian, and rows are added in the order of the tiles, so that the result is the same for any number
//! of threads.

use super::bins::{BinnedSurfel, TILE, TILE_PIXELS, TileBins};
use super::bvh::{Bvh, RayScratch, Reach};
use crate::blend::{
    AdjointSurfel, BlendedHit, Blender, Hit, LocalGradient, Offered, adjoint, sort_hits,
};
use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::ray::Ray;
use crate::sums::{SumImage, Sums};
use crate::surfel::{SeenSurfel, SurfelSet};
use eagpt_scene::Camera;
use eagpt_scene::camera::RayFrame;
use multiversion::multiversion;
use rayon::prelude::*;
use std::cell::RefCell;

/// How the hits of camera rays are found. All ways give the same sums, bit for bit.
#[derive(Clone, Copy)]
pub enum HitSearch<'a> {
    /// Gaussians binned into tiles, tested against all pixels of a tile at once. The fast one.
    Tiles,
    /// One ray at a time through the BVH.
    SingleRays(&'a Bvh),
}

/// The blended hits of every pixel, kept for the adjoint.
#[derive(Debug, Clone)]
pub struct CameraRecord {
    camera: Camera,
    tiles: Vec<TileRecord>,
}

#[derive(Debug, Clone, Default)]
struct TileRecord {
    /// Index in the scene of each slot.
    gaussians: Vec<u32>,
    hits: Vec<BlendedHit>,
    /// End of each pixel's hits.
    ends: Vec<u32>,
}

/// Pixel grid of a tile: position and rays.
struct TileRays {
    x0: u32,
    y0: u32,
    width: u32,
    height: u32,
    origin: [f32; 3],
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
    /// One bit for each ray that hits.
    mask: u32,
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
        let mut counts = [0_u32; LANES];
        for k in 0..LANES {
            let met = seen.meet([self.x[k], self.y[k], self.z[k]]);
            t[k] = met.t;
            exponent[k] = -0.5 * (met.u * met.u + met.v * met.v);
            counts[k] = u32::from(seen.counts(&met)) << k;
        }
        let mut mask = 0;
        for bit in counts {
            mask |= bit;
        }
        BlockHits { t, exponent, mask }
    }
}

impl TileRays {
    fn new(camera: &Camera, frame: &RayFrame, tiles_x: u32, tile: usize) -> Self {
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

    fn direction(&self, pixel: usize) -> [f32; 3] {
        self.blocks[pixel / LANES].direction(pixel % LANES)
    }

    /// The tile's pixels that lie in the image: (pixel of the tile, pixel of the image).
    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..TILE_PIXELS).filter_map(|p| {
            let (x, y) = (self.x0 + p as u32 % TILE, self.y0 + p as u32 / TILE);
            (x < self.width && y < self.height).then_some((p, (y * self.width + x) as usize))
        })
    }
}

/// Memory a thread reuses from tile to tile.
#[derive(Default)]
struct TileScratch {
    hits: Vec<Vec<Hit>>,
    rays: RayScratch,
    transmittances: Vec<f32>,
    seen: Vec<SeenSurfel>,
}

thread_local! {
    static SCRATCH: RefCell<TileScratch> = RefCell::default();
}

/// Whether the blended hits are kept for [`CameraRecord::adjoint`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// Only the sums.
    Nothing,
    /// A record for the adjoint.
    Record,
}

/// Traces one ray through every pixel centre of `camera`.
pub fn trace(
    set: &SurfelSet,
    camera: &Camera,
    search: HitSearch<'_>,
    keep: Keep,
) -> (SumImage, CameraRecord) {
    let frame = camera.ray_frame();
    let bins = match search {
        HitSearch::Tiles => Some(TileBins::new(set, camera)),
        HitSearch::SingleRays(_) => None,
    };
    let (tiles_x, tiles_y) = (camera.width.div_ceil(TILE), camera.height.div_ceil(TILE));
    let tiles: Vec<(Vec<Sums>, TileRecord)> = (0..(tiles_x * tiles_y) as usize)
        .into_par_iter()
        .map(|tile| {
            let rays = TileRays::new(camera, &frame, tiles_x, tile);
            SCRATCH.with_borrow_mut(|scratch| {
                scratch.hits.resize_with(TILE_PIXELS, Vec::new);
                scratch.hits.iter_mut().for_each(Vec::clear);
                let gaussians = match (search, &bins) {
                    (HitSearch::SingleRays(bvh), _) => {
                        find_hits_by_rays(bvh, &rays, scratch);
                        name_slots(&mut scratch.hits)
                    }
                    (_, Some(bins)) => {
                        find_hits_in_tile(set, bins.list(tile), &rays, &mut scratch.hits);
                        bins.list(tile).iter().map(|entry| entry.index).collect()
                    }
                    (HitSearch::Tiles, None) => Vec::new(),
                };
                blend_tile(set, &rays, &mut scratch.hits, gaussians, keep)
            })
        })
        .collect();
    let mut pixels = vec![Sums::default(); camera.num_pixels()];
    let mut records = Vec::with_capacity(tiles.len());
    for (tile, (sums, record)) in tiles.into_iter().enumerate() {
        let rays = (tile as u32 % tiles_x * TILE, tile as u32 / tiles_x * TILE);
        for (row, sums) in sums.chunks_exact(TILE as usize).enumerate() {
            let y = rays.1 + row as u32;
            let count = (camera.width - rays.0).min(TILE) as usize;
            if y < camera.height {
                let start = (y * camera.width + rays.0) as usize;
                pixels[start..start + count].copy_from_slice(&sums[..count]);
            }
        }
        records.push(record);
    }
    (
        SumImage {
            width: camera.width,
            height: camera.height,
            pixels,
        },
        CameraRecord {
            camera: *camera,
            tiles: records,
        },
    )
}

/// Tests the binned Gaussians against all rays of a tile; hits carry slots, which are positions in `list`.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn find_hits_in_tile(
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
            if met.mask == 0 {
                continue;
            }
            // The exponential only where some pixel is hit.
            let alpha = met
                .exponent
                .map(|e| seen.opacity * crate::surfel::exp_of_negative(e));
            closing[block].add(&met, &alpha);
            let mut mask = met.mask;
            while mask != 0 {
                let k = mask.trailing_zeros() as usize;
                mask &= mask - 1;
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
        for k in 0..LANES {
            let hit = ((met.mask >> k) & 1 == 1) & (alpha[k] >= Self::SURE_ALPHA);
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

fn find_hits_by_rays(bvh: &Bvh, rays: &TileRays, scratch: &mut TileScratch) {
    for (p, _) in rays.pixels() {
        let ray = Ray::free(rays.origin, rays.direction(p));
        bvh.find_hits(&ray, Reach::UntilOpaque, &mut scratch.rays);
        scratch.hits[p].extend_from_slice(scratch.rays.hits());
    }
}

/// Replaces the scene indices in `hits` by slots, in order of index, and returns the index of each slot.
fn name_slots(hits: &mut [Vec<Hit>]) -> Vec<u32> {
    let mut gaussians: Vec<u32> = hits.iter().flatten().map(Hit::index).collect();
    gaussians.sort_unstable();
    gaussians.dedup();
    for hit in hits.iter_mut().flatten() {
        let slot = gaussians.partition_point(|&g| g < hit.index());
        *hit = Hit::new(hit.t(), slot as u32, hit.alpha);
    }
    gaussians
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn blend_tile(
    set: &SurfelSet,
    rays: &TileRays,
    hits: &mut [Vec<Hit>],
    gaussians: Vec<u32>,
    keep: Keep,
) -> (Vec<Sums>, TileRecord) {
    let mut sums = vec![Sums::default(); TILE_PIXELS];
    let mut record = TileRecord {
        gaussians,
        hits: Vec::new(),
        ends: Vec::new(),
    };
    for (p, list) in hits.iter_mut().enumerate() {
        sort_hits(list);
        let direction = rays.direction(p);
        let mut blender = Blender::default();
        for hit in list.iter() {
            let index = record.gaussians[hit.index() as usize] as usize;
            let offered = blender.offer(hit.t(), hit.alpha, &set.payloads[index], direction);
            if keep == Keep::Record && offered != Offered::Skipped {
                record.hits.push(BlendedHit {
                    slot: hit.index(),
                    t: hit.t(),
                    alpha: hit.alpha,
                });
            }
            if offered == Offered::Last {
                break;
            }
        }
        record.ends.push(record.hits.len() as u32);
        sums[p] = blender.finish();
    }
    (sums, record)
}

impl CameraRecord {
    /// Number of blended hits of all pixels.
    pub fn num_hits(&self) -> usize {
        self.tiles.iter().map(|tile| tile.hits.len()).sum()
    }

    /// Gradient of the loss with respect to every Gaussian of `set` (the set that was traced), given `d_sums` =
    /// dL/dV for every pixel, row by row. Gaussians that no ray met get zeros. `scales` are the in-plane scales, `[n]`.
    pub fn adjoint(
        &self,
        set: &SurfelSet,
        scales: &[glam::Vec2],
        d_sums: &[Sums],
    ) -> Vec<LocalGradient> {
        let frame = self.camera.ray_frame();
        let tiles_x = self.camera.width.div_ceil(TILE);
        let rows: Vec<Vec<LocalGradient>> = self
            .tiles
            .par_iter()
            .enumerate()
            .map(|(tile, record)| {
                let rays = TileRays::new(&self.camera, &frame, tiles_x, tile);
                SCRATCH.with_borrow_mut(|scratch| {
                    adjoint_of_tile(set, scales, record, &rays, d_sums, scratch)
                })
            })
            .collect();
        self.sum_rows(set.len(), &rows)
    }

    /// Adds the rows of each Gaussian in the order of the tiles.
    fn sum_rows(&self, num_gaussians: usize, rows: &[Vec<LocalGradient>]) -> Vec<LocalGradient> {
        let mut starts = vec![0_u32; num_gaussians + 1];
        for &g in self.tiles.iter().flat_map(|tile| &tile.gaussians) {
            starts[g as usize + 1] += 1;
        }
        for g in 0..num_gaussians {
            starts[g + 1] += starts[g];
        }
        let mut places = vec![(0_u32, 0_u32); starts[num_gaussians] as usize];
        let mut next = starts.clone();
        for (tile, record) in self.tiles.iter().enumerate() {
            for (slot, &g) in record.gaussians.iter().enumerate() {
                places[next[g as usize] as usize] = (tile as u32, slot as u32);
                next[g as usize] += 1;
            }
        }
        (0..num_gaussians)
            .into_par_iter()
            .with_min_len(1024)
            .map(|g| {
                let mut total = LocalGradient::default();
                for &(tile, slot) in &places[starts[g] as usize..starts[g + 1] as usize] {
                    total.add(&rows[tile as usize][slot as usize]);
                }
                total
            })
            .collect()
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn adjoint_of_tile(
    set: &SurfelSet,
    scales: &[glam::Vec2],
    record: &TileRecord,
    rays: &TileRays,
    d_sums: &[Sums],
    scratch: &mut TileScratch,
) -> Vec<LocalGradient> {
    let mut rows = vec![LocalGradient::default(); record.gaussians.len()];
    scratch.seen.clear();
    scratch.seen.extend(
        record
            .gaussians
            .iter()
            .map(|&g| set.surfels[g as usize].seen_from(rays.origin)),
    );
    let seen = &scratch.seen;
    for (p, pixel) in rays.pixels() {
        let start = if p == 0 {
            0
        } else {
            record.ends[p - 1] as usize
        };
        let hits = &record.hits[start..record.ends[p] as usize];
        adjoint(
            hits,
            rays.direction(p),
            &d_sums[pixel],
            |slot| {
                let index = record.gaussians[slot as usize] as usize;
                AdjointSurfel {
                    seen: &seen[slot as usize],
                    scale: scales[index].to_array(),
                    payload: &set.payloads[index],
                }
            },
            &mut scratch.transmittances,
            |slot, gradient| rows[slot as usize].add(&gradient),
        );
    }
    rows
}
