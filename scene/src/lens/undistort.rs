//! A pinhole camera for a lens, and images moved between the two.

mod bounds;
mod options;

pub use options::{Field, Pinhole, UndistortOptions};

use super::{Lens, Remapped, remap};
use crate::camera::Camera;
use crate::image::Image;
use bounds::edge_bounds;
use glam::{DAffine3, DVec2, DVec3};

/// A lens and the pinhole camera that takes its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Undistortion {
    lens: Lens,
    /// In camera space.
    pinhole: Camera,
}

impl Undistortion {
    /// Chooses the pinhole camera: it looks along the lens's axis, with the lens's number of pixels
    /// a radian on the axis. A lens that is a pinhole stays as it is; a camera that is given is
    /// taken.
    ///
    /// # Errors
    /// If the options are out of range, or the lens shows nothing around its axis that a plane
    /// could show.
    pub fn new(lens: &Lens, options: &UndistortOptions) -> Result<Self, String> {
        options.validate()?;
        let done = |pinhole| Self {
            lens: *lens,
            pinhole,
        };
        if let Some(given) = options.pinhole {
            return Ok(done(given.at(DAffine3::IDENTITY)));
        }
        if let Some(pinhole) = lens.as_pinhole(DAffine3::IDENTITY) {
            return Ok(done(pinhole));
        }
        let (centre, focal) = axis(lens).ok_or_else(|| {
            let model = lens.model();
            format!("the optical axis of the {model} lens has no image")
        })?;
        let (width, height) = lens.size();
        let mut pinhole = Camera {
            width,
            height,
            fx: focal.x,
            fy: focal.y,
            cx: centre.x,
            cy: centre.y,
            world_from_camera: DAffine3::IDENTITY,
        };
        if options.field == Field::Same {
            return Ok(done(pinhole));
        }
        let limit = (0.5 * options.max_fov_deg).to_radians().tan();
        let mut bounds = edge_bounds(lens, options.field).clamped(limit);
        if options.field == Field::Inside {
            bounds = bounds.shrunk_to_known(lens, focal);
        }
        let size = (bounds.high - bounds.low) * focal;
        let whole = match options.field {
            // Rounding must not bring an unknown pixel in.
            Field::Inside => size.floor(),
            Field::All | Field::Same => size.ceil(),
        };
        if !(whole.min_element() >= 1.0 && whole.max_element() <= f64::from(super::MAX_SIZE)) {
            return Err(format!(
                "a pinhole image of the {} lens would have {}x{} pixels",
                lens.model(),
                whole.x,
                whole.y
            ));
        }
        (pinhole.width, pinhole.height) = (whole.x as u32, whole.y as u32);
        // Rounding changes both sides alike.
        let principal = -bounds.low * focal + 0.5 * (whole - size);
        (pinhole.cx, pinhole.cy) = (principal.x, principal.y);
        Ok(done(pinhole))
    }

    /// The lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The pinhole camera at a pose.
    pub fn camera(&self, world_from_camera: DAffine3) -> Camera {
        Camera {
            world_from_camera,
            ..self.pinhole
        }
    }

    /// The same with a pinhole image of another size (width, height): the same picture with other
    /// pixels.
    ///
    /// # Errors
    /// If a side is 0 or beyond [`super::MAX_SIZE`].
    pub fn resized(&self, size: (u32, u32)) -> Result<Self, String> {
        let (width, height) = size;
        if ![width, height]
            .iter()
            .all(|n| (1..=super::MAX_SIZE).contains(n))
        {
            return Err(format!(
                "{width}x{height} pixels, not 1 to {} each",
                super::MAX_SIZE
            ));
        }
        let old = &self.pinhole;
        let by_x = f64::from(width) / f64::from(old.width);
        let by_y = f64::from(height) / f64::from(old.height);
        let pinhole = Camera {
            width,
            height,
            fx: old.fx * by_x,
            fy: old.fy * by_y,
            cx: old.cx * by_x,
            cy: old.cy * by_y,
            ..*old
        };
        Ok(Self { pinhole, ..*self })
    }

