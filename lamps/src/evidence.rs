//! What photographs show of lamps: the lit pixels of their masks and those around, with the place
//! where the trained scene has them.

use eagpt_scene::{Camera, View};
use eagpt_trace::features::GBuffer;
use glam::Vec3;
use std::collections::{BTreeMap, HashMap};

/// Pixels around a region of lit ones that are kept, at least, …
const RIM: u32 = 4;
/// … and in parts of the region's width and height: they say where a lamp ends.
const RIM_SHARE: f32 = 0.5;
/// Pixels of a view, inside lamps or dark, that are kept, about; those at borders are all kept.
const MAX_PLAIN: usize = 20_000;
/// Value of a mask from which on a pixel is lit: it is an emitter's if that covers at least half.
const LIT: f32 = 0.5;

/// A pixel at or near a lamp.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pixel {
    pub(crate) x: u32,
    pub(crate) y: u32,
    /// Unit direction of the ray through its centre.
    pub(crate) direction: Vec3,
    /// Solid angle, sr, of all the pixels that it stands for.
    pub(crate) solid_angle: f32,
    /// Number of pixels that it stands for: where a picture is large, not all are kept.
    pub(crate) weight: f32,
    /// Photographed radiance, linear.
    pub(crate) radiance: Vec3,
    /// Distance of the scene along the ray, scene units; infinite where there is nothing.
    pub(crate) distance: f32,
    /// Unit normal of the scene, or zero.
    pub(crate) normal: Vec3,
    pub(crate) lit: Lit,
    /// Number of the 2-D region of lit pixels; meaningless for others.
    pub(crate) region: u32,
}

/// What the mask says of a pixel and its eight neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lit {
    /// All are lit.
    Inside,
    /// It is lit, a neighbour is not.
    Border,
    /// It is dark, a neighbour is lit.
    Beside,
    /// All are dark.
    Dark,
}

impl Lit {
    pub(crate) fn is_lit(self) -> bool {
        matches!(self, Self::Inside | Self::Border)
    }
}

/// What one view shows.
#[derive(Debug, Clone)]
pub(crate) struct Sight {
    pub(crate) name: String,
    pub(crate) camera: Camera,
    pub(crate) origin: Vec3,
    /// Row by row.
    pub(crate) pixels: Vec<Pixel>,
    pub(crate) num_regions: u32,
}

impl Sight {
    /// Width of a pixel at distance 1, scene units.
    pub(crate) fn pixel_width(&self) -> f32 {
        (1.0 / self.camera.fx.min(self.camera.fy)) as f32
    }

    /// Whether a pixel is at the edge of the picture.
    pub(crate) fn at_edge(&self, pixel: &Pixel) -> bool {
        let (w, h) = (self.camera.width, self.camera.height);
        pixel.x == 0 || pixel.y == 0 || pixel.x + 1 == w || pixel.y + 1 == h
    }
}

/// What the training views show of lamps, view by view.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    pub(crate) sights: Vec<Sight>,
}

