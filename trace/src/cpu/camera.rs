//! Composited features of all pixels of a camera, and the record of their hits.
//!
//! Pixels are taken in tiles of 16×16 and, within a tile, in blocks of 4×4. A search fills one list
//! of hits per ray of a block, the lists are put in true order of distance, and [`crate::blend`]
//! does the rest. For the adjoint ([`CameraRecord::adjoint`]) a compact record of the blended hits
//! is kept. No memory is taken per tile, block or ray: threads and records reuse theirs.

use super::adjoint::RowPlaces;
use super::bins::{TILE, TILE_PIXELS, TileBins};
use super::bvh::{Bvh, RayScratch, Reach};
use super::harmonics::evaluate_harmonics;
use super::hits::BlockHits;
use super::search::{TileList, TileSurfel};
use super::tile::{BLOCKS, LANES, TileRays, pixels_of_tile};
use crate::blend::{BlendStatus, Blender, Contribution, LocalGradient, PixelValue};
use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::surfel::{Attributes, SeenSet, SurfelSet};
use crate::weights::BlendWeights;
use eagpt_scene::Camera;
use multiversion::multiversion;
use rayon::prelude::*;
use std::cell::RefCell;

/// How the hits of camera rays are found. All ways give the same features, bit for bit.
#[derive(Clone, Copy)]
pub enum HitSearch<'a> {
    /// Gaussians binned into tiles, tested against all pixels of a block at once. The fast one.
    Tiles,
    /// One ray at a time through the BVH.
    SingleRays(&'a Bvh),
}

/// Whether the blended hits are kept for [`CameraRecord::adjoint`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// Only the features.
    Nothing,
    /// A record for the adjoint.
    Record,
}

/// The blended hits of every pixel, kept for the adjoint, and memory that the next image reuses.
#[derive(Debug, Clone, Default)]
pub struct CameraRecord {
    /// Of the last image; none before the first.
    pub(super) camera: Option<Camera>,
    pub(super) tiles: Vec<TileRecord>,
    bins: TileBins,
    pub(super) rows: RowPlaces,
    /// Attributes as the camera sees them, where that makes a difference.
    pub(super) seen: Vec<Attributes>,
}

/// Record of a tile.
#[derive(Debug, Clone, Default)]
pub(super) struct TileRecord {
    features: Vec<Features>,
    /// Row of each slot; [`UNUSED`] where nothing was blended.
    rows: Vec<u32>,
    /// Index in the scene of each row.
    pub(super) gaussians: Vec<u32>,
    hits: Vec<BlendedHit>,
    /// End of each pixel's hits.
    ends: Vec<u32>,
    /// Of each row, once asked for.
    pub(super) gradients: Vec<LocalGradient>,
}

/// Row of a slot that no ray blends: of those of a search, many lie behind opaque surfaces.
const UNUSED: u32 = u32::MAX;

/// One blended hit of a ray, as the adjoint needs it again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BlendedHit {
    /// Slot of the Gaussian; see [`TileRecord::row_of`].
    slot: u32,
    /// Distance along the ray.
    pub(super) t: f32,
    /// Opacity α.
    pub(super) alpha: f32,
    /// Weight `T·α`.
    pub(super) weight: f32,
    /// In-plane coordinates in standard deviations.
    pub(super) u: f32,
    pub(super) v: f32,
}

/// Memory a thread reuses from tile to tile.
#[derive(Default)]
struct TileScratch {
    list: TileList,
    hits: BlockHits,
    rays: RayScratch,
    /// Hits of single rays, and the end of each pixel's.
    found: Vec<(f32, u32, f32)>,
    ends: Vec<usize>,
}

thread_local! {
    static SCRATCH: RefCell<TileScratch> = RefCell::default();
}

/// Traces one ray through every pixel centre of `camera`.
pub fn trace(
    set: &SurfelSet,
    camera: &Camera,
    search: HitSearch<'_>,
    keep: Keep,
) -> (GBuffer, CameraRecord) {
    let mut record = CameraRecord::default();
    let features = record.trace(set, camera, search, keep);
    (features, record)
}

