//! Training views, reduced to what points are found by.

use eagpt_scene::color::pq_from_linear;
use eagpt_scene::{Camera, Image, View};
use glam::{Vec2, Vec3};

/// Longest edges of the coarse and the fine pictures, pixels.
const EDGES: [u32; 2] = [128, 384];
/// A place whose pixel is less opaque than this in any view is empty.
const MIN_OPACITY: f32 = 0.05;

/// A picture in PQ, with opacity; not a number where nothing is known.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pixels: Image<4>,
    /// Pixels of the view for one of this picture.
    pub(super) factor: f32,
}

/// A view, reduced.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) camera: Camera,
    /// Coarse and fine.
    pub(super) levels: [Level; 2],
    /// Linear light of the fine pixels, not premultiplied.
    light: Vec<[f32; 3]>,
    /// Depth of the middles of fine pixels, 0 where it is not known.
    pub(super) depth: Option<Vec<f32>>,
    /// Normals there, zero where they are not known.
    normal: Option<Vec<Vec3>>,
}

impl Seen {
    pub(super) fn new(view: &View) -> Self {
        let factor_for = |edge: u32| view.camera.width.max(view.camera.height).div_ceil(edge);
        let levels = EDGES.map(|edge| Level::new(view, factor_for(edge)));
        let factor = factor_for(EDGES[1]);
        let fine = view.radiance.averaged(factor);
        let opacity = view.alpha.as_ref().map(|alpha| alpha.averaged(factor));
        let light = (0..fine.pixels().len())
            .map(|i| {
                let opacity = opacity.as_ref().map_or(1.0, |alpha| alpha.pixels()[i][0]);
                fine.pixels()[i].map(|v| v / opacity.max(1e-3))
            })
            .collect();
        let (width, height) = fine.size();
        let middle = |i: u32| {
            let at = |at: u32, size: u32| (at * factor + factor / 2).min(size - 1);
            let (x, y) = (i % width, i / width);
            (at(x, view.camera.width), at(y, view.camera.height))
        };
        let depth = view.depth.as_ref().map(|depth| {
            let places = (0..width * height).map(middle);
            places.map(|(x, y)| depth.get(x, y)[0]).collect()
        });
        let normal = view.normal.as_ref().map(|normal| {
            let places = (0..width * height).map(middle);
            places.map(|(x, y)| Vec3::from(normal.get(x, y))).collect()
        });
        Self {
            camera: view.camera,
            levels,
            light,
            depth,
            normal,
        }
    }

    pub(super) fn fine(&self) -> &Level {
        &self.levels[1]
    }

    /// Fine pixels that are known and opaque.
    pub(super) fn usable(&self) -> Vec<usize> {
        let pixels = self.fine().pixels.pixels().iter().enumerate();
        // A comparison with what is not a number is false.
        pixels.filter(|(_, p)| p[3] > 0.5).map(|(i, _)| i).collect()
    }

    /// Whether the view shows nothing where `point` is.
    pub(super) fn sees_through(&self, point: Vec3) -> bool {
        let at = self.camera.project(point);
        let level = &self.levels[0];
        let shown = level.at(at.truncate() / level.factor);
        at.z > 0.0 && shown.is_some_and(|shown| shown[3] < MIN_OPACITY)
    }

    /// The place of a point in the fine picture, and its depth, if it is in the picture.
    pub(super) fn see(&self, point: Vec3) -> Option<(Vec2, f32)> {
        let at = self.camera.project(point);
        let (width, height) = (self.camera.width as f32, self.camera.height as f32);
        let is_inside = at.z > 0.0 && at.x >= 0.0 && at.y >= 0.0 && at.x < width && at.y < height;
        is_inside.then(|| (at.truncate() / self.fine().factor, at.z))
    }

    /// Linear light of a fine pixel.
    pub(super) fn light(&self, pixel: usize) -> [f32; 3] {
        self.light[pixel]
    }

    /// Normal of a fine pixel, zero where it is not known.
    pub(super) fn normal(&self, pixel: usize) -> Vec3 {
        self.normal.as_ref().map_or(Vec3::ZERO, |all| all[pixel])
    }

    /// Middle of a fine pixel, in fine pixels.
    pub(super) fn place(&self, pixel: usize) -> Vec2 {
        let width = self.fine().pixels.width() as usize;
        Vec2::new((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5)
    }

    /// Direction through a place of the fine picture, of length 1 along the optical axis.
    pub(super) fn direction(&self, place: Vec2) -> Vec3 {
        let frame = self.camera.ray_frame();
        let at = place * self.fine().factor;
        frame.base + frame.step_x * at.x + frame.step_y * at.y
    }

    /// The point at an inverse depth along the ray of a fine pixel.
    pub(super) fn point(&self, pixel: usize, inverse_depth: f32) -> Vec3 {
        self.camera.origin() + self.direction(self.place(pixel)) / inverse_depth
    }
}

impl Level {
    fn new(view: &View, factor: u32) -> Self {
        let light = view.radiance.averaged(factor);
        let alpha = view.alpha.as_ref().map(|alpha| alpha.averaged(factor));
        let valid = view.valid.as_ref().map(|valid| valid.averaged(factor));
        let single = |image: &Option<Image<1>>, i: usize| {
            image.as_ref().map_or(1.0, |image| image.pixels()[i][0])
        };
        let pixel = |i: usize| {
            if single(&valid, i) < 1.0 {
                return [f32::NAN; 4];
            }
            let [r, g, b] = light.pixels()[i].map(pq_from_linear);
            [r, g, b, single(&alpha, i)]
        };
        let pixels = (0..light.pixels().len()).map(pixel).collect();
        Self {
            pixels: Image::from_pixels(light.width(), light.height(), pixels)
                .expect("as many pixels as before"),
            factor: factor as f32,
        }
    }

    /// The value between pixels; `None` outside of the picture and where nothing is known.
    pub(super) fn at(&self, place: Vec2) -> Option<[f32; 4]> {
        let (width, height) = (self.pixels.width() as f32, self.pixels.height() as f32);
        if !(place.x >= 0.0 && place.y >= 0.0 && place.x < width && place.y < height) {
            return None;
        }
        let at = (place - 0.5).clamp(Vec2::ZERO, Vec2::new(width, height) - 1.0);
        let (x, y) = (at.x as u32, at.y as u32);
        let (right, below) = (
            (x + 1).min(self.pixels.width() - 1),
            (y + 1).min(self.pixels.height() - 1),
        );
        let (u, v) = (at.x - x as f32, at.y - y as f32);
        let corners = [
            (self.pixels.get(x, y), (1.0 - u) * (1.0 - v)),
            (self.pixels.get(right, y), u * (1.0 - v)),
            (self.pixels.get(x, below), (1.0 - u) * v),
            (self.pixels.get(right, below), u * v),
        ];
        let mut sum = [0.0; 4];
        for (pixel, weight) in corners {
            for (sum, value) in sum.iter_mut().zip(pixel) {
                *sum += weight * value;
            }
        }
        (!sum[0].is_nan()).then_some(sum)
    }
}