impl Evidence {
    /// Adds a view, whose scene is `seen` from its camera; views without a lit pixel say nothing.
    pub fn add(&mut self, view: &View, seen: &GBuffer) {
        let Some(mask) = &view.emission else { return };
        let (width, height) = (i64::from(mask.width()), i64::from(mask.height()));
        let is_known = |x, y| view.valid.as_ref().is_none_or(|v| v.get(x, y) != [0.0]);
        let is_lit = |x: i64, y: i64| {
            let inside = x >= 0 && y >= 0 && x < width && y < height;
            inside && mask.get(x as u32, y as u32)[0] >= LIT && is_known(x as u32, y as u32)
        };
        let lit: Vec<[u32; 2]> = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .filter(|&(x, y)| is_lit(x, y))
            .map(|(x, y)| [x as u32, y as u32])
            .collect();
        let regions = regions(&lit, mask.width());
        let near = around(&regions, &lit, mask.size());
        let region_of: HashMap<[u32; 2], u32> =
            lit.iter().copied().zip(regions.iter().copied()).collect();
        let num_near = near.iter().filter(|near| **near).count();
        let step = (1..).find(|k| num_near <= MAX_PLAIN * k * k).unwrap_or(1) as u32;
        let frame = view.camera.ray_frame();
        let forward = view.camera.forward();
        let area = (1.0 / (view.camera.fx * view.camera.fy)) as f32;
        let mut pixels = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let at = (y * width + x) as usize;
                let (column, row) = (x as u32, y as u32);
                if !near[at] || !is_known(column, row) {
                    continue;
                }
                let direction = frame.direction(column as f32 + 0.5, row as f32 + 0.5);
                let features = &seen.pixels[at];
                let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
                let num_lit = around.filter(|(dx, dy)| is_lit(x + dx, y + dy)).count();
                let state = match (is_lit(x, y), num_lit) {
                    (true, 9) => Lit::Inside,
                    (true, _) => Lit::Border,
                    (false, 0) => Lit::Dark,
                    (false, _) => Lit::Beside,
                };
                let weight = match state {
                    Lit::Border | Lit::Beside => 1.0,
                    Lit::Inside | Lit::Dark => (step * step) as f32,
                };
                if weight > 1.0 && (column % step != 0 || row % step != 0) {
                    continue;
                }
                pixels.push(Pixel {
                    x: column,
                    y: row,
                    direction,
                    solid_angle: weight * area * direction.dot(forward).powi(3),
                    weight,
                    radiance: view.radiance.get(column, row).into(),
                    distance: if features.alpha() > 0.5 {
                        features.mean_distance()
                    } else {
                        f32::INFINITY
                    },
                    normal: features.unit_normal(),
                    lit: state,
                    region: region_of.get(&[column, row]).copied().unwrap_or(0),
                });
            }
        }
        if pixels.is_empty() {
            return;
        }
        let num_regions = regions.iter().max().map_or(0, |last| last + 1);
        self.sights.push(Sight {
            name: view.name.clone(),
            camera: view.camera,
            origin: frame.origin,
            pixels,
            num_regions,
        });
    }

    /// Whether no view shows a lamp.
    pub fn is_empty(&self) -> bool {
        self.sights.is_empty()
    }
}

/// Numbers of the connected regions that `lit` pixels are in, each in turn.
fn regions(lit: &[[u32; 2]], width: u32) -> Vec<u32> {
    let at: HashMap<[u32; 2], usize> = lit.iter().copied().zip(0..).collect();
    let mut regions = vec![u32::MAX; lit.len()];
    let mut num = 0;
    for first in 0..lit.len() {
        if regions[first] != u32::MAX {
            continue;
        }
        regions[first] = num;
        let mut open = vec![first];
        while let Some(i) = open.pop() {
            let [x, y] = lit[i];
            for v in y.saturating_sub(1)..=y + 1 {
                for u in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    if let Some(&next) = at.get(&[u, v])
                        && regions[next] == u32::MAX
                    {
                        regions[next] = num;
                        open.push(next);
                    }
                }
            }
        }
        num += 1;
    }
    regions
}

/// The pixels in the boxes around regions, grown by their rims.
fn around(regions: &[u32], lit: &[[u32; 2]], (width, height): (u32, u32)) -> Vec<bool> {
    let mut boxes: BTreeMap<u32, [[u32; 2]; 2]> = BTreeMap::new();
    for (region, pixel) in regions.iter().zip(lit) {
        let [low, high] = boxes.entry(*region).or_insert([*pixel; 2]);
        for axis in 0..2 {
            low[axis] = low[axis].min(pixel[axis]);
            high[axis] = high[axis].max(pixel[axis]);
        }
    }
    let mut near = vec![false; (width * height) as usize];
    for [low, high] in boxes.into_values() {
        let rim = [0, 1].map(|k| rim(high[k] - low[k] + 1));
        for y in low[1].saturating_sub(rim[1])..(high[1] + rim[1] + 1).min(height) {
            let row = (y * width) as usize;
            let columns = low[0].saturating_sub(rim[0])..(high[0] + rim[0] + 1).min(width);
            near[row..][columns.start as usize..columns.end as usize].fill(true);
        }
    }
    near
}

/// Pixels that are kept on either side of a region so many pixels long.
pub(crate) fn rim(length: u32) -> u32 {
    RIM.max((RIM_SHARE * length as f32) as u32)
}
