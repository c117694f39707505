//! Parts of lamps that masks leave out, and lit surfaces that they mark.
//!
//! A surface reflects no more than the light it receives. What is brighter is lit from within or
//! from behind, as blinds and shades that light shines through, or edges of panes: an albedo cannot
//! explain it, and its light would be missing in every room that is lit by its lamp. It counts as a
//! part of the lamp that it is near, and is selected with it.
//!
//! A surface that is no brighter than a white one may reflect: the sill of a window is as bright as
//! other lamps, and would be black once the window is off. It emits no more.

mod fixtures;

pub use fixtures::reach;

use crate::irradiance;
use crate::surfaces;
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::emits;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, Lamp, Lamps};
use eagpt_trace::{Device, TraceError};
use glam::Vec3;

/// Radiance over that of a white surface from which on a Gaussian emits; above what noise of the
/// irradiance and a gloss make of white.
const EXCESS: f32 = 1.5;
/// Least radiance over that of its lamp: what is dimmer than this gives the room no light.
const MIN_SHARE: f32 = 0.05;

/// The Gaussians of `scene` that are parts of `lamps` though they do not emit, and those among the
/// first `num_moving`, which are not of clean lamps, that emit though they may reflect; ascending,
/// with whether they are to emit. The irradiance of what `cameras` see of them is gathered in
/// `num_samples` directions.
///
/// # Errors
/// If the device fails.
pub fn luminous(
    device: &Device,
    (scene, num_moving): (&Gaussians, usize),
    lamps: &Lamps,
    cameras: &[Camera],
    (num_samples, key): (u32, RandomKey),
) -> Result<Vec<(usize, bool)>, TraceError> {
    let light = |i: usize| luminance(scene.radiances[i].to_array());
    let may_be = |i: usize| {
        if emits(scene.emissions[i]) {
            return i < num_moving;
        }
        let position = scene.positions[i];
        let lamp = lamps.of(position).map(|lamp| &lamps.lamps[lamp]);
        lamp.is_some_and(|lamp| {
            !is_mount(lamp, position) && light(i) >= MIN_SHARE * luminance(lamp.radiance)
        })
    };
    if !(0..scene.len()).any(may_be) {
        return Ok(Vec::new());
    }
    let tracer = device.scene(scene)?;
    let seen = surfaces::best_seen(&*tracer, scene.len(), cameras)?;
    let mut receivers = surfaces::receivers(&seen);
    receivers.retain(|(i, _)| may_be(*i as usize));
    let white = irradiance::received(&*tracer, &receivers, &scene.radiances, (num_samples, key))?;
    let receivers = receivers.iter().map(|(i, _)| *i as usize);
    let white = white.into_iter().map(|white| luminance(white.to_array()));
    Ok(receivers
        .zip(white)
        .map(|(i, white)| (i, light(i) > EXCESS * white))
        .filter(|(i, is_lamp)| *is_lamp != emits(scene.emissions[*i]))
        .collect())
}

