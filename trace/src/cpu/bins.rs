//! Binning: for each tile of an image, the Gaussians whose discs may cover one of its pixels, and
//! the distance from which on they can be hit. The lists are supersets; the hit formula decides.
//!
//! Gaussians are projected in chunks, each chunk sorts what it sees into bands of tiles, and each
//! band makes the lists of its tiles, chunks in order: every step runs in parallel, and the lists
//! are the same for any number of threads.

use crate::camera_rays::CameraRays;
use crate::surfel::{Surfel, SurfelSet};
use glam::Vec3;
use multiversion::multiversion;
use rayon::prelude::*;

/// Edge of a square tile in pixels.
pub(crate) const TILE: u32 = 16;
/// Pixels of a tile.
pub(crate) const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// Safety margin of projected bounds, in pixels: far above the rounding of single-precision
/// projections (about 1e-3 pixel for images of 8,000 pixels), far below what costs time.
const MARGIN_PIXELS: f32 = 0.02;

/// Gaussians projected at once by a thread.
pub(super) const CHUNK: usize = 4096;

/// A Gaussian in a tile's list.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BinnedSurfel {
    /// Index in the scene.
    pub(super) index: u32,
    /// No hit on the disc is closer than this; scene units.
    pub(super) nearest: f32,
}

/// Lists for all tiles of an image, row by row. Memory is reused from image to image.
#[derive(Debug, Clone, Default)]
pub(crate) struct TileBins {
    tiles_x: usize,
    chunks: Vec<Chunk>,
    bands: Vec<Band>,
}

/// Those of [`CHUNK`] Gaussians that some pixel may see.
#[derive(Debug, Clone, Default)]
struct Chunk {
    indices: Vec<u32>,
    /// `[num_bands]`
    bands: Vec<Vec<Visible>>,
}

/// The lists of a row of tiles.
#[derive(Debug, Clone, Default)]
struct Band {
    /// First entry of each tile, and the end.
    starts: Vec<u32>,
    next: Vec<u32>,
    entries: Vec<BinnedSurfel>,
}

/// A Gaussian that some pixel of a band may see.
#[derive(Debug, Clone, Copy)]
struct Visible {
    entry: BinnedSurfel,
    /// First column of tiles, and the last.
    tiles: (u32, u32),
}

impl TileBins {
    /// Bins all Gaussians of `set` for `rays`.
    pub(crate) fn fill(&mut self, set: &SurfelSet, rays: &CameraRays) {
        let projector = Projector::new(rays);
        let (width, height) = projector.size;
        let num_bands = height.div_ceil(TILE) as usize;
        self.tiles_x = width.div_ceil(TILE) as usize;
        (self.chunks).resize_with(set.len().div_ceil(CHUNK), Chunk::default);
        self.chunks
            .par_iter_mut()
            .zip(set.surfels.par_chunks(CHUNK))
            .enumerate()
            .for_each(|(number, (chunk, surfels))| {
                chunk.indices.clear();
                chunk.bands.iter_mut().for_each(Vec::clear);
                chunk.bands.resize_with(num_bands, Vec::new);
                project_chunk(&projector, surfels, number * CHUNK, chunk);
            });
        self.bands.resize_with(num_bands, Band::default);
        let (chunks, tiles_x) = (&self.chunks, self.tiles_x);
        self.bands
            .par_iter_mut()
            .enumerate()
            .for_each(|(band, lists)| {
                lists.fill(tiles_x, || {
                    chunks.iter().flat_map(|chunk| &chunk.bands[band])
                });
            });
    }

    /// Indices of the Gaussians that some pixel may see, ascending, of each [`CHUNK`] of the scene.
    pub(super) fn visible(&self) -> impl IndexedParallelIterator<Item = &[u32]> {
        self.chunks.par_iter().map(|chunk| chunk.indices.as_slice())
    }

    /// The list of a tile, in order of index.
    pub(crate) fn list(&self, tile: usize) -> &[BinnedSurfel] {
        let band = &self.bands[tile / self.tiles_x];
        let column = tile % self.tiles_x;
        &band.entries[band.starts[column] as usize..band.starts[column + 1] as usize]
    }
}

/// Puts what can be seen of `surfels`, the first of which has the index `first`, into `chunk`.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn project_chunk(projector: &Projector, surfels: &[Surfel], first: usize, chunk: &mut Chunk) {
    for (i, surfel) in surfels.iter().enumerate() {
        let Some((nearest, rect)) = projector.project(surfel) else {
            continue;
        };
        let index = (first + i) as u32;
        chunk.indices.push(index);
        let visible = Visible {
            entry: BinnedSurfel { index, nearest },
            tiles: (rect.x.0 / TILE, (rect.x.1 - 1) / TILE),
        };
        for band in rect.y.0 / TILE..=(rect.y.1 - 1) / TILE {
            chunk.bands[band as usize].push(visible);
        }
    }
}

