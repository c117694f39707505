//! The lens: what distortion does to the image on the sensor.

use super::Rig;
use crate::error::{Result, SynthError};
use eagpt_scene::lens::{Lens, LensModel, undistort};
use eagpt_scene::{Camera, Image};
use glam::DVec2;

/// Pixels of the truth beyond what the lens asks for: the resampling filter looks two pixels
/// around, on a finer grid.
const AIR: u32 = 2;
/// Widest margin, as a share of the image's width: beyond it the lens cannot be meant.
const MAX_MARGIN: f64 = 0.5;

impl Rig {
    /// The lens in front of the sensor behind a camera of the truth.
    ///
    /// # Errors
    /// [`SynthError::Option`] if no lens has this distortion.
    pub(crate) fn lens(&self, camera: &Camera) -> Result<Lens> {
        let sensor = camera.magnified(self.oversampling);
        let [k1, k2, p1, p2] = self.distortion;
        let params = [sensor.fx, sensor.fy, sensor.cx, sensor.cy, k1, k2, p1, p2];
        let size = (sensor.width, sensor.height);
        Lens::new(LensModel::OpenCv, size, &params).map_err(distortion)
    }

    /// Whether the lens is a pinhole.
    pub(crate) fn is_straight(&self) -> bool {
        self.distortion == [0.0; 4]
    }

    /// Pixels of the truth that have to be known beyond its edges, for the sensor to be covered.
    ///
    /// # Errors
    /// [`SynthError::Option`] if that is unreasonably many, or pixels of the sensor see nothing.
    pub(crate) fn margin(&self, camera: &Camera) -> Result<u32> {
        if self.is_straight() {
            return Ok(0);
        }
        let lens = self.lens(camera)?;
        let (width, height) = lens.size();
        let (w, h) = (f64::from(width), f64::from(height));
        // The image's edge lies on the lens's: no pixel within goes farther out, or the lens would
        // not be one to one.
        let along = (0..=64).map(|i| f64::from(i) / 64.0);
        let edge = along.flat_map(|t| {
            [[t * w, 0.0], [t * w, h], [0.0, t * h], [w, t * h]].map(DVec2::from_array)
        });
        let mut beyond: f64 = 0.0;
        for pixel in edge {
            let ray = lens.unproject(pixel).filter(|ray| ray.z > 0.0);
            let Some(ray) = ray else {
                return Err(distortion(format!("nothing is seen at {pixel}")));
            };
            let at = ray.truncate() / ray.z * DVec2::new(camera.fx, camera.fy)
                + DVec2::new(camera.cx, camera.cy);
            let size = DVec2::new(camera.width.into(), camera.height.into());
            beyond = beyond.max((-at).max(at - size).max_element());
        }
        if beyond > MAX_MARGIN * f64::from(camera.width) {
            return Err(distortion(format!(
                "the image reaches {beyond:.0} pixels beyond its edge"
            )));
        }
        Ok(beyond.ceil() as u32 + AIR)
    }

    /// The image on the sensor, from that of a pinhole `camera` with the sensor's resolution and a
    /// margin around.
    ///
    /// # Errors
    /// [`SynthError::Option`] if the lens sees beyond the margin.
    pub(crate) fn through_lens(
        &self,
        image: &Image<3>,
        camera: &Camera,
        lens: &Lens,
    ) -> Result<Image<3>> {
        let distorted = undistort::distort(image, camera, lens).map_err(distortion)?;
        match distorted.num_unknown() {
            0 => Ok(distorted.image),
            num => Err(distortion(format!(
                "{num} pixels of the sensor see nothing"
            ))),
        }
    }
}

fn distortion(problem: impl Into<String>) -> SynthError {
    SynthError::Option {
        field: "rig.distortion",
        problem: problem.into(),
    }
}
