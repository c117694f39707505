//! Binning: for each tile of an image, the Gaussians whose discs may cover one of its pixels, sorted by the distance from
//! which on they can be hit. The list is a superset; the hit formula decides.

use crate::surfel::{Surfel, SurfelSet};
use eagpt_scene::Camera;
use glam::Vec3;
use rayon::prelude::*;

/// Edge of a square tile in pixels: a row is one 8-lane register, a tile four 16-lane ones.
pub const TILE: u32 = 8;
/// Pixels of a tile.
pub const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// Safety margin of projected bounds, in pixels: far above the rounding of single-precision projections (about 1e-3 pixel
/// for images of 8,000 pixels), far below what costs time.
const MARGIN_PIXELS: f32 = 0.02;

/// A Gaussian in a tile's list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BinnedSurfel {
    /// Index in the scene.
    pub index: u32,
    /// No hit on the disc is closer than this; scene units.
    pub nearest: f32,
    /// First row of pixels that the disc may cover, image coordinates.
    pub first_row: u32,
    /// One past the last such row.
    pub end_row: u32,
}

/// Lists for all tiles of an image, row by row.
#[derive(Debug, Clone)]
pub struct TileBins {
    /// Tiles per row.
    pub tiles_x: u32,
    /// Rows of tiles.
    pub tiles_y: u32,
    starts: Vec<u32>,
    entries: Vec<BinnedSurfel>,
}

impl TileBins {
    /// Bins all Gaussians of `set` for `camera`.
    pub fn new(set: &SurfelSet, camera: &Camera) -> Self {
        let (tiles_x, tiles_y) = (camera.width.div_ceil(TILE), camera.height.div_ceil(TILE));
        let projector = Projector::new(camera);
        let mut visible: Vec<Visible> = set
            .surfels
            .par_iter()
            .with_min_len(1024)
            .enumerate()
            .filter_map(|(index, surfel)| {
                let rect = projector.bounds(surfel)?;
                Some(Visible {
                    nearest: projector.nearest(surfel),
                    index: index as u32,
                    rect,
                })
            })
            .collect();
        // One sort for all tiles. Distances are not negative, so their bits order like they do; indices make keys unique.
        visible.par_sort_unstable_by_key(|v| {
            (u64::from(v.nearest.to_bits()) << 32) | u64::from(v.index)
        });
        let mut starts = vec![0_u32; (tiles_x * tiles_y) as usize + 1];
        for v in &visible {
            v.rect.for_each_tile(tiles_x, |tile| starts[tile + 1] += 1);
        }
        for tile in 1..starts.len() {
            starts[tile] += starts[tile - 1];
        }
        let empty = BinnedSurfel {
            index: 0,
            nearest: 0.0,
            first_row: 0,
            end_row: 0,
        };
        let mut entries = vec![empty; starts.last().copied().unwrap_or(0) as usize];
        let mut next = starts.clone();
        for v in &visible {
            let entry = BinnedSurfel {
                index: v.index,
                nearest: v.nearest,
                first_row: v.rect.y.0,
                end_row: v.rect.y.1,
            };
            v.rect.for_each_tile(tiles_x, |tile| {
                entries[next[tile] as usize] = entry;
                next[tile] += 1;
            });
        }
        Self {
            tiles_x,
            tiles_y,
            starts,
            entries,
        }
    }

    /// Number of tiles.
    pub fn num_tiles(&self) -> usize {
        self.starts.len() - 1
    }