impl Band {
    fn fill<'a, I: Iterator<Item = &'a Visible>>(
        &mut self,
        tiles_x: usize,
        visible: impl Fn() -> I,
    ) {
        self.starts.clear();
        self.starts.resize(tiles_x + 1, 0);
        for v in visible() {
            for tile in v.tiles.0..=v.tiles.1 {
                self.starts[tile as usize + 1] += 1;
            }
        }
        for tile in 0..tiles_x {
            self.starts[tile + 1] += self.starts[tile];
        }
        self.next.clear();
        self.next.extend_from_slice(&self.starts);
        self.entries
            .resize(self.starts[tiles_x] as usize, BinnedSurfel::default());
        for v in visible() {
            for tile in v.tiles.0..=v.tiles.1 {
                let next = &mut self.next[tile as usize];
                self.entries[*next as usize] = v.entry;
                *next += 1;
            }
        }
    }
}

/// Half-open ranges of pixels.
#[derive(Debug, Clone, Copy)]
struct PixelRect {
    x: (u32, u32),
    y: (u32, u32),
}

/// World to pixels, in single precision, with rows scaled by the focal lengths.
pub(crate) struct Projector {
    pub(crate) origin: Vec3,
    pub(crate) right: Vec3,
    pub(crate) down: Vec3,
    pub(crate) forward: Vec3,
    pub(crate) center: (f32, f32),
    pub(crate) size: (u32, u32),
    /// How far beside the middle of a pixel a disc may end that one of its rays meets, in pixels.
    pub(crate) margin: f32,
    /// Inward unit normals of the planes through the origin and the image's edges.
    pub(crate) sides: [Vec3; 4],
}

impl Projector {
    /// Projection to the places of the grid of `rays`, which are its pixels.
    pub(crate) fn new(rays: &CameraRays) -> Self {
        let camera = rays.grid();
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
            margin: MARGIN_PIXELS + rays.largest_offset(),
            sides: sides.map(|side| side.normalize().as_vec3()),
        }
    }

    /// A lower bound of the distance of hits, and the pixels whose rays may meet the disc;
    /// `None` if there are none.
    #[inline(always)]
    fn project(&self, surfel: &Surfel) -> Option<(f32, PixelRect)> {
        if surfel.cut2 < 0.0 {
            return None;
        }
        let offset = Vec3::from(surfel.position) - self.origin;
        let [a, b] = surfel.extents();
        let reach = a.length_squared().max(b.length_squared()).sqrt();
        let distance = offset.length();
        // Most Gaussians of a room are out of sight altogether; the margin is many roundings wide.
        let outside = -(reach * (1.0 + 1e-5) + 1e-5 * distance);
        if self.sides.iter().any(|side| offset.dot(*side) < outside) {
            return None;
        }
        // A few roundings' worth lower, so that it is a bound for computed distances, too.
        let nearest = ((distance - reach) * (1.0 - 1e-5)).max(0.0);
        Some((nearest, self.bounds(offset, a, b)?))
    }

    /// The pixels whose rays may meet a disc, given its middle and the vectors that span it.
    #[inline(always)]
    fn bounds(&self, offset: Vec3, a: Vec3, b: Vec3) -> Option<PixelRect> {
        let depth = offset.dot(self.forward);
        let (depth_a, depth_b) = (a.dot(self.forward), b.dot(self.forward));
        let reach2 = depth_a * depth_a + depth_b * depth_b;
        if depth + reach2.sqrt() <= 0.0 {
            return None;
        }
        // A disc that reaches (nearly) into the camera's plane projects to an unbounded conic.
        let q = depth * depth - reach2;
        if depth <= 0.0 || q <= 1e-4 * depth * depth {
            return Some(PixelRect {
                x: (0, self.size.0),
                y: (0, self.size.1),
            });
        }
        let axis = |row: Vec3, center: f32, size: u32| {
            // The conic's extent about the projected centre m: δ with (a_r − δ a_z)² + (b_r − δ
            // b_z)² = (δ z)², where r is the row minus m times the depth row, so that the centre
            // drops out and no digits cancel.
            let m = offset.dot(row) / depth;
            let (ra, rb) = (a.dot(row) - m * depth_a, b.dot(row) - m * depth_b);
            let half_b = ra * depth_a + rb * depth_b;
            let root = (half_b * half_b + q * (ra * ra + rb * rb)).sqrt();
            let middle = m + center;
            let low = middle + (-half_b - root) / q - self.margin;
            let high = middle + (-half_b + root) / q + self.margin;
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
