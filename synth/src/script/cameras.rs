//! `[cameras]`: rings of cameras in the room.

use eagpt_scene::Camera;
use eagpt_scene::script::value::{Array, NonEmpty, Number, Positive, Whole, checked, via};
use glam::DVec2;
use serde::{Deserialize, Deserializer};
use std::f64::consts::TAU;

/// Positions and directions that photographs are taken from.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CameraPlan {
    /// Number of positions.
    #[serde(rename = "views", deserialize_with = "via::<Whole<1, 10_000>, _, _>")]
    pub(crate) num_views: u32,
    /// Size of the truth images, pixels.
    #[serde(deserialize_with = "via::<Array<Whole<8, 16_384>, 2>, _, _>")]
    pub(crate) size: [u32; 2],
    /// Field of view across, radians.
    #[serde(rename = "fov_x", deserialize_with = "fov")]
    pub(crate) fov_x_rad: f64,
    /// Rings that the positions are spread over.
    #[serde(rename = "ring", deserialize_with = "via::<NonEmpty<Ring>, _, _>")]
    pub(crate) rings: Vec<Ring>,
}

/// Cameras on an ellipse; heights, directions and pitches are taken in turn.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Ring {
    /// Share of the positions, relative to other rings.
    #[serde(default = "whole_share", deserialize_with = "share")]
    pub(crate) share: f64,
    /// Middle of the ellipse.
    #[serde(deserialize_with = "via::<Array<Number, 2>, _, _>")]
    pub(crate) centre: DVec2,
    /// Half axes along x and y, metres.
    #[serde(deserialize_with = "via::<Array<Number, 2>, _, _>")]
    pub(crate) radii: DVec2,
    /// Heights, metres.
    #[serde(deserialize_with = "via::<NonEmpty<Number>, _, _>")]
    pub(crate) heights: Vec<f64>,
    /// Directions, radians from that to the middle.
    #[serde(rename = "turns", deserialize_with = "turns")]
    pub(crate) turns_rad: Vec<f64>,
    /// Pitches, radians above the horizon.
    #[serde(rename = "pitches", deserialize_with = "pitches")]
    pub(crate) pitches_rad: Vec<f64>,
}

fn fov<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |degrees: Number| {
        let degrees = f64::from(degrees);
        let valid = (1.0..=150.0).contains(&degrees);
        let radians = valid.then_some(degrees.to_radians());
        radians.ok_or_else(|| format!("{degrees} is not from 1 to 150 degrees"))
    })
}

fn whole_share() -> f64 {
    1.0
}

/// Shares are of single precision.
fn share<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    via::<Positive, _, f32>(deserializer).map(f64::from)
}

fn turns<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let degrees: Vec<f64> = via::<NonEmpty<Number>, _, _>(deserializer)?;
    Ok(degrees.into_iter().map(f64::to_radians).collect())
}

fn pitches<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    checked(deserializer, |NonEmpty(degrees): NonEmpty<Number>| {
        let degrees = degrees.into_iter().map(f64::from);
        let radians = degrees.map(|degrees| match degrees {
            -80.0..=80.0 => Ok(degrees.to_radians()),
            steep => Err(format!("{steep} is beyond 80 degrees")),
        });
        radians.collect()
    })
}

impl CameraPlan {
    /// The cameras, ring by ring.
    pub(crate) fn cameras(&self) -> Vec<Camera> {
        let total: f64 = self.rings.iter().map(|ring| ring.share).sum();
        let (mut cameras, mut share) = (Vec::new(), 0.0);
        for ring in &self.rings {
            share += ring.share;
            let until = (f64::from(self.num_views) * share / total).round() as usize;
            let num = until.saturating_sub(cameras.len());
            cameras.extend((0..num).map(|i| self.camera(ring, i, num)));
        }
        cameras
    }

    fn camera(&self, ring: &Ring, index: usize, num: usize) -> Camera {
        let angle = TAU * index as f64 / num as f64;
        let of = |list: &[f64]| list[index % list.len()];
        let around = ring.radii * DVec2::from_angle(angle);
        let eye = (ring.centre + around).extend(of(&ring.heights));
        // A ring without radius looks outwards as it turns.
        let inwards = angle + 0.5 * TAU;
        let (heading, pitch) = (inwards + of(&ring.turns_rad), of(&ring.pitches_rad));
        let level = DVec2::from_angle(heading) * pitch.cos();
        let pose = Camera::level_pose(eye, level.extend(pitch.sin()));
        Camera::centred(self.size, self.fov_x_rad, pose)
    }
}
