//! Lenses: from points in camera space to pixels and back, for all camera models of COLMAP.
//!
//! A [`Lens`] is a model, its parameters and the size of the image. Camera space has OpenCV's axes:
//! x right, y down, z forward; pixel (0, 0) is the image's corner and the first pixel's centre
//! (0.5, 0.5).
//!
//! Every model is a closed-form profile (perspective, equidistant, …), a distortion in the plane of
//! focal lengths, and focal lengths with a principal point. The *valid field* of a lens is where
//! its projection is one to one: a polynomial may grow, turn and come back, and points beyond the
//! turn have no image here. Fisheye lenses see past 90° where their model does.
//!
//! [`undistort`] finds a pinhole camera for a lens, [`mod@remap`] resamples images from one to the
//! other.

mod distortion;
mod model;
mod profile;
pub mod remap;
pub mod undistort;

#[cfg(test)]
mod tests;

pub use model::LensModel;
pub use remap::{Remapped, remap};
pub use undistort::{Field, Pinhole, UndistortOptions, Undistortion};

use crate::camera::Camera;
use distortion::{Distortion, Order};
use glam::{DAffine3, DVec2, DVec3};
use model::MAX_PARAMS;
use profile::Shape;

/// Longest edge of an image, pixels.
pub const MAX_SIZE: u32 = 65_535;

/// A camera model with its parameters, for an image of a size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    model: LensModel,
    width: u32,
    height: u32,
    /// Those of the model, then zeros.
    params: [f64; MAX_PARAMS],
    focal: DVec2,
    centre: DVec2,
    shape: Shape,
    distortion: Distortion,
}

impl Lens {
    /// A lens for images of `size` pixels with the parameters of its model, in their order.
    ///
    /// # Errors
    /// In words, for a message that names the place: another number of parameters, one that is not
    /// finite, a focal length that is not above 0, a size that is 0 or beyond [`MAX_SIZE`], a
    /// parameter outside the model's range.
    pub fn new(model: LensModel, size: (u32, u32), params: &[f64]) -> Result<Self, String> {
        let names = model.param_names();
        if params.len() != names.len() {
            return Err(format!(
                "{} parameters, but {model} has {}: {}",
                params.len(),
                names.len(),
                names.join(", ")
            ));
        }
        let (width, height) = size;
        if ![width, height].iter().all(|n| (1..=MAX_SIZE).contains(n)) {
            return Err(format!("{width}x{height} pixels, not 1 to {MAX_SIZE} each"));
        }
        if let Some(at) = params.iter().position(|value| !value.is_finite()) {
            return Err(format!("{} is {:?}", names[at], params[at]));
        }
        let mut own = [0.0; MAX_PARAMS];
        own[..params.len()].copy_from_slice(params);
        let by_name = |name: &str| names.iter().position(|n| *n == name).map(|at| own[at]);
        let of = |name: &str| by_name(name).unwrap_or(0.0);
        let (focal, centre) = match (by_name("w"), by_name("h")) {
            (Some(w), Some(h)) => {
                let size = DVec2::new(w, h);
                (
                    size / DVec2::new(std::f64::consts::TAU, std::f64::consts::PI),
                    0.5 * size,
                )
            }
            _ => (
                DVec2::new(
                    by_name("fx").unwrap_or(of("f")),
                    by_name("fy").unwrap_or(of("f")),
                ),
                DVec2::new(of("cx"), of("cy")),
            ),
        };
        if !(focal.x > 0.0 && focal.y > 0.0) {
            let names = &names[..if by_name("f").is_some() { 1 } else { 2 }];
            return Err(format!(
                "{} is {:?}, not above 0",
                names.join(", "),
                &own[..names.len()]
            ));
        }
        let shape = Shape {
            profile: model.profile(),
            params: match model {
                LensModel::Fov => [of("omega"), 0.0],
                LensModel::SimpleDivision | LensModel::Division => [of("k"), 0.0],
                LensModel::Eucm => [of("alpha"), of("beta")],
                _ => [0.0; 2],
            },
        };
        if let Some(problem) = shape.problem() {
            return Err(problem);
        }
        Ok(Self {
            model,
            width,
            height,
            params: own,
            focal,
            centre,
            shape,
            distortion: distortion(model, of).with_field(&shape),
        })
    }

    /// The model.
    pub fn model(&self) -> LensModel {
        self.model
    }

