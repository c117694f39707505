//! Composited features of all pixels of a camera, and the record of their hits.
//!
//! Pixels are taken in tiles of 16×16 and, within a tile, in blocks of 4×4. A search fills one list
//! of hits per ray of a block, the lists are put in true order of distance, and [`crate::blend`]
//! does the rest. For the adjoint ([`CameraRecord::adjoint`]) a compact record of the blended hits
//! is kept. No memory is taken per tile, block or ray: threads and records reuse theirs.

use super::bins::{TILE, TILE_PIXELS, TileBins};
use super::bvh::{Bvh, RayScratch, Reach};
use super::harmonics::evaluate_harmonics;
use super::hits::BlockHits;
use super::record::{BlendedHit, CameraRecord, TileRecord, UNUSED, row_by_row};
use super::search::TileList;
use super::tile::{BLOCKS, LANES, TileRays};
use crate::attributes::Attributes;
use crate::blend::{BlendStatus, Blender};
use crate::camera_rays::CameraRays;
use crate::features::GBuffer;
use crate::ray::Ray;
use crate::surfel::{SeenSet, SurfelSet};
use eagpt_scene::Camera;
use eagpt_scene::camera::RayFrame;
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
    let features = record.trace(set, &CameraRays::from(*camera), search, keep);
    (features, record)
}

impl CameraRecord {
    /// Traces `rays` as [`trace`] does those through pixel centres, into the memory of an earlier
    /// record, which is lost.
    pub fn trace(
        &mut self,
        set: &SurfelSet,
        rays: &CameraRays,
        search: HitSearch<'_>,
        keep: Keep,
    ) -> GBuffer {
        self.rays = Some(rays.clone());
        let grid = rays.grid();
        self.bins.fill(set, rays);
        self.tiles
            .resize_with(num_tiles(&grid), TileRecord::default);
        let among = (set, &self.bins, &mut self.seen);
        let tracer = TileTracer::new(among, rays, (search, keep));
        self.tiles
            .par_iter_mut()
            .enumerate()
            .for_each(|(tile, record)| tracer.record(tile, record));
        self.gbuffer()
    }
}

/// Composited features of the pixels of `camera`, and what `read` makes of the record of each tile,
/// in their order. The memory of a record is used again for the next tile.
pub(super) fn read_tiles<T: Send>(
    set: &SurfelSet,
    camera: &Camera,
    read: impl Fn(usize, &TileRecord) -> T + Sync,
) -> (GBuffer, Vec<T>) {
    let rays = CameraRays::from(*camera);
    let (mut bins, mut seen) = (TileBins::default(), Vec::new());
    bins.fill(set, &rays);
    let among = (set, &bins, &mut seen);
    let tracer = TileTracer::new(among, &rays, (HitSearch::Tiles, Keep::Record));
    let tiles = (0..num_tiles(camera)).into_par_iter();
    let told = tiles.map_init(TileRecord::default, |record, tile| {
        tracer.record(tile, record);
        let told = read(tile, record);
        (std::mem::take(&mut record.features), told)
    });
    let (features, told): (Vec<_>, Vec<_>) = told.unzip();
    let features = GBuffer {
        width: camera.width,
        height: camera.height,
        pixels: row_by_row(camera, |tile| &features[tile]),
    };
    (features, told)
}

/// Tiles of a camera.
fn num_tiles(camera: &Camera) -> usize {
    (camera.width.div_ceil(TILE) * camera.height.div_ceil(TILE)) as usize
}

/// Traces the rays of a camera tile by tile.
struct TileTracer<'a> {
    set: SeenSet<'a>,
    bins: &'a TileBins,
    rays: &'a CameraRays,
    grid: Camera,
    frame: RayFrame,
    search: HitSearch<'a>,
    keep: Keep,
}

impl<'a> TileTracer<'a> {
    /// The Gaussians of `bins`, as seen by `rays`; `memory` is for how they look.
    fn new(
        (set, bins, memory): (&'a SurfelSet, &'a TileBins, &'a mut Vec<Attributes>),
        rays: &'a CameraRays,
        (search, keep): (HitSearch<'a>, Keep),
    ) -> Self {
        let grid = rays.grid();
        let frame = grid.ray_frame();
        Self {
            set: evaluate_harmonics(set, frame.origin, bins, memory),
            bins,
            rays,
            grid,
            frame,
            search,
            keep,
        }
    }

    /// Traces a tile into the memory of `record`.
    fn record(&self, tile: usize, record: &mut TileRecord) {
        let rays = TileRays::new(self.rays, (&self.grid, &self.frame), tile);
        SCRATCH.with_borrow_mut(|scratch| {
            record.clear();
            match self.search {
                HitSearch::SingleRays(bvh) => {
                    trace_tile_by_rays(self.set, bvh, &rays, scratch, record, self.keep);
                }
                HitSearch::Tiles => {
                    trace_tile(self.set, self.bins, tile, &rays, scratch, record, self.keep);
                }
            }
            record.name_rows(&scratch.list.slots);
        });
    }
}

impl TileRecord {
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
        list.find_hits(block, directions, hits);
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
        let block = &rays.blocks[p / LANES];
        if block.has_ray(p % LANES) {
            let ray = Ray::free(rays.origin, block.direction(p % LANES));
            bvh.find_hits(&ray, Reach::UntilOpaque, single);
            found.extend(
                single
                    .hits()
                    .iter()
                    .map(|hit| (hit.t(), hit.index(), hit.alpha)),
            );
        }
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
