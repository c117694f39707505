//! Photographs of lamps: the lit pixels of their masks and those around, with the place
//! where the trained scene has them.

pub(crate) mod level;
mod runs;
mod segments;
mod thin;

use crate::shape::meet::Rays;
use eagpt_masks::{Mask, Region};
use eagpt_scene::camera::RayFrame;
use eagpt_scene::{Camera, Image, Lamp, View};
use eagpt_trace::features::GBuffer;
use glam::Vec3;
use level::{Level, neighbourhood};
use runs::Run;
use segments::divided;
use std::collections::HashMap;

/// Pixels around a region of lit ones that are kept, at least, …
const RIM: u32 = 4;
/// … and in parts of the region's width and height: they say where a lamp ends.
const RIM_SHARE: f32 = 0.5;
/// Pixels of a view, inside lamps or dark, that are kept, about; those at borders are all kept.
const MAX_PLAIN: usize = 20_000;
/// Pixels within which what is dark is behind a lamp.
const CLOSE: u32 = 3;
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
    /// Number of the 2-D region of lit pixels, all of one lamp, unless several look like one from
    /// there; meaningless for others.
    pub(crate) region: u32,
    /// The brightest other region that a neighbour is of, by its number.
    pub(crate) beside: Option<u32>,
    /// Radiance of the surface behind the lamp, of pixels at its border: linear; 0 for others, and
    /// where nothing dark is near.
    pub(crate) behind: Vec3,
}

/// A pixel and its eight neighbours in the mask, where lit is what is of the region of a lit one.
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

/// Pixels of one view.
#[derive(Debug, Clone)]
pub(crate) struct Sight {
    pub(crate) name: String,
    /// Index of the light that it was photographed in.
    pub(crate) light: usize,
    pub(crate) camera: Camera,
    pub(crate) frame: RayFrame,
    /// Row by row.
    pub(crate) pixels: Vec<Pixel>,
    runs: Vec<Run>,
    /// Radiance of each region of lit pixels.
    pub(crate) levels: Vec<Level>,
}

impl Sight {
    /// Place of the camera, world space.
    pub(crate) fn origin(&self) -> Vec3 {
        self.frame.origin
    }

    /// Width of a pixel at distance 1, scene units.
    pub(crate) fn pixel_width(&self) -> f32 {
        (1.0 / self.camera.fx.min(self.camera.fy)) as f32
    }

    /// Where the scene has a pixel, world space.
    pub(crate) fn position(&self, pixel: &Pixel) -> Vec3 {
        self.origin() + pixel.direction * pixel.distance
    }

    /// Width of a pixel where the scene has it, scene units.
    pub(crate) fn width(&self, pixel: &Pixel) -> f32 {
        pixel.distance * self.pixel_width()
    }

    /// Unit direction through a place in a pixel, 0 to 1 from its upper left corner.
    pub(crate) fn direction(&self, pixel: &Pixel, x: f32, y: f32) -> Vec3 {
        self.frame.direction(pixel.x as f32 + x, pixel.y as f32 + y)
    }

    /// Rays through `places` in a pixel, 0 to 1 from its upper left corner.
    #[inline(always)]
    pub(crate) fn rays<const N: usize>(&self, pixel: &Pixel, places: &[[f32; 2]; N]) -> Rays<N> {
        let (left, top) = (pixel.x as f32, pixel.y as f32);
        Rays::through(&self.frame, places.map(|[x, y]| [left + x, top + y]))
    }

    /// Radiance of the region of a lit pixel.
    pub(crate) fn level(&self, pixel: &Pixel) -> Level {
        self.levels[pixel.region as usize]
    }

    /// Radiance of the brightest other region that begins beside a lit pixel.
    pub(crate) fn level_beside(&self, pixel: &Pixel) -> Option<Level> {
        Some(self.levels[pixel.beside? as usize])
    }

    /// Whether a pixel is at the edge of the picture.
    pub(crate) fn at_edge(&self, pixel: &Pixel) -> bool {
        let (w, h) = (self.camera.width, self.camera.height);
        pixel.x == 0 || pixel.y == 0 || pixel.x + 1 == w || pixel.y + 1 == h
    }
}

/// Pixels that show lamps, of all training views.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    pub(crate) sights: Vec<Sight>,
    /// The cameras of all views that have a mask, with the indices of their lights.
    pub(crate) cameras: Vec<(usize, Camera)>,
    /// Lamps that are in the scene already, with no pixels here, in whose light others may lie.
    pub known: Vec<Lamp>,
}