    /// Width and height of the image, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Parameters in the order of [`LensModel::param_names`].
    pub fn params(&self) -> &[f64] {
        &self.params[..self.model.param_names().len()]
    }

    /// Focal lengths along x and y, pixels: pixels a radian near the axis, but for
    /// [`LensModel::Fov`].
    pub fn focal(&self) -> DVec2 {
        self.focal
    }

    /// Principal point, pixels from the image's corner.
    pub fn centre(&self) -> DVec2 {
        self.centre
    }

    /// The pixel position of a point in camera space; `None` outside of the valid field. It may lie
    /// outside of the image.
    pub fn project(&self, point_camera: DVec3) -> Option<DVec2> {
        let plane = self.shape.plane_from_point(point_camera)?;
        let distorted = self.distortion.distort(plane)?;
        Some(self.focal * distorted + self.centre)
    }

    /// The direction, of unit length, that a pixel position sees in camera space; `None` if the
    /// valid field has no such direction.
    ///
    /// Models without a closed inverse are solved to 1e-12 focal lengths.
    pub fn unproject(&self, pixel: DVec2) -> Option<DVec3> {
        let distorted = (pixel - self.centre) / self.focal;
        let plane = self.distortion.undistort(distorted)?;
        self.shape.ray_from_plane(plane)
    }

    /// Whether a pixel position lies in the image, its edges included.
    pub fn contains(&self, pixel: DVec2) -> bool {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(size).all()
    }

    /// The pinhole camera that this lens is, posed; `None` if it distorts.
    pub fn as_pinhole(&self, world_from_camera: DAffine3) -> Option<Camera> {
        let is_pinhole =
            self.shape.profile == profile::Profile::Perspective && self.distortion.is_none();
        is_pinhole.then_some(Camera {
            width: self.width,
            height: self.height,
            fx: self.focal.x,
            fy: self.focal.y,
            cx: self.centre.x,
            cy: self.centre.y,
            world_from_camera,
        })
    }

    /// The same lens for the same picture with another number of pixels, along each axis on its
    /// own.
    ///
    /// A model of one focal length becomes that of two where pixels change their shape.
    ///
    /// # Errors
    /// As [`Self::new`], for a size that no image has.
    pub fn resized(&self, size: (u32, u32)) -> Result<Self, String> {
        let scale = DVec2::new(
            f64::from(size.0) / f64::from(self.width),
            f64::from(size.1) / f64::from(self.height),
        );
        let model = if scale.x == scale.y {
            self.model
        } else {
            self.model.with_two_focals()
        };
        let old = |name: &str| {
            let at = self.model.param_names().iter().position(|n| *n == name);
            at.map(|at| self.params[at])
        };
        let new = model.param_names().iter().map(|&name| match name {
            "f" | "cx" | "w" => old(name).unwrap_or(0.0) * scale.x,
            "cy" | "h" => old(name).unwrap_or(0.0) * scale.y,
            "fx" => self.focal.x * scale.x,
            "fy" => self.focal.y * scale.y,
            _ => old(name).unwrap_or(0.0),
        });
        let params: Vec<f64> = new.collect();
        Self::new(model, size, &params)
    }
}

/// The coefficients of a model by their names, its field not yet found.
fn distortion(model: LensModel, of: impl Fn(&str) -> f64) -> Distortion {
    match model {
        LensModel::RadTanThinPrismFisheye => Distortion {
            numerator: ["k0", "k1", "k2", "k3", "k4", "k5"].map(&of),
            // Aria counts from the other end.
            tangential: DVec2::new(of("p1"), of("p0")),
            prism: [
                DVec2::new(of("s0"), of("s2")),
                DVec2::new(of("s1"), of("s3")),
            ],
            order: Order::AfterRadial,
            ..Distortion::NONE
        },
        LensModel::FullOpenCv => Distortion {
            numerator: [of("k1"), of("k2"), of("k3"), 0.0, 0.0, 0.0],
            denominator: ["k4", "k5", "k6"].map(&of),
            tangential: DVec2::new(of("p1"), of("p2")),
            ..Distortion::NONE
        },
        _ => Distortion {
            numerator: [of("k1"), of("k2"), of("k3"), of("k4"), 0.0, 0.0],
            tangential: DVec2::new(of("p1"), of("p2")),
            prism: [DVec2::new(of("sx1"), of("sy1")), DVec2::ZERO],
            ..Distortion::NONE
        },
    }
}
