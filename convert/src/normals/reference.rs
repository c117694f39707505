//! Reference normals from the depths or the points of a dataset.

use crate::surface::{normals_from_depth, normals_of_points};
use eagpt_scene::ply::PointCloud;
use eagpt_scene::{Camera, Frame, Image, Result, exr};
use glam::{DVec3, Vec3};
use serde::Serialize;

/// About so many places of a view are compared.
const NUM_PLACES: usize = 4000;
/// Size of the cells, pixels, of which only the nearest point counts: others may lie behind its
/// surface.
const CELL: u32 = 6;
/// Most points that are used.
const MAX_POINTS: usize = 200_000;

/// Where references come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reference {
    /// The dataset's depth maps
    Depth,
    /// Planes through neighbours in the point cloud
    Points,
    /// Nothing
    None,
}

/// A pixel and the unit normal of its surface, world space, turned to the camera.
pub(super) struct Place {
    pub(super) pixel: usize,
    pub(super) normal: DVec3,
}

/// Points with the normals of their planes.
pub(super) struct Oriented {
    points: Vec<(Vec3, Vec3)>,
}

impl Oriented {
    pub(super) fn new(cloud: &PointCloud) -> Self {
        let normals = normals_of_points(&cloud.positions);
        let known = cloud.positions.iter().copied().zip(normals);
        let known: Vec<(Vec3, Vec3)> = known.filter(|(_, n)| *n != Vec3::ZERO).collect();
        let step = known.len().div_ceil(MAX_POINTS).max(1);
        Self {
            points: known.into_iter().step_by(step).collect(),
        }
    }

    fn places(&self, camera: &Camera) -> Vec<Place> {
        let across = camera.width.div_ceil(CELL) as usize;
        let num_cells = across * camera.height.div_ceil(CELL) as usize;
        let mut nearest: Vec<Option<(f32, usize, Vec3)>> = vec![None; num_cells];
        for (position, normal) in &self.points {
            let at = camera.project(*position);
            let inside = at.z > 0.0 && at.x >= 0.0 && at.y >= 0.0;
            if !inside || at.x >= camera.width as f32 || at.y >= camera.height as f32 {
                continue;
            }
            let (x, y) = (at.x as u32, at.y as u32);
            let cell = &mut nearest[(y / CELL) as usize * across + (x / CELL) as usize];
            if cell.is_none_or(|(depth, ..)| at.z < depth) {
                let pixel = y as usize * camera.width as usize + x as usize;
                let ray = *position - camera.origin();
                let turned = if normal.dot(ray) > 0.0 {
                    -*normal
                } else {
                    *normal
                };
                *cell = Some((at.z, pixel, turned));
            }
        }
        let there = nearest.into_iter().flatten();
        there
            .map(|(_, pixel, normal)| Place {
                pixel,
                normal: normal.as_dvec3(),
            })
            .collect()
    }
}

/// The places of a view where a reference is known.
///
/// # Errors
/// [`eagpt_scene::SceneError`] if its depth map cannot be read.
pub(super) fn places(frame: &Frame, points: Option<&Oriented>) -> Result<Vec<Place>> {
    let camera = &frame.camera;
    if let Some(path) = &frame.files.depth {
        let depth: Image<1> = exr::read_single(path)?;
        if depth.size() == (camera.width, camera.height) {
            let normals = normals_from_depth(&depth, camera);
            let step = (camera.num_pixels() / NUM_PLACES).max(1);
            let known = normals.pixels().iter().enumerate().step_by(step);
            let known = known.filter(|(_, normal)| **normal != [0.0; 3]);
            return Ok(known
                .map(|(pixel, normal)| Place {
                    pixel,
                    normal: Vec3::from(*normal).as_dvec3(),
                })
                .collect());
        }
    }
    Ok(points
        .map(|points| points.places(camera))
        .unwrap_or_default())
}