impl Evidence {
    /// Adds a view in one of the lights of the scene, by its index; the scene is `seen` from its
    /// camera.
    pub fn add(&mut self, view: &View, light: usize, seen: &GBuffer) {
        let Some(mask) = &view.emission else { return };
        self.cameras.push((light, view.camera));
        let is_known = |x, y| view.valid.as_ref().is_none_or(|v| v.get(x, y) != [0.0]);
        let lit = Mask::from_fn(mask.width(), mask.height(), |x, y| {
            mask.get(x, y)[0] >= LIT && is_known(x, y)
        });
        let lit = thin::completed(&lit, &view.radiance, is_known);
        let regions = lit.regions();
        let near = around(&regions, mask.size());
        let regions: Vec<Region> = (regions.iter())
            .flat_map(|region| divided(region, &view.radiance))
            .collect();
        let of_pixels = |(number, region): (u32, &Region)| {
            let pixels = region.pixels.clone();
            pixels.into_iter().map(move |pixel| (pixel, number))
        };
        let region_of: HashMap<[u32; 2], u32> = (0..).zip(&regions).flat_map(of_pixels).collect();
        let levels: Vec<Level> = (0..)
            .zip(&regions)
            .map(|(number, region)| Level::of(number, region, &region_of, &view.radiance))
            .collect();
        let num_near = near.iter().filter(|near| **near).count();
        let step = (1..).find(|k| num_near <= MAX_PLAIN * k * k).unwrap_or(1) as u32;
        let brightness = |region: u32| levels[region as usize].radiance.max_element();
        let frame = view.camera.ray_frame();
        let forward = view.camera.forward();
        let area = (1.0 / (view.camera.fx * view.camera.fy)) as f32;
        let mut pixels = Vec::new();
        for y in 0..mask.height() {
            for x in 0..mask.width() {
                let at = (y * mask.width() + x) as usize;
                if !near[at] || !is_known(x, y) {
                    continue;
                }
                let features = &seen.pixels[at];
                let region = region_of.get(&[x, y]).copied();
                let near: Vec<u32> = (neighbourhood([x, y]).iter())
                    .filter_map(|place| region_of.get(place).copied())
                    .collect();
                let num_lit = (near.iter())
                    .filter(|other| region.is_none_or(|own| own == **other))
                    .count();
                let state = match (region.is_some(), num_lit) {
                    (true, 9) => Lit::Inside,
                    (true, _) => Lit::Border,
                    (false, 0) => Lit::Dark,
                    (false, _) => Lit::Beside,
                };
                let weight = match state {
                    Lit::Border | Lit::Beside => 1.0,
                    Lit::Inside | Lit::Dark => (step * step) as f32,
                };
                if weight > 1.0 && (x % step != 0 || y % step != 0) {
                    continue;
                }
                let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
                let behind = match state {
                    Lit::Border | Lit::Beside => background(&lit, &view.radiance, [x, y]),
                    Lit::Inside | Lit::Dark => None,
                };
                pixels.push(Pixel {
                    x,
                    y,
                    direction,
                    solid_angle: weight * area * direction.dot(forward).powi(3),
                    weight,
                    radiance: view.radiance.get(x, y).into(),
                    distance: if features.alpha() > 0.5 {
                        features.mean_distance()
                    } else {
                        f32::INFINITY
                    },
                    normal: features.unit_normal(),
                    lit: state,
                    region: region.unwrap_or(0),
                    beside: (near.into_iter())
                        .filter(|other| region.is_some_and(|own| own != *other))
                        .max_by(|a, b| brightness(*a).total_cmp(&brightness(*b))),
                    behind: behind.unwrap_or(Vec3::ZERO),
                });
            }
        }
        if pixels.is_empty() {
            return;
        }
        self.sights.push(Sight {
            name: view.name.clone(),
            light,
            camera: view.camera,
            frame,
            runs: Run::all(&pixels),
            pixels,
            levels,
        });
    }

    /// A pixel of a view, by their numbers.
    pub(crate) fn pixel(&self, &(view, pixel): &(u32, u32)) -> (&Sight, &Pixel) {
        let sight = &self.sights[view as usize];
        (sight, &sight.pixels[pixel as usize])
    }
}

/// Radiance of what is behind a lamp at a pixel of its border, which may be brighter on one side of
/// it than on the other: of the dark pixels closest by, within [`CLOSE`], the brightest, which is as
/// close to the lamp's light.
fn background(lit: &Mask, radiance: &Image<3>, pixel: [u32; 2]) -> Option<Vec3> {
    let is_dark = |place: &[u32; 2]| !lit.around(*place, 1).any(|[x, y]| lit.has(x, y));
    (1..=CLOSE).find_map(|reach| {
        let dark = lit.around(pixel, reach).filter(is_dark);
        let values = dark.map(|[x, y]| Vec3::from(radiance.get(x, y)));
        values.max_by(|a, b| a.max_element().total_cmp(&b.max_element()))
    })
}

/// The pixels in the boxes around regions, grown by their rims.
fn around(regions: &[Region], (width, height): (u32, u32)) -> Vec<bool> {
    let mut near = vec![false; (width * height) as usize];
    for region in regions {
        let mut low = region.pixels[0];
        let mut high = low;
        for pixel in &region.pixels {
            for axis in 0..2 {
                low[axis] = low[axis].min(pixel[axis]);
                high[axis] = high[axis].max(pixel[axis]);
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A bar in rows 3 to 5 below a board that it lights, before a dark wall.
    #[test]
    fn what_is_behind_a_lamp_differs_from_side_to_side() {
        let rows = [4.0, 5.0, 6.0, 30.0, 30.0, 30.0, 0.5, 0.5, 0.5];
        let pixels = rows.iter().flat_map(|value| [[*value; 3]; 9]);
        let radiance = Image::from_pixels(9, 9, pixels.collect()).unwrap();
        let lit = Mask::from_fn(9, 9, |x, y| (3..6).contains(&y) && (1..8).contains(&x));
        let behind = |x: u32, y: u32| background(&lit, &radiance, [x, y]).map(|light| light.x);
        // The row beside the lamp may be a part of it.
        assert_eq!(behind(4, 2), Some(5.0));
        assert_eq!(behind(4, 3), Some(5.0));
        assert_eq!(behind(4, 5), Some(0.5));
        let all = Mask::from_fn(9, 9, |_, _| true);
        assert_eq!(background(&all, &radiance, [4, 4]), None);
    }
}