/// Whether what is at `position` (world space) may be what a flat lamp is mounted on: it does not
/// light that, which is bright where pixels show the lamp's edge.
fn is_mount(lamp: &Lamp, position: Vec3) -> bool {
    let is_bare = lamp.one_sided && !lamp.bars && lamp.shade == 0.0;
    let normal = lamp.world_from_lamp() * Vec3::Z;
    is_bare && (position - lamp.centre()).dot(normal) <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::LampShape;
    use eagpt_scene::rng::Purpose;
    use eagpt_testkit::gaussians::{look_at, material, sphere};
    use eagpt_testkit::lamps::boxed;
    use glam::DVec3;
    use std::f32::consts::FRAC_1_SQRT_2;

    fn lamp_at(centre: Vec3, size: f32, radiance: f32) -> Lamps {
        let lamp = eagpt_scene::Lamp {
            shape: LampShape::Ball,
            radiance: [radiance; 3],
            ..boxed("ball-1", centre.to_array(), [size; 3])
        };
        Lamps { lamps: vec![lamp] }
    }

    fn marked(scene: (&Gaussians, usize), lamps: &Lamps, cameras: &[Camera]) -> Vec<(usize, bool)> {
        let key = RandomKey::new(1, Purpose::Albedo, 1);
        luminous(&Device::Cpu, scene, lamps, cameras, (256, key)).unwrap()
    }

    /// Inside a sphere of radiance 1 all surfaces receive what makes white ones reflect 1.
    #[test]
    fn what_is_brighter_than_white_near_a_lamp_emits_and_nothing_else() {
        let light = |towards: Vec3| match towards {
            t if t.x.abs() > 0.94 && t.y > 0.0 => 2.0,
            t if t.x.abs() > 0.94 => 1.2,
            _ => 1.0,
        };
        let grey = |towards: Vec3| material(Vec3::splat(light(towards)), 0.0, Vec3::splat(0.5));
        let scene = sphere(3000, 1.0, grey);
        let cameras: Vec<_> = [DVec3::X, -DVec3::X]
            .map(|target| look_at(DVec3::ZERO, target, 160, 160))
            .to_vec();
        let found = |lamps: &Lamps| marked((&scene, scene.len()), lamps, &cameras);
        let lamps = lamp_at(Vec3::X, 0.4, 10.0);
        let all: Vec<(usize, bool)> = (0..scene.len())
            .filter(|&i| {
                lamps.of(scene.positions[i]).is_some() && scene.radiances[i] == Vec3::splat(2.0)
            })
            .map(|i| (i, true))
            .collect();
        assert!(all.len() > 10);
        assert_eq!(found(&lamps), all);
        // Beside a lamp that is far brighter it is nothing.
        assert!(found(&lamp_at(Vec3::X, 0.4, 41.0)).is_empty());
        assert!(found(&Lamps::default()).is_empty());
    }

    /// A flat lamp that shines towards −x lights nothing behind it, where there are no bars.
    #[test]
    fn what_a_flat_lamp_is_mounted_on_does_not_emit() {
        let light = |towards: Vec3| if towards.x > 0.94 { 2.0 } else { 1.0 };
        let grey = |towards: Vec3| material(Vec3::splat(light(towards)), 0.0, Vec3::splat(0.5));
        let scene = sphere(3000, 1.0, grey);
        let cameras = [look_at(DVec3::ZERO, DVec3::X, 160, 160)];
        let num_found = |change: &dyn Fn(&mut Lamp)| {
            let mut lamps = lamp_at(0.9 * Vec3::X, 0.4, 10.0);
            let [w, x, y, z] = [FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2, 0.0];
            lamps.lamps[0].rotation = [w, x, y, z];
            lamps.lamps[0].one_sided = true;
            change(&mut lamps.lamps[0]);
            marked((&scene, scene.len()), &lamps, &cameras).len()
        };
        assert_eq!(num_found(&|_| ()), 0);
        assert!(num_found(&|lamp| lamp.bars = true) > 10);
        assert!(num_found(&|lamp| lamp.one_sided = false) > 10);
        assert!(num_found(&|lamp| lamp.centre[0] = 1.1) > 10);
    }

    /// Of what emits, what is dimmer than white would be reflects, but for clean lamps.
    #[test]
    fn what_may_reflect_does_not_emit() {
        let of = |towards: Vec3| match towards {
            t if t.x > 0.94 => (0.6, 1.0),
            t if t.x < -0.94 => (2.0, 1.0),
            _ => (1.0, 0.0),
        };
        let scene = sphere(3000, 1.0, |towards| {
            let (light, emission) = of(towards);
            material(Vec3::splat(light), emission, Vec3::splat(0.5))
        });
        let cameras = [DVec3::X, -DVec3::X].map(|to| look_at(DVec3::ZERO, to, 160, 160));
        let found = |num_moving: usize| marked((&scene, num_moving), &Lamps::default(), &cameras);
        let dim: Vec<(usize, bool)> = (0..scene.len())
            .filter(|&i| scene.radiances[i] == Vec3::splat(0.6))
            .map(|i| (i, false))
            .collect();
        assert!(dim.len() > 10);
        assert_eq!(found(scene.len()), dim);
        assert!(found(dim[0].0).is_empty());
    }
}
