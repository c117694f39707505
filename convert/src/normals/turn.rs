//! Conversion of a map's vectors to world-space normals.

use super::axes::Agreement;
use super::reference::Place;
use super::{Reading, Space};
use eagpt_scene::{Camera, Image};
use glam::{DMat3, DVec3, Vec3};

/// Normals turned away from the camera by more than this, degrees, are unknown.
pub(crate) const MAX_AWAY_DEG: f64 = 25.0;

/// Compares stored vectors with references and with the directions to the camera.
pub(super) fn compare(
    stored: &Image<3>,
    camera: &Camera,
    places: &[Place],
) -> (Agreement, Agreement) {
    let camera_from_world = camera.world_from_camera.matrix3.transpose();
    let rays = camera.ray_frame();
    let width = camera.width as usize;
    let (mut agreement, mut visibility) = (Agreement::NONE, Agreement::NONE);
    let vector = |pixel: usize| Vec3::from(stored.pixels()[pixel]).as_dvec3();
    for place in places {
        let own = vector(place.pixel);
        if own != DVec3::ZERO {
            agreement.add(own, camera_from_world * place.normal, place.normal);
        }
    }
    for pixel in (0..camera.num_pixels()).step_by(7) {
        let own = vector(pixel);
        if own != DVec3::ZERO {
            let (x, y) = ((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
            let back = -rays.direction(x, y).as_dvec3();
            visibility.add(own, camera_from_world * back, back);
        }
    }
    (agreement, visibility)
}

/// World-space normals facing the camera, and the share of known vectors that faced it.
pub(super) fn world_normals(
    stored: &Image<3>,
    camera: &Camera,
    reading: &Reading,
) -> (Image<3>, f64) {
    let axes = reading.axes.matrix();
    let world_from_map = match reading.space {
        Space::World => axes,
        Space::Camera => camera.world_from_camera.matrix3 * axes,
    };
    let rays = camera.ray_frame();
    let width = camera.width as usize;
    let (mut num_known, mut num_facing) = (0_usize, 0_usize);
    let mut normals = stored.clone();
    for (index, pixel) in normals.pixels_mut().iter_mut().enumerate() {
        let vector = Vec3::from(*pixel);
        if vector == Vec3::ZERO {
            continue;
        }
        let (x, y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
        let ray = rays.direction(x, y).as_dvec3();
        num_known += 1;
        let normal = turned_to_camera(world_from_map, vector.as_dvec3(), ray);
        num_facing += usize::from((world_from_map * vector.as_dvec3()).dot(ray) <= 0.0);
        *pixel = normal.as_vec3().to_array();
    }
    (normals, num_facing as f64 / num_known.max(1) as f64)
}

/// A unit normal that a camera can see along `ray`; zero if the vector is turned too far away from
/// it.
fn turned_to_camera(world_from_map: DMat3, vector: DVec3, ray: DVec3) -> DVec3 {
    let normal = (world_from_map * vector).normalize_or_zero();
    let away = normal.dot(ray);
    if away <= 0.0 {
        return normal;
    }
    if away > MAX_AWAY_DEG.to_radians().sin() {
        return DVec3::ZERO;
    }
    (normal - away * ray).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_are_turned_to_the_camera_or_dropped() {
        let ray = DVec3::Z;
        let turn = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            turned_to_camera(DMat3::IDENTITY, DVec3::new(cos, 0.0, sin), ray)
        };
        assert!((turn(-30.0) - DVec3::new(0.75_f64.sqrt(), 0.0, -0.5)).length() < 1e-12);
        assert!((turn(10.0) - DVec3::X).length() < 1e-12);
        assert_eq!(turn(40.0), DVec3::ZERO);
    }
}
