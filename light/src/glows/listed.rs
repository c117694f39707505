//! Surfaces that shine of themselves, as lamps of a list.

use eagpt_scene::camera::RayFrame;
use eagpt_scene::lamps::Lamp;
use eagpt_scene::median::median_of;
use eagpt_scene::plane::FittedPlane;
use eagpt_scene::{Camera, Gaussians, LampShape};
use eagpt_trace::{Features, TraceError, Tracer};
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::FRAC_PI_2;

/// Angles of its box about its normal that are tried.
const NUM_ANGLES: usize = 90;
/// Pixels of a view, at least, that see it.
const LEAST_PIXELS: f32 = 1.0;
/// A view sees all of it if it sees this part of the largest area that a view sees.
const WHOLE: f32 = 0.7;
/// Least cosine between a surface and the direction to a camera: what is seen closer to edge-on
/// has no certain area.
const LEAST_COSINE: f32 = 0.1;

/// Area and views of a surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sight {
    /// Area, scene units².
    pub area: f32,
    /// Names of the views.
    pub views: Vec<String>,
}

/// Area and views of each of `glows`, surfaces of the `num` Gaussians that `tracer` traces; `views`
/// are cameras with their names.
///
/// # Errors
/// If the device fails.
pub fn sights<'a>(
    glows: &[Vec<usize>],
    (tracer, num): (&dyn Tracer, usize),
    views: impl Iterator<Item = (Camera, &'a str)>,
) -> Result<Vec<Sight>, TraceError> {
    let mut of = vec![None; num];
    for (glow, members) in glows.iter().enumerate() {
        members.iter().for_each(|&i| of[i] = Some(glow));
    }
    let mut seen: Vec<Vec<(f32, f32, &str)>> = vec![Vec::new(); glows.len()];
    for (camera, name) in views {
        let frame = camera.ray_frame();
        let covered = |pixel: usize, features: &Features| {
            let [x, y] = [pixel as u32 % camera.width, pixel as u32 / camera.width];
            area_of_pixel(&frame, [x, y], features)
        };
        let mut sums = vec![(0.0, 0.0); glows.len()];
        for part in tracer.contributions(&camera, &covered)?.1 {
            if let Some(glow) = of[part.gaussian as usize] {
                sums[glow].0 += part.weighted_value;
                sums[glow].1 += part.weight;
            }
        }
        for (seen, (area, num_pixels)) in seen.iter_mut().zip(sums) {
            if num_pixels > 0.0 {
                seen.push((area, num_pixels, name));
            }
        }
    }
    let sight = |seen: Vec<(f32, f32, &str)>| {
        let areas = || seen.iter().map(|(area, ..)| *area);
        let most = areas().fold(0.0, f32::max);
        Sight {
            area: median_of(areas().filter(|area| *area >= WHOLE * most)),
            views: (seen.iter())
                .filter(|(_, num_pixels, _)| *num_pixels >= LEAST_PIXELS)
                .map(|(.., name)| (*name).to_owned())
                .collect(),
        }
    };
    Ok(seen.into_iter().map(sight).collect())
}

/// Area of the surface that a pixel shows, scene units².
fn area_of_pixel(frame: &RayFrame, [x, y]: [u32; 2], features: &Features) -> f32 {
    let through = frame.base + frame.step_x * (x as f32 + 0.5) + frame.step_y * (y as f32 + 0.5);
    let on_plane = frame.step_x.length() * frame.step_y.length();
    let solid_angle = on_plane / through.length().powi(3);
    let cosine = features.unit_normal().dot(through.normalize()).abs();
    solid_angle * features.mean_distance().powi(2) / cosine.max(LEAST_COSINE)
}

/// The surface of some `members` of `gaussians` as a lamp without a name, which sends what these do.
pub fn lamp(gaussians: &Gaussians, members: &[usize], sight: &Sight) -> Lamp {
    let weight = |i: usize| gaussians.opacities[i] * gaussians.scales[i].element_product();
    let total: f32 = members.iter().map(|&i| weight(i)).sum();
    let light = members.iter().map(|&i| weight(i) * gaussians.radiances[i]);
    let radiance = light.sum::<Vec3>() / total;
    let places: Vec<Vec3> = members.iter().map(|&i| gaussians.positions[i]).collect();
    Lamp {
        num_gaussians: members.len(),
        views: sight.views.clone(),
        ..Lamp::unmeasured(LampShape::Other, bounds(&places), (sight.area, radiance))
    }
}

/// Middle, rotation and size of a box of points: along the normal of their plane, and in it the one
/// of the least area.
fn bounds(points: &[Vec3]) -> (Vec3, Quat, Vec3) {
    let plane = FittedPlane::through(points.iter().copied());
    let upright = Quat::from_rotation_arc(Vec3::Z, plane.normal.unwrap_or(Vec3::Z));
    let about = |number: usize| {
        let angle = FRAC_PI_2 * number as f32 / NUM_ANGLES as f32;
        let rotation = upright * Quat::from_rotation_z(angle);
        let to_local = Mat3::from_quat(rotation).transpose();
        let local = points
            .iter()
            .map(|point| to_local * (*point - plane.centre));
        let ends = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let [low, high] = local.fold(ends, |[low, high], p| [low.min(p), high.max(p)]);
        (
            plane.centre + rotation * (0.5 * (low + high)),
            rotation,
            high - low,
        )
    };
    let area = |(_, _, size): &(Vec3, Quat, Vec3)| size.truncate().element_product();
    (0..NUM_ANGLES)
        .map(about)
        .min_by(|a, b| area(a).total_cmp(&area(b)))
        .unwrap_or((plane.centre, upright, Vec3::ZERO))
}