impl CameraRecord {
    /// Traces one ray through every pixel centre of `camera`, as [`trace`] does, into the memory of
    /// an earlier record, which is lost.
    pub fn trace(
        &mut self,
        set: &SurfelSet,
        camera: &Camera,
        search: HitSearch<'_>,
        keep: Keep,
    ) -> GBuffer {
        self.camera = Some(*camera);
        let frame = camera.ray_frame();
        let (tiles_x, tiles_y) = (camera.width.div_ceil(TILE), camera.height.div_ceil(TILE));
        self.bins.fill(set, camera);
        self.tiles
            .resize_with((tiles_x * tiles_y) as usize, TileRecord::default);
        let bins = &self.bins;
        let seen = evaluate_harmonics(set, frame.origin, bins, &mut self.seen);
        self.tiles
            .par_iter_mut()
            .enumerate()
            .for_each(|(tile, record)| {
                let rays = TileRays::new(camera, &frame, tiles_x, tile);
                SCRATCH.with_borrow_mut(|scratch| {
                    record.clear();
                    match search {
                        HitSearch::SingleRays(bvh) => {
                            trace_tile_by_rays(seen, bvh, &rays, scratch, record, keep);
                        }
                        HitSearch::Tiles => {
                            trace_tile(seen, bins, tile, &rays, scratch, record, keep);
                        }
                    }
                    record.name_rows(&scratch.list.slots);
                });
            });
        self.gbuffer()
    }

    /// Composited features of the camera; of no pixel before the first.
    pub fn gbuffer(&self) -> GBuffer {
        let pixels = self.camera.as_ref().map(|camera| self.features(camera));
        GBuffer {
            width: self.camera.map_or(0, |camera| camera.width),
            height: self.camera.map_or(0, |camera| camera.height),
            pixels: pixels.unwrap_or_default(),
        }
    }

    fn features(&self, camera: &Camera) -> Vec<Features> {
        let mut pixels = vec![Features::default(); camera.num_pixels()];
        let tiles_x = camera.width.div_ceil(TILE) as usize;
        pixels
            .par_chunks_mut((camera.width * TILE) as usize)
            .enumerate()
            .for_each(|(band, rows)| {
                let start = band * (camera.width * TILE) as usize;
                for tile in band * tiles_x..(band + 1) * tiles_x {
                    for (p, pixel) in pixels_of_tile(camera, tile) {
                        rows[pixel - start] = self.tiles[tile].features[p];
                    }
                }
            });
        pixels
    }

    /// Number of blended hits of all pixels.
    pub fn num_hits(&self) -> usize {
        self.tiles.iter().map(|tile| tile.hits.len()).sum()
    }

    /// The weights of the blend in every pixel; see [`BlendWeights`].
    pub fn weights(&self, least: f32) -> BlendWeights {
        let Some(camera) = &self.camera else {
            return BlendWeights::default();
        };
        let per_tile: Vec<BlendWeights> = self
            .tiles
            .par_iter()
            .enumerate()
            .map(|(tile, record)| {
                let mut weights = BlendWeights::default();
                for (p, pixel) in pixels_of_tile(camera, tile) {
                    let hits = record.hits_of(p).iter();
                    let named = hits.map(|hit| (record.gaussians[record.row_of(hit)], hit.weight));
                    weights.push(pixel as u32, named, least);
                }
                weights
            })
            .collect();
        BlendWeights::joined(&per_tile)
    }

    /// Contribution of each Gaussian to the image. A Gaussian that several tiles saw comes once
    /// for each of them, tiles in order.
    pub fn contributions(&self, value: PixelValue<'_>) -> Vec<Contribution> {
        let Some(camera) = &self.camera else {
            return Vec::new();
        };
        let per_tile: Vec<Vec<Contribution>> = self
            .tiles
            .par_iter()
            .enumerate()
            .map(|(tile, record)| {
                let of = |&gaussian| Contribution {
                    gaussian,
                    ..Contribution::default()
                };
                let mut rows: Vec<Contribution> = record.gaussians.iter().map(of).collect();
                for (p, pixel) in pixels_of_tile(camera, tile) {
                    let value = value(pixel, &record.features[p]);
                    for hit in record.hits_of(p) {
                        let row = &mut rows[record.row_of(hit)];
                        row.add(hit.weight, pixel as u32, value);
                    }
                }
                // Tiles reach beyond the image's border; what was hit only there was not seen.
                rows.retain(|row| row.weight > 0.0);
                rows
            })
            .collect();
        per_tile.into_iter().flatten().collect()
    }
}

