//! The camera that photographs the room: lens, sensor, exposures.

mod lens;
mod sensor;

pub(crate) use sensor::Sensor;

use crate::dng::RGGB;
use eagpt_scene::script::value::{Array, NotNegative, Number, Positive, Whole, checked, via};
use serde::{Deserialize, Deserializer, Serialize};

/// CIE XYZ of linear Rec.709, row by row (ITU-R BT.709, white point D65).
const XYZ_FROM_REC709: [[f64; 3]; 3] = [
    [0.412_390_8, 0.357_584_3, 0.180_480_8],
    [0.212_639_0, 0.715_168_7, 0.072_192_3],
    [0.019_330_8, 0.119_194_8, 0.950_532_2],
];

/// A camera with its settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rig {
    /// Make, as in EXIF.
    #[serde(skip_deserializing)]
    pub make: String,
    /// Model, as in EXIF.
    #[serde(skip_deserializing)]
    pub model: String,
    /// Width of the sensor, millimetres; with the field of view it gives the focal length.
    #[serde(deserialize_with = "via::<Positive, _, _>")]
    pub sensor_width_mm: f64,
    /// Sensor pixels along each side of a pixel of the truth.
    #[serde(deserialize_with = "via::<Whole<1, 8>, _, _>")]
    pub oversampling: u32,
    /// ISO speed.
    #[serde(deserialize_with = "level::<1, 65_535, _>")]
    pub iso: u16,
    /// Aperture, focal length over diameter.
    #[serde(deserialize_with = "via::<Positive, _, _>")]
    pub f_number: f64,
    /// Exposure times of a bracket, seconds, in the order they are taken.
    #[serde(deserialize_with = "exposures")]
    pub exposures_s: Vec<f64>,
    /// Loss of light towards the corners, a, b, c of 1 + a r² + b r⁴ + c r⁶, r = 1 in the corner.
    #[serde(deserialize_with = "via::<Array<Number, 3>, _, _>")]
    pub vignetting: [f64; 3],
    /// Lens distortion k1, k2, p1, p2 of COLMAP's model OPENCV.
    #[serde(deserialize_with = "via::<Array<Number, 4>, _, _>")]
    pub distortion: [f64; 4],
    /// Electrons at which a pixel clips.
    #[serde(deserialize_with = "via::<Positive, _, _>")]
    pub full_well_e: f64,
    /// Standard deviation of the electronics, electrons.
    #[serde(deserialize_with = "read_noise")]
    pub read_noise_e: f64,
    /// Sample of no light.
    #[serde(deserialize_with = "level::<0, 65_534, _>")]
    pub black: u16,
    /// Sample at which a pixel clips.
    #[serde(deserialize_with = "level::<2, 65_535, _>")]
    pub white: u16,
    /// Camera's R, G, B of CIE XYZ, row by row.
    #[serde(skip_deserializing)]
    pub camera_from_xyz: [[f64; 3]; 3],
}

impl Default for Rig {
    fn default() -> Self {
        Self {
            make: "eagpt".to_owned(),
            model: "Virtual Camera".to_owned(),
            sensor_width_mm: 23.5,
            oversampling: 2,
            iso: 100,
            f_number: 8.0,
            exposures_s: vec![0.0025, 0.01, 0.04, 0.16, 0.64],
            vignetting: [-0.22, 0.05, -0.01],
            distortion: [0.0; 4],
            full_well_e: 50_000.0,
            read_noise_e: 3.0,
            black: 512,
            white: 16_383,
            // Of the order of an APS-C camera's: all responses to Rec.709 primaries are positive.
            camera_from_xyz: [
                [0.60, -0.15, -0.05],
                [-0.48, 1.21, 0.30],
                [-0.07, 0.14, 0.67],
            ],
        }
    }
}

impl Rig {
    /// Camera's R, G, B of linear Rec.709, row by row; its green of white is 1.
    pub(crate) fn camera_from_rec709(&self) -> [[f64; 3]; 3] {
        let mut matrix = self.camera_from_xyz.map(|row| {
            [0, 1, 2].map(|j| (0..3).map(|i| row[i] * XYZ_FROM_REC709[i][j]).sum::<f64>())
        });
        let green: f64 = matrix[1].iter().sum();
        for value in matrix.as_flattened_mut() {
            *value /= green;
        }
        matrix
    }

    /// Camera's R, G, B of a neutral surface under D65, green 1.
    pub(crate) fn as_shot_neutral(&self) -> [f64; 3] {
        self.camera_from_rec709().map(|row| row.iter().sum())
    }

    /// Focal length for a field of view across, millimetres.
    pub(crate) fn focal_length_mm(&self, fov_x_rad: f64) -> f64 {
        0.5 * self.sensor_width_mm / (0.5 * fov_x_rad).tan()
    }

    /// Share of the light that reaches a point of the image, `r2` the square of its distance from
    /// the middle over that of the corner.
    pub(crate) fn falloff(&self, r2: f64) -> f64 {
        let [a, b, c] = self.vignetting;
        1.0 + r2 * (a + r2 * (b + r2 * c))
    }

    /// The filters of its mosaic.
    pub(crate) fn cfa(&self) -> crate::dng::Cfa {
        RGGB
    }
}

fn exposures<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    checked(deserializer, |seconds: Vec<Number>| {
        if !(1..=32).contains(&seconds.len()) {
            return Err(format!("{} exposures: 1 to 32 are possible", seconds.len()));
        }
        let seconds = seconds.into_iter().map(|seconds| match f64::from(seconds) {
            seconds @ 1e-5..=3600.0 => Ok(seconds),
            seconds => Err(format!("{seconds} s is not from 0.00001 to 3600")),
        });
        seconds.collect()
    })
}

/// Noise is given in single precision.
fn read_noise<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    via::<NotNegative, _, f32>(deserializer).map(f64::from)
}

fn level<'de, const MIN: u32, const MAX: u32, D>(deserializer: D) -> Result<u16, D::Error>
where
    D: Deserializer<'de>,
{
    via::<Whole<MIN, MAX>, _, u32>(deserializer).map(|level| level as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_neutral_and_no_primary_is_negative() {
        let rig = Rig::default();
        assert!(
            rig.camera_from_rec709()
                .as_flattened()
                .iter()
                .all(|v| *v > 0.0)
        );
        let neutral = rig.as_shot_neutral();
        assert!((neutral[1] - 1.0).abs() < 1e-12);
        // The matrix times XYZ of D65 (0.95046, 1, 1.08906).
        let xyz = [0.950_455_9, 1.0, 1.089_057_8];
        let response = rig
            .camera_from_xyz
            .map(|row| (0..3).map(|i| row[i] * xyz[i]).sum::<f64>());
        for (n, r) in neutral.iter().zip(response) {
            assert!((n - r / response[1]).abs() < 1e-6);
        }
        // 75 degrees on 23.5 mm: 11.75 / tan 37.5°.
        assert!((rig.focal_length_mm(75_f64.to_radians()) - 15.313).abs() < 1e-3);
        assert!((rig.falloff(1.0) - 0.82).abs() < 1e-12);
    }
}