    /// The list of a tile.
    pub fn list(&self, tile: usize) -> &[BinnedSurfel] {
        &self.entries[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}

/// A Gaussian that some pixel may see.
struct Visible {
    nearest: f32,
    index: u32,
    rect: PixelRect,
}

/// Half-open ranges of pixels.
#[derive(Debug, Clone, Copy)]
struct PixelRect {
    x: (u32, u32),
    y: (u32, u32),
}

impl PixelRect {
    fn for_each_tile(&self, tiles_x: u32, mut f: impl FnMut(usize)) {
        for tile_y in self.y.0 / TILE..=(self.y.1 - 1) / TILE {
            for tile_x in self.x.0 / TILE..=(self.x.1 - 1) / TILE {
                f((tile_y * tiles_x + tile_x) as usize);
            }
        }
    }
}

/// World to pixels, in single precision, with rows scaled by the focal lengths.
struct Projector {
    origin: Vec3,
    right: Vec3,
    down: Vec3,
    forward: Vec3,
    center: (f32, f32),
    size: (u32, u32),
    /// Inward unit normals of the planes through the origin and the image's edges.
    sides: [Vec3; 4],
}

impl Projector {
    fn new(camera: &Camera) -> Self {
        let axes = &camera.world_from_camera.matrix3;
        let (right, down) = (axes.x_axis * camera.fx, axes.y_axis * camera.fy);
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        // x·right ≥ −cx·depth for pixels right of the left edge, and so on.
        let sides = [
            right + axes.z_axis * camera.cx,
            axes.z_axis * (width - camera.cx) - right,
            down + axes.z_axis * camera.cy,
            axes.z_axis * (height - camera.cy) - down,
        ];
        Self {
            origin: camera.origin(),
            right: right.as_vec3(),
            down: down.as_vec3(),
            forward: axes.z_axis.as_vec3(),
            center: (camera.cx as f32, camera.cy as f32),
            size: (camera.width, camera.height),
            sides: sides.map(|side| side.normalize().as_vec3()),
        }
    }

    /// Lower bound of the distance of hits.
    fn nearest(&self, surfel: &Surfel) -> f32 {
        let reach = surfel
            .extents()
            .map(Vec3::length)
            .into_iter()
            .fold(0.0, f32::max);
        let distance = Vec3::from(surfel.position).distance(self.origin);
        // A few roundings' worth lower, so that it is a bound for computed distances, too.
        ((distance - reach) * (1.0 - 1e-5)).max(0.0)
    }

    /// The pixels whose centres the disc may cover, or `None` if there are none.
    fn bounds(&self, surfel: &Surfel) -> Option<PixelRect> {
        if surfel.cut2 < 0.0 {
            return None;
        }
        let offset = Vec3::from(surfel.position) - self.origin;
        let [a, b] = surfel.extents();
        let depth = offset.dot(self.forward);
        let (depth_a, depth_b) = (a.dot(self.forward), b.dot(self.forward));
        let reach2 = depth_a * depth_a + depth_b * depth_b;
        if depth + reach2.sqrt() <= 0.0 {
            return None;
        }
        // A disc that reaches (nearly) into the camera's plane projects to an unbounded conic.
        let q = depth * depth - reach2;
        if depth <= 0.0 || q <= 1e-4 * depth * depth {
            // Most such discs lie to the side, out of sight; the margin is many roundings wide.
            let reach = (a.length_squared() + b.length_squared()).sqrt() + 1e-5 * offset.length();
            if self.sides.iter().any(|side| offset.dot(*side) < -reach) {
                return None;
            }
            return Some(PixelRect {
                x: (0, self.size.0),
                y: (0, self.size.1),
            });
        }
        let axis = |row: Vec3, center: f32, size: u32| {
            // The conic's extent about the projected centre m: δ with (a_r − δ a_z)² + (b_r − δ b_z)² = (δ z)², where r is
            // the row minus m times the depth row, so that the centre drops out and no digits cancel.
            let m = offset.dot(row) / depth;
            let (ra, rb) = (a.dot(row) - m * depth_a, b.dot(row) - m * depth_b);
            let half_b = ra * depth_a + rb * depth_b;
            let root = (half_b * half_b + q * (ra * ra + rb * rb)).sqrt();
            let middle = m + center;
            let low = middle + (-half_b - root) / q - MARGIN_PIXELS;
            let high = middle + (-half_b + root) / q + MARGIN_PIXELS;
            // Pixel i has its centre at i + 0.5.
            let first = (low - 0.5).ceil().max(0.0);
            let end = ((high - 0.5).floor() + 1.0).min(size as f32);
            (first < end).then_some((first as u32, end as u32))
        };
        Some(PixelRect {
            x: axis(self.right, self.center.0, self.size.0)?,
            y: axis(self.down, self.center.1, self.size.1)?,
        })
    }
}