impl TileRecord {
    fn clear(&mut self) {
        self.features.clear();
        self.rows.clear();
        self.gaussians.clear();
        self.hits.clear();
        self.ends.clear();
    }

    /// Gives a row to each slot that was blended, in order.
    fn name_rows(&mut self, slots: &[TileSurfel]) {
        for (row, surfel) in self.rows.iter_mut().zip(slots) {
            if *row != UNUSED {
                *row = self.gaussians.len() as u32;
                self.gaussians.push(surfel.index);
            }
        }
    }

    /// The row of the Gaussian of a hit.
    #[inline(always)]
    pub(super) fn row_of(&self, hit: &BlendedHit) -> usize {
        self.rows[hit.slot as usize] as usize
    }

    /// The blended hits of a pixel of the tile, front to back.
    #[inline(always)]
    pub(super) fn hits_of(&self, pixel: usize) -> &[BlendedHit] {
        let start = match pixel {
            0 => 0,
            _ => self.ends[pixel - 1] as usize,
        };
        &self.hits[start..self.ends[pixel] as usize]
    }

    /// Blends the hits of a block. There are as many attributes as slots.
    #[inline(always)]
    fn blend(&mut self, attributes: &[Attributes], hits: &mut BlockHits, keep: Keep) {
        self.rows.resize(attributes.len(), UNUSED);
        for lane in 0..LANES {
            let mut blender = Blender::default();
            for (t, hit) in hits.ordered(lane) {
                let weight = blender.transmittance() * hit.alpha;
                let attributes = &attributes[hit.slot as usize];
                let status = blender.accumulate_turned(t, hit.alpha, attributes);
                if keep == Keep::Record && status != BlendStatus::Skipped {
                    self.rows[hit.slot as usize] = 0;
                    self.hits.push(BlendedHit {
                        slot: hit.slot,
                        t,
                        alpha: hit.alpha,
                        weight,
                        u: hit.u,
                        v: hit.v,
                    });
                }
                if status == BlendStatus::Last {
                    break;
                }
            }
            self.ends.push(self.hits.len() as u32);
            self.features.push(blender.finish());
        }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn trace_tile(
    set: SeenSet<'_>,
    bins: &TileBins,
    tile: usize,
    rays: &TileRays,
    scratch: &mut TileScratch,
    record: &mut TileRecord,
    keep: Keep,
) {
    let TileScratch { list, hits, .. } = scratch;
    list.fill(set, bins.list(tile), rays);
    for (block, directions) in rays.blocks.iter().enumerate() {
        hits.clear();
        if rays.is_in_image(block) {
            list.find_hits(block, directions, hits);
        }
        record.blend(&list.attributes, hits, keep);
    }
}

/// As [`trace_tile`], with the hits of the BVH.
fn trace_tile_by_rays(
    set: SeenSet<'_>,
    bvh: &Bvh,
    rays: &TileRays,
    scratch: &mut TileScratch,
    record: &mut TileRecord,
    keep: Keep,
) {
    let TileScratch {
        list,
        hits,
        rays: single,
        found,
        ends,
        ..
    } = scratch;
    found.clear();
    ends.clear();
    for p in 0..TILE_PIXELS {
        let ray = Ray::free(rays.origin, rays.blocks[p / LANES].direction(p % LANES));
        bvh.find_hits(&ray, Reach::UntilOpaque, single);
        found.extend(
            single
                .hits()
                .iter()
                .map(|hit| (hit.t(), hit.index(), hit.alpha)),
        );
        ends.push(found.len());
    }
    list.name_slots(set, rays.origin, found.iter().map(|hit| hit.1));
    let mut start = 0;
    for block in 0..BLOCKS {
        hits.clear();
        for lane in 0..LANES {
            let end = ends[block * LANES + lane];
            let direction = rays.blocks[block].direction(lane);
            for &(t, index, alpha) in &found[start..end] {
                let slot = list.slot_of(index);
                let met = list.slots[slot as usize].seen.meet(direction);
                hits.reserve(1);
                hits.push(lane, t, [alpha, met.u, met.v], slot);
            }
            start = end;
        }
        record.blend(&list.attributes, hits, keep);
    }
}