    /// Position in the lens's image of a position in the pinhole image, pixels; `None` outside
    /// of the lens's field.
    pub fn source_from_target(&self, pixel: DVec2) -> Option<DVec2> {
        self.lens.project(pinhole_direction(&self.pinhole, pixel))
    }

    /// As [`Self::apply`] for images whose values must not be mixed, as depths across an edge: the
    /// nearest pixel of the lens's image; 0 where there is none.
    ///
    /// # Errors
    /// If the image has another size than the lens.
    pub fn apply_nearest<const C: usize>(&self, image: &Image<C>) -> Result<Image<C>, String> {
        check_size(image, self.lens.size())?;
        if self.is_identity() {
            return Ok(image.clone());
        }
        let mut picked = Image::filled(self.pinhole.width, self.pinhole.height, [0.0; C]);
        let width = self.pinhole.width as usize;
        let (last_x, last_y) = (image.width() - 1, image.height() - 1);
        for (index, pixel) in picked.pixels_mut().iter_mut().enumerate() {
            let centre = DVec2::new((index % width) as f64, (index / width) as f64) + 0.5;
            let at = self.source_from_target(centre);
            if let Some(at) = at.filter(|at| self.lens.contains(*at)) {
                *pixel = image.get((at.x as u32).min(last_x), (at.y as u32).min(last_y));
            }
        }
        Ok(picked)
    }

    /// Whether images stay as they are.
    pub fn is_identity(&self) -> bool {
        self.lens.as_pinhole(DAffine3::IDENTITY) == Some(self.pinhole)
    }

    /// The pinhole image of an image that the lens took, whose size is the lens's; linear light
    /// stays linear.
    ///
    /// # Errors
    /// If the image has another size.
    pub fn apply<const C: usize>(&self, image: &Image<C>) -> Result<Remapped<C>, String> {
        check_size(image, self.lens.size())?;
        if self.is_identity() {
            return Ok(Remapped {
                image: image.clone(),
                valid: Image::filled(image.width(), image.height(), [1.0]),
            });
        }
        let size = (self.pinhole.width, self.pinhole.height);
        Ok(remap(image, size, |pixel| self.source_from_target(pixel)))
    }
}

/// The image that `lens` would have taken instead of the `image` of `camera`: the inverse of
/// [`Undistortion::apply`], for simulated cameras. The pose does not matter.
///
/// # Errors
/// If the image has not the camera's size.
pub fn distort<const C: usize>(
    image: &Image<C>,
    camera: &Camera,
    lens: &Lens,
) -> Result<Remapped<C>, String> {
    check_size(image, (camera.width, camera.height))?;
    Ok(remap(image, lens.size(), |pixel| {
        let ray = lens.unproject(pixel).filter(|ray| ray.z > 0.0)?;
        let plane = ray.truncate() / ray.z;
        Some(plane * DVec2::new(camera.fx, camera.fy) + DVec2::new(camera.cx, camera.cy))
    }))
}

fn check_size<const C: usize>(image: &Image<C>, wanted: (u32, u32)) -> Result<(), String> {
    let (width, height) = image.size();
    if (width, height) == wanted {
        return Ok(());
    }
    Err(format!(
        "{width}x{height}, but its camera has {}x{}",
        wanted.0, wanted.1
    ))
}

fn pinhole_direction(camera: &Camera, pixel: DVec2) -> DVec3 {
    let plane = (pixel - DVec2::new(camera.cx, camera.cy)) / DVec2::new(camera.fx, camera.fy);
    plane.extend(1.0)
}

/// The optical axis in the image, and pixels a radian there.
fn axis(lens: &Lens) -> Option<(DVec2, DVec2)> {
    // Central differences of an even function: an error of the order of 1e-8.
    const STEP: f64 = 1e-4;
    let at = |x: f64, y: f64| lens.project(DVec3::new(x, y, 1.0));
    let across = at(STEP, 0.0)? - at(-STEP, 0.0)?;
    let down = at(0.0, STEP)? - at(0.0, -STEP)?;
    let focal = DVec2::new(across.x, down.y) / (2.0 * STEP);
    Some((at(0.0, 0.0)?, focal))
}
