//! Checks of poses, intrinsics and points.

use super::images::median;
use super::report::{CameraReport, IntrinsicsReport, PointsReport};
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::{Camera, Dataset};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Most points that are checked.
const MAX_POINTS: usize = 10_000;
/// Cosine of the angle between viewing directions below which cameras at one place are different
/// views.
const SAME_DIRECTION: f64 = 1.0 - 1e-9;

fn cameras(dataset: &Dataset) -> Vec<Camera> {
    dataset.frames().iter().map(|frame| frame.camera).collect()
}

pub(super) fn poses(dataset: &Dataset) -> CameraReport {
    let cameras = cameras(dataset);
    let up = dataset.up().vector().as_dvec3();
    let centres: Vec<DVec3> = cameras
        .iter()
        .map(|c| c.world_from_camera.translation)
        .collect();
    let low = centres
        .iter()
        .copied()
        .reduce(DVec3::min)
        .unwrap_or_default();
    let high = centres
        .iter()
        .copied()
        .reduce(DVec3::max)
        .unwrap_or_default();
    let mut heights: Vec<f64> = centres.iter().map(|centre| centre.dot(up)).collect();
    heights.sort_unstable_by(f64::total_cmp);
    // Camera space is y down.
    let ups = cameras.iter().map(|c| -c.world_from_camera.matrix3.y_axis);
    let mean_up: DVec3 = ups.sum::<DVec3>() / cameras.len() as f64;
    let mean_up = mean_up.try_normalize();
    let angle = |axis: DVec3| {
        let cosine = mean_up.map(|mean| mean.dot(axis).clamp(-1.0, 1.0));
        cosine.map(|cosine| cosine.acos().to_degrees())
    };
    let nearest: Vec<f64> = (0..centres.len())
        .into_par_iter()
        .filter_map(|index| {
            let others = centres
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != index);
            let distances = others.map(|(_, other)| other.distance(centres[index]));
            distances.min_by(f64::total_cmp)
        })
        .collect();
    let most_upright = ALL_AXES
        .into_iter()
        .filter_map(|axis| Some((axis, angle(axis.vector().as_dvec3())?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(axis, _)| axis);
    CameraReport {
        low: low.to_array(),
        high: high.to_array(),
        extent: (high - low).length(),
        heights: [
            heights[0],
            heights[heights.len() / 2],
            heights[heights.len() - 1],
        ],
        up_angle_deg: angle(up),
        most_upright,
        nearest_neighbour: [
            nearest.iter().copied().fold(f64::INFINITY, f64::min),
            median(nearest.clone()).unwrap_or(f64::INFINITY),
            nearest.iter().copied().fold(0.0, f64::max),
        ]
        .map(|distance| if nearest.is_empty() { 0.0 } else { distance }),
        same_pose: same_poses(dataset),
    }
}

const ALL_AXES: [UpAxis; 6] = [
    UpAxis::X,
    UpAxis::NegX,
    UpAxis::Y,
    UpAxis::NegY,
    UpAxis::Z,
    UpAxis::NegZ,
];

/// Pairs of views with one pose, one after another in the order of their places.
fn same_poses(dataset: &Dataset) -> Vec<[String; 2]> {
    let mut order: Vec<usize> = (0..dataset.len()).collect();
    let pose = |index: usize| &dataset.frames()[index].camera.world_from_camera;
    order.sort_by(|&a, &b| {
        let keys = pose(a)
            .translation
            .to_array()
            .into_iter()
            .zip(pose(b).translation.to_array());
        let first = keys
            .map(|(a, b)| a.total_cmp(&b))
            .find(|order| order.is_ne());
        first.unwrap_or_else(|| a.cmp(&b))
    });
    let same = order.windows(2).filter(|pair| {
        let (a, b) = (pose(pair[0]), pose(pair[1]));
        a.translation == b.translation
            && a.matrix3.z_axis.dot(b.matrix3.z_axis) > SAME_DIRECTION
            && a.matrix3.x_axis.dot(b.matrix3.x_axis) > SAME_DIRECTION
    });
    let name = |index: usize| dataset.frames()[index].name.clone();
    same.map(|pair| [name(pair[0]), name(pair[1])]).collect()
}

pub(super) fn intrinsics(dataset: &Dataset) -> IntrinsicsReport {
    let cameras = cameras(dataset);
    let mut sizes: Vec<[u32; 2]> = cameras.iter().map(|c| [c.width, c.height]).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let range = |value: &dyn Fn(&Camera) -> f64| {
        let values = || cameras.iter().map(value);
        [
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        ]
    };
    let fov = |focal: f64, size: u32| (2.0 * (0.5 * f64::from(size) / focal).atan()).to_degrees();
    IntrinsicsReport {
        sizes,
        fov_x_deg: range(&|c| fov(c.fx, c.width)),
        fov_y_deg: range(&|c| fov(c.fy, c.height)),
        pixel_aspect: range(&|c| c.fx / c.fy),
        principal_offset: range(&|c| {
            let x = (c.cx / f64::from(c.width) - 0.5).abs();
            x.max((c.cy / f64::from(c.height) - 0.5).abs())
        }),
    }
}

/// An even sample of a cloud.
pub(super) fn sample(cloud: &PointCloud) -> Vec<Vec3> {
    let step = cloud.len().div_ceil(MAX_POINTS).max(1);
    cloud.positions.iter().copied().step_by(step).collect()
}

pub(super) fn points(cloud: &PointCloud, sample: &[Vec3], dataset: &Dataset) -> PointsReport {
    let low = cloud
        .positions
        .iter()
        .copied()
        .reduce(Vec3::min)
        .unwrap_or_default();
    let high = cloud
        .positions
        .iter()
        .copied()
        .reduce(Vec3::max)
        .unwrap_or_default();
    let cameras = cameras(dataset);
    let is_seen = |point: &Vec3| {
        cameras.iter().any(|camera| {
            let at = camera.project(*point);
            let inside = at.z > 0.0 && at.x >= 0.0 && at.y >= 0.0;
            inside && at.x < camera.width as f32 && at.y < camera.height as f32
        })
    };
    let num_seen = sample.par_iter().filter(|point| is_seen(point)).count();
    PointsReport {
        num: cloud.len(),
        low: low.to_array(),
        high: high.to_array(),
        share_in_view: num_seen as f64 / sample.len().max(1) as f64,
    }
}
