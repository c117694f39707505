//! Boxes around the Gaussians that an edit has changed: what touches none of them is as it was.

use eagpt_scene::{Camera, Gaussian};
use eagpt_trace::Ray;
use eagpt_trace::model::MAX_RADIUS;
use glam::{DVec2, Mat3, Vec3};

/// Boxes of a scene's changes; there may be twice as many. More would follow them more closely, and
/// every ray is held against each.
const ABOUT: usize = 64;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Box3 {
    min: Vec3,
    max: Vec3,
}

impl Box3 {
    /// Around all of a Gaussian that counts.
    fn of(g: &Gaussian) -> Self {
        let frame = Mat3::from_quat(g.rotation);
        let (u, v) = (frame.x_axis * g.scale.x, frame.y_axis * g.scale.y);
        let half = MAX_RADIUS * (u * u + v * v).map(f32::sqrt);
        Self {
            min: g.position - half,
            max: g.position + half,
        }
    }

    fn with(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    fn contains(&self, point: Vec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// Whether a ray is inside before the distance `end`. `inverse`: of its direction.
    fn is_crossed(&self, origin: Vec3, inverse: Vec3, end: f32) -> bool {
        let (a, b) = ((self.min - origin) * inverse, (self.max - origin) * inverse);
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        let misses = near > far || far < 0.0 || near > end;
        !misses
    }
}

/// Boxes around Gaussians.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Boxes(Vec<Box3>);

impl Boxes {
    /// A few boxes around all of `gaussians`, close to what is close together.
    pub(super) fn around(gaussians: impl Iterator<Item = Gaussian>) -> Self {
        let mut single: Vec<Box3> = gaussians.map(|g| Box3::of(&g)).collect();
        let mut boxes = Vec::new();
        let at_most = single.len().div_ceil(ABOUT);
        divide(&mut single, at_most, &mut boxes);
        Self(boxes)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether `point` is in any.
    pub(super) fn contain(&self, point: Vec3) -> bool {
        self.0.iter().any(|one| one.contains(point))
    }

    /// Whether `ray` goes through any before the distance `end`.
    pub(super) fn are_crossed(&self, ray: &Ray, end: f32) -> bool {
        let origin = Vec3::from_array(ray.origin);
        // Zeros would give no number for sides that the ray starts on.
        let inverse = (ray.direction).map(|d| d.abs().max(f32::MIN_POSITIVE).copysign(d));
        let inverse = Vec3::from_array(inverse).recip();
        self.0
            .iter()
            .any(|one| one.is_crossed(origin, inverse, end))
    }
}

/// A camera with the part of the picture of `camera` where `gaussians` are as far as their scales
/// reach, not to their rims; `None` if none is in the picture.
pub(super) fn part_of(camera: &Camera, gaussians: &[Gaussian]) -> Option<Camera> {
    let camera_from_world = camera.world_from_camera.inverse();
    let (focal, centre) = (
        DVec2::new(camera.fx, camera.fy),
        DVec2::new(camera.cx, camera.cy),
    );
    let size = DVec2::new(camera.width.into(), camera.height.into());
    let places = gaussians.iter().filter_map(|g| {
        let place = camera_from_world.transform_point3(g.position.as_dvec3());
        let pixel = place.truncate() / place.z * focal + centre;
        let reach = f64::from(g.scale.max_element()) / place.z * focal + 1.0;
        let (min, max) = (pixel - reach, pixel + reach);
        let is_seen = place.z > 0.0 && max.cmpgt(DVec2::ZERO).all() && min.cmplt(size).all();
        is_seen.then_some([min, max])
    });
    let [min, max] = places.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])?;
    let (min, max) = (min.max(DVec2::ZERO).floor(), max.min(size).ceil());
    Some(Camera {
        width: (max.x - min.x) as u32,
        height: (max.y - min.y) as u32,
        cx: camera.cx - min.x,
        cy: camera.cy - min.y,
        ..*camera
    })
}

/// Halves boxes along the longest side until there are `at_most` together, and puts one around each
/// part.
fn divide(single: &mut [Box3], at_most: usize, boxes: &mut Vec<Box3>) {
    let Some(all) = single.iter().copied().reduce(Box3::with) else {
        return;
    };
    if single.len() <= at_most {
        boxes.push(all);
        return;
    }
    let axis = (all.max - all.min).max_position();
    let centre = |one: &Box3| one.min[axis] + one.max[axis];
    let middle = single.len() / 2;
    single.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)));
    let (one, other) = single.split_at_mut(middle);
    divide(one, at_most, boxes);
    divide(other, at_most, boxes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Gaussians, random_cloud};
    use eagpt_testkit::gaussians::look_at;
    use eagpt_trace::Tracer as _;
    use eagpt_trace::cpu::CpuScene;
    use glam::DVec3;

    /// What a ray meets is inside a box that it crosses.
    #[test]
    fn nothing_is_met_outside_of_boxes() {
        let cloud = random_cloud(2000, 5);
        let cloud: Gaussians = cloud.iter().filter(|g| g.position.x > 0.5).collect();
        let boxes = Boxes::around(cloud.iter());
        assert!(
            (ABOUT..=2 * ABOUT).contains(&boxes.0.len()),
            "{}",
            boxes.0.len()
        );
        let scene = CpuScene::new(&cloud);
        let (mut num_met, mut num_missed) = (0, 0);
        for i in 0..2000 {
            let (sin, cos) = (0.7 * i as f32).sin_cos();
            let origin = 3.0 * Vec3::new(sin, -cos, (0.1 * i as f32).cos());
            let target = cloud.positions[i as usize % cloud.len()] * (1.0 + 0.7 * sin);
            let direction = (target - origin).normalize();
            let ray = Ray::free(origin.to_array(), direction.to_array());
            match scene.realization_hit(&ray, i) {
                Some(hit) => {
                    assert!(boxes.are_crossed(&ray, hit.t + 1e-4));
                    num_met += 1;
                }
                None => num_missed += usize::from(!boxes.are_crossed(&ray, f32::INFINITY)),
            }
        }
        assert!(num_met > 100 && num_missed > 50, "{num_met} {num_missed}");
    }

    /// A part of a picture is that part: the same light, by rays that differ by the rounding of the
    /// principal point.
    #[test]
    fn parts_of_pictures_have_what_is_looked_for() {
        let cloud = random_cloud(400, 5);
        let camera = look_at(DVec3::new(3.0, 0.5, 0.2), DVec3::new(0.0, 0.9, 0.4), 60, 40);
        let scene = CpuScene::new(&cloud);
        let whole = scene.gbuffer(&camera).unwrap();
        let mut num_smaller = 0;
        for start in 0..390 {
            let few = [0, 1, 2].map(|k| cloud.get(start + k));
            let Some(part) = part_of(&camera, &few) else {
                continue;
            };
            let (x, y) = ((camera.cx - part.cx) as u32, (camera.cy - part.cy) as u32);
            assert!(x + part.width <= 60 && y + part.height <= 40);
            num_smaller += usize::from(part.num_pixels() < 2400);
            if start % 20 > 0 {
                continue;
            }
            let features = scene.gbuffer(&part).unwrap();
            for (i, pixel) in (0..).zip(&features.pixels) {
                let at = (y + i / part.width) * 60 + x + i % part.width;
                let off = pixel.radiance() - whole.pixels[at as usize].radiance();
                // A ray at the rim of a disc meets it or not: a hundredth of its light.
                assert!(off.abs().max_element() < 0.02, "{start}: {off}");
            }
        }
        assert!(num_smaller > 100, "{num_smaller}");
        let behind = look_at(DVec3::new(3.0, 0.0, 0.0), DVec3::new(9.0, 0.0, 0.0), 60, 40);
        let all: Vec<Gaussian> = cloud.iter().collect();
        assert_eq!(part_of(&behind, &all), None);
    }
}
