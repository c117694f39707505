//! Blended sums of all pixels of a camera, and their adjoint.
//!
//! Pixels are taken in tiles of 8×8. A search fills one list of hits per pixel, the lists are sorted by true distance, and
//! [`crate::blend`] does the rest. For the adjoint a compact record of the blended hits is kept; gradients gather in one
//! row per tile and Gaussian, and rows are added in the order of the tiles, so that the result is the same for any number
//! of threads.

use super::bins::{TILE, TILE_PIXELS, TileBins};
use super::bvh::{Bvh, RayScratch, Reach};
use super::tile::{TileRays, find_hits_in_tile};
use super::weights::BlendWeights;
use crate::blend::{
    AdjointSurfel, BlendedHit, Blender, Hit, LocalGradient, Offered, adjoint, sort_hits,
};
use crate::ray::Ray;
use crate::sums::{SumImage, Sums};
use crate::surfel::{SeenSurfel, SurfelSet};
use eagpt_scene::Camera;
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

/// What a Gaussian contributes to the pixels of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Contribution {
    /// Index in the scene.
    pub gaussian: u32,
    /// Sum of its weights: the pixels it fills.
    pub weight: f32,
    /// Sum of its weights times the pixels' values.
    pub weighted_value: f32,
    /// Its largest weight in a pixel, 0 to 1.
    pub largest_weight: f32,
    /// That pixel, row by row.
    pub pixel: u32,
}

#[derive(Debug, Clone, Default)]
struct TileRecord {
    /// Index in the scene of each slot.
    gaussians: Vec<u32>,
    hits: Vec<BlendedHit>,
    /// End of each pixel's hits.
    ends: Vec<u32>,
}

impl TileRecord {
    /// Renumbers the slots: of `gaussians`, the lists of a search, most lie behind what was blended.
    fn keep_what_was_hit(&mut self, gaussians: &[u32], places: &mut Vec<u32>) {
        const UNUSED: u32 = u32::MAX;
        places.clear();
        places.resize(gaussians.len(), UNUSED);
        for hit in &self.hits {
            places[hit.slot as usize] = 0;
        }
        for (place, &gaussian) in places.iter_mut().zip(gaussians) {
            if *place != UNUSED {
                *place = self.gaussians.len() as u32;
                self.gaussians.push(gaussian);
            }
        }
        for hit in &mut self.hits {
            hit.slot = places[hit.slot as usize];
        }
    }

    /// The blended hits of a pixel of the tile, front to back.
    fn hits_of(&self, pixel: usize) -> &[BlendedHit] {
        let start = match pixel {
            0 => 0,
            _ => self.ends[pixel - 1] as usize,
        };
        &self.hits[start..self.ends[pixel] as usize]
    }
}

