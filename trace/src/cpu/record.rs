//! The record of the blended hits of a camera's rays.

use super::bins::{TILE, TileBins};
use super::search::TileSurfel;
use super::tile::pixels_of_tile;
use crate::attributes::Attributes;
use crate::blend::{Contribution, LocalGradient, PixelValue};
use crate::camera_rays::CameraRays;
use crate::features::{Features, GBuffer};
use crate::weights::BlendWeights;
use eagpt_scene::Camera;
use rayon::prelude::*;

/// The blended hits of every pixel, kept for the adjoint, and memory that the next image reuses.
#[derive(Debug, Clone, Default)]
pub struct CameraRecord {
    /// Of the last image; none before the first. The record is of the places of their grid.
    pub(super) rays: Option<CameraRays>,
    pub(super) tiles: Vec<TileRecord>,
    pub(super) bins: TileBins,
    /// Attributes as the camera sees them, where that makes a difference.
    pub(super) seen: Vec<Attributes>,
}

/// Record of a tile.
#[derive(Debug, Clone, Default)]
pub(super) struct TileRecord {
    pub(super) features: Vec<Features>,
    /// Row of each slot; [`UNUSED`] where nothing was blended.
    pub(super) rows: Vec<u32>,
    /// Index in the scene of each row, ascending.
    pub(super) gaussians: Vec<u32>,
    pub(super) hits: Vec<BlendedHit>,
    /// End of each pixel's hits.
    pub(super) ends: Vec<u32>,
    /// Of each row, once asked for.
    pub(super) gradients: Vec<LocalGradient>,
}

/// Row of a slot that no ray blends: of those of a search, many lie behind opaque surfaces.
pub(super) const UNUSED: u32 = u32::MAX;

/// One blended hit of a ray, as the adjoint needs it again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BlendedHit {
    /// Slot of the Gaussian; see [`TileRecord::row_of`].
    pub(super) slot: u32,
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

impl CameraRecord {
    /// The camera whose pixels are the places of the grid of rays; `None` before the first image.
    pub(super) fn grid(&self) -> Option<Camera> {
        self.rays.as_ref().map(CameraRays::grid)
    }

    /// Composited features of the pixels that the rays make; of no pixel before the first image.
    pub fn gbuffer(&self) -> GBuffer {
        let Some(rays) = &self.rays else {
            return GBuffer {
                width: 0,
                height: 0,
                pixels: Vec::new(),
            };
        };
        let grid = rays.grid();
        rays.means(GBuffer {
            width: grid.width,
            height: grid.height,
            pixels: row_by_row(&grid, |tile| &self.tiles[tile].features),
        })
    }

    /// Number of blended hits of all pixels.
    pub fn num_hits(&self) -> usize {
        self.tiles.iter().map(|tile| tile.hits.len()).sum()
    }

    /// The weights of the blend in every pixel; see [`BlendWeights`].
    pub fn weights(&self, least: f32) -> BlendWeights {
        let Some(camera) = &self.grid() else {
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
        let Some(camera) = &self.grid() else {
            return Vec::new();
        };
        let tiles = self.tiles.par_iter().enumerate();
        let per_tile: Vec<Vec<Contribution>> = tiles
            .map(|(tile, record)| record.contributions((camera, tile), value))
            .collect();
        per_tile.concat()
    }
}

/// The features of all pixels of `camera`, row by row, given those of each of its tiles.
pub(super) fn row_by_row<'a>(
    camera: &Camera,
    of_tile: impl Fn(usize) -> &'a [Features] + Sync,
) -> Vec<Features> {
    let mut pixels = vec![Features::default(); camera.num_pixels()];
    let tiles_x = camera.width.div_ceil(TILE) as usize;
    pixels
        .par_chunks_mut((camera.width * TILE) as usize)
        .enumerate()
        .for_each(|(band, rows)| {
            let start = band * (camera.width * TILE) as usize;
            for tile in band * tiles_x..(band + 1) * tiles_x {
                let features = of_tile(tile);
                for (p, pixel) in pixels_of_tile(camera, tile) {
                    rows[pixel - start] = features[p];
                }
            }
        });
    pixels
}

impl TileRecord {
    /// Contribution of each of its Gaussians to its pixels, those of a tile of `camera`.
    pub(super) fn contributions(
        &self,
        (camera, tile): (&Camera, usize),
        value: PixelValue<'_>,
    ) -> Vec<Contribution> {
        let of = |&gaussian| Contribution {
            gaussian,
            ..Contribution::default()
        };
        let mut rows: Vec<Contribution> = self.gaussians.iter().map(of).collect();
        for (p, pixel) in pixels_of_tile(camera, tile) {
            let value = value(pixel, &self.features[p]);
            for hit in self.hits_of(p) {
                let row = &mut rows[self.row_of(hit)];
                row.add(hit.weight, pixel as u32, value);
            }
        }
        rows
    }

    pub(super) fn clear(&mut self) {
        self.features.clear();
        self.rows.clear();
        self.gaussians.clear();
        self.hits.clear();
        self.ends.clear();
    }

    /// Gives a row to each slot that was blended, in order.
    pub(super) fn name_rows(&mut self, slots: &[TileSurfel]) {
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
}

/// Gaussians whose rows a thread adds at once: their gradients stay in a near cache.
const SUMMED_AT_ONCE: usize = 2048;

/// The gradient of each of `num_gaussians`: the sum of its rows in `tiles`, in their order.
pub(super) fn sum_rows(num_gaussians: usize, tiles: &[TileRecord]) -> Vec<LocalGradient> {
    let mut sums = vec![LocalGradient::default(); num_gaussians];
    sums.par_chunks_mut(SUMMED_AT_ONCE)
        .enumerate()
        .for_each(|(chunk, sums)| {
            let first = (chunk * SUMMED_AT_ONCE) as u32;
            let end = first + sums.len() as u32;
            for tile in tiles {
                // Rows are in the order of the scene.
                let rows = tile.gaussians.partition_point(|&g| g < first)..;
                let rows = tile.gaussians[rows.clone()]
                    .iter()
                    .zip(&tile.gradients[rows]);
                for (&g, gradient) in rows.take_while(|(g, _)| **g < end) {
                    sums[(g - first) as usize].add(gradient);
                }
            }
        });
    sums
}
