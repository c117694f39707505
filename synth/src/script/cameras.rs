//! `[cameras]`: rings of cameras in the room.

use eagpt_scene::script::Node;
use eagpt_scene::{Camera, Result};
use glam::DVec2;
use std::f64::consts::TAU;

/// Where photographs are taken from.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPlan {
    /// Number of positions.
    pub num_views: u32,
    /// Size of the truth images, pixels.
    pub size: [u32; 2],
    /// Field of view across, radians.
    pub fov_x_rad: f64,
    /// Rings that the positions are spread over.
    pub rings: Vec<Ring>,
}

/// Cameras on an ellipse; heights, directions and pitches are taken in turn.
#[derive(Debug, Clone, PartialEq)]
pub struct Ring {
    /// Share of the positions, relative to other rings.
    pub share: f64,
    /// Middle of the ellipse.
    pub centre: DVec2,
    /// Half axes along x and y, metres.
    pub radii: DVec2,
    /// Heights, metres.
    pub heights: Vec<f64>,
    /// Directions, radians from that to the middle.
    pub turns_rad: Vec<f64>,
    /// Pitches, radians above the horizon.
    pub pitches_rad: Vec<f64>,
}

pub(super) fn plan(node: &Node<'_>) -> Result<CameraPlan> {
    let table = node.table(&["views", "size", "fov_x", "ring"])?;
    let [width, height] = table.need("size")?.fixed_array()?;
    let fov_node = table.need("fov_x")?;
    let fov = fov_node.double()?;
    if !(1.0..=150.0).contains(&fov) {
        return Err(fov_node.error(format!("{fov} is not from 1 to 150 degrees")));
    }
    let rings = table.need("ring")?;
    let rings = rings
        .array()?
        .iter()
        .map(ring)
        .collect::<Result<Vec<_>>>()?;
    if rings.is_empty() {
        return Err(table.node.error("`ring` is missing"));
    }
    Ok(CameraPlan {
        num_views: table.need("views")?.whole(1..=10_000)?,
        size: [width.whole(8..=16_384)?, height.whole(8..=16_384)?],
        fov_x_rad: fov.to_radians(),
        rings,
    })
}

fn ring(node: &Node<'_>) -> Result<Ring> {
    let table = node.table(&["share", "centre", "radii", "heights", "turns", "pitches"])?;
    let list = |key: &str| -> Result<Vec<f64>> {
        let node = table.need(key)?;
        let numbers = node
            .array()?
            .iter()
            .map(Node::double)
            .collect::<Result<Vec<_>>>()?;
        if numbers.is_empty() {
            return Err(node.error("is empty"));
        }
        Ok(numbers)
    };
    let pair = |key: &str| -> Result<DVec2> {
        let [x, y] = table.need(key)?.fixed_array()?;
        Ok(DVec2::new(x.double()?, y.double()?))
    };
    let radians = |numbers: Vec<f64>| numbers.into_iter().map(f64::to_radians).collect();
    let pitches = table.need("pitches")?;
    if let Some(steep) = list("pitches")?.iter().find(|pitch| pitch.abs() > 80.0) {
        return Err(pitches.error(format!("{steep} is beyond 80 degrees")));
    }
    Ok(Ring {
        share: match table.get("share") {
            Some(node) => node.positive()?.into(),
            None => 1.0,
        },
        centre: pair("centre")?,
        radii: pair("radii")?,
        heights: list("heights")?,
        turns_rad: radians(list("turns")?),
        pitches_rad: radians(list("pitches")?),
    })
}

impl CameraPlan {
    /// The cameras, ring by ring.
    pub fn cameras(&self) -> Vec<Camera> {
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