/// Memory a thread reuses from tile to tile.
#[derive(Default)]
struct TileScratch {
    hits: Vec<Vec<Hit>>,
    rays: RayScratch,
    transmittances: Vec<f32>,
    seen: Vec<SeenSurfel>,
    /// Index in the scene of each slot that a search may name.
    gaussians: Vec<u32>,
    /// Slots by which a record names those that were hit.
    places: Vec<u32>,
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
                scratch.gaussians.clear();
                match (search, &bins) {
                    (HitSearch::SingleRays(bvh), _) => {
                        find_hits_by_rays(bvh, &rays, scratch);
                        name_slots(&mut scratch.hits, &mut scratch.gaussians);
                    }
                    (_, Some(bins)) => {
                        let list = bins.list(tile);
                        find_hits_in_tile(set, list, &rays, &mut scratch.hits);
                        let indices = list.iter().map(|entry| entry.index);
                        scratch.gaussians.extend(indices);
                    }
                    (HitSearch::Tiles, None) => {}
                }
                blend_tile(set, &rays, scratch, keep)
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

fn find_hits_by_rays(bvh: &Bvh, rays: &TileRays, scratch: &mut TileScratch) {
    for (p, _) in rays.pixels() {
        let ray = Ray::free(rays.origin, rays.direction(p));
        bvh.find_hits(&ray, Reach::UntilOpaque, &mut scratch.rays);
        scratch.hits[p].extend_from_slice(scratch.rays.hits());
    }
}

/// Replaces the scene indices in `hits` by slots, in order of index, and notes the index of each slot.
fn name_slots(hits: &mut [Vec<Hit>], gaussians: &mut Vec<u32>) {
    gaussians.extend(hits.iter().flatten().map(Hit::index));
    gaussians.sort_unstable();
    gaussians.dedup();
    for hit in hits.iter_mut().flatten() {
        let slot = gaussians.partition_point(|&g| g < hit.index());
        *hit = Hit::new(hit.t(), slot as u32, hit.alpha);
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn blend_tile(
    set: &SurfelSet,
    rays: &TileRays,
    scratch: &mut TileScratch,
    keep: Keep,
) -> (Vec<Sums>, TileRecord) {
    let mut sums = vec![Sums::default(); TILE_PIXELS];
    let mut record = TileRecord::default();
    let gaussians = &scratch.gaussians;
    for (p, list) in scratch.hits.iter_mut().enumerate() {
        sort_hits(list);
        let direction = rays.direction(p);
        let mut blender = Blender::default();
        for hit in list.iter() {
            let index = gaussians[hit.index() as usize] as usize;
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
    record.keep_what_was_hit(&scratch.gaussians, &mut scratch.places);
    (sums, record)
}

impl CameraRecord {
    /// Number of blended hits of all pixels.
    pub fn num_hits(&self) -> usize {
        self.tiles.iter().map(|tile| tile.hits.len()).sum()
    }

    /// The weights of the blend in every pixel; see [`BlendWeights`].
    pub fn weights(&self, least: f32) -> BlendWeights {
        let frame = self.camera.ray_frame();
        let tiles_x = self.camera.width.div_ceil(TILE);
        let per_tile: Vec<BlendWeights> = self
            .tiles
            .par_iter()
            .enumerate()
            .map(|(tile, record)| {
                let rays = TileRays::new(&self.camera, &frame, tiles_x, tile);
                let mut weights = BlendWeights::default();
                for (p, pixel) in rays.pixels() {
                    let hits = record.hits_of(p).iter();
                    let named = hits.map(|hit| (record.gaussians[hit.slot as usize], hit.alpha));
                    weights.push(pixel as u32, named, least);
                }
                weights
            })
            .collect();
        let mut all = BlendWeights::default();
        for tile in &per_tile {
            all.append(tile);
        }
        all
    }

    /// What each Gaussian contributes to the picture. `value` is a number for each pixel (row by row), such as its error. A
    /// Gaussian that several tiles saw comes once for each of them, tiles in order.
    pub fn contributions(&self, value: impl Fn(usize) -> f32 + Sync) -> Vec<Contribution> {
        let frame = self.camera.ray_frame();
        let tiles_x = self.camera.width.div_ceil(TILE);
        let per_tile: Vec<Vec<Contribution>> = self
            .tiles
            .par_iter()
            .enumerate()
            .map(|(tile, record)| {
                let rays = TileRays::new(&self.camera, &frame, tiles_x, tile);
                let of = |&gaussian| Contribution {
                    gaussian,
                    ..Contribution::default()
                };
                let mut rows: Vec<Contribution> = record.gaussians.iter().map(of).collect();
                for (p, pixel) in rays.pixels() {
                    let value = value(pixel);
                    let mut transmittance = 1.0;
                    for hit in record.hits_of(p) {
                        let weight = transmittance * hit.alpha;
                        transmittance *= 1.0 - hit.alpha;
                        let row = &mut rows[hit.slot as usize];
                        row.weight += weight;
                        row.weighted_value += weight * value;
                        if weight > row.largest_weight {
                            (row.largest_weight, row.pixel) = (weight, pixel as u32);
                        }
                    }
                }
                // Tiles reach beyond the image's border; what was hit only there was not seen.
                rows.retain(|row| row.weight > 0.0);
                rows
            })
            .collect();
        per_tile.into_iter().flatten().collect()
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
        adjoint(
            record.hits_of(p),
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
