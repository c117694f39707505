//! Parts of fixtures that shine with a lamp though they are not of its shape.
//!
//! A socket of metal beside a bulb, or the paper around it, is as bright as lamps are, emits, and is
//! in no lamp's box: it would shine on with the lamp off. Its light is that of the nearest lamp.

use eagpt_scene::color::luminance;
use eagpt_scene::lamps::emits;
use eagpt_scene::{Gaussians, Lamps};
use std::f32::consts::PI;

/// Irradiance over π of a part by its lamp, in the radiance of the part, at least: metal shows a
/// lamp brighter than white would be.
const LEAST_LIGHT: f32 = 0.02;
/// Part of what a part sees that its lamp covers, at least.
const LEAST_SHARE: f32 = 0.04;

/// Lets each lamp reach what of `scene` emits, belongs to none, and is nearer to it than to others.
/// Parts that it does not light are left.
pub fn reach(lamps: &mut Lamps, scene: &Gaussians) {
    let mut reaches: Vec<f32> = lamps.lamps.iter().map(|lamp| lamp.reach).collect();
    for (i, position) in scene.positions.iter().enumerate() {
        if !emits(scene.emissions[i]) || lamps.of(*position).is_some() {
            continue;
        }
        let Some(index) = lamps.nearest(*position, |_| true) else {
            continue;
        };
        let lamp = &lamps.lamps[index];
        let distance = lamp.distance(*position);
        let share = (lamp.area / (PI * distance.powi(2))).min(1.0);
        let light = share * luminance(lamp.radiance);
        let own = luminance(scene.radiances[i].to_array());
        if share >= LEAST_SHARE && light >= LEAST_LIGHT * own {
            reaches[index] = reaches[index].max(distance);
        }
    }
    for (lamp, reach) in lamps.lamps.iter_mut().zip(reaches) {
        lamp.reach = reach;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Lamp, LampShape};
    use eagpt_testkit::gaussians::{material, sphere};
    use eagpt_testkit::lamps::boxed;
    use glam::Vec3;

    #[test]
    fn what_a_lamp_lights_goes_on_and_off_with_it() {
        let lamp = |name: &str, at: Vec3, area: f32| Lamp {
            shape: LampShape::Ball,
            area,
            radiance: [100.0; 3],
            ..boxed(name, at.to_array(), [0.1; 3])
        };
        let socket = Vec3::new(0.25, 0.0, 0.0);
        // 0.2 from the box of one lamp.
        let with = |[area, second]: [f32; 2], radiance: f32| {
            let light = material(Vec3::splat(radiance), 1.0, Vec3::ZERO);
            let mut scene = sphere(2, 0.01, |_| light);
            scene.positions.fill(socket);
            let mut lamps = Lamps {
                lamps: vec![
                    lamp("ball-1", Vec3::ZERO, area),
                    lamp("ball-2", Vec3::new(second, 0.0, 0.0), area),
                ],
            };
            assert_eq!(lamps.of(socket), None);
            reach(&mut lamps, &scene);
            (lamps.of(socket), lamps.lamps[0].reach)
        };
        let (of, reach) = with([0.03, 0.6], 40.0);
        assert_eq!(of, Some(0));
        assert!((reach - 0.2).abs() < 1e-6, "{reach}");
        assert_eq!(with([0.03, 0.45], 40.0), (Some(1), 0.0));
        // The lamp covers .24 of the view, or .03 where it is as small as that.
        assert_eq!(with([0.03, 0.6], 1190.0).0, Some(0));
        assert_eq!(with([0.03, 0.6], 1200.0).0, None);
        assert_eq!(with([0.004, 0.6], 1.0).0, None);
    }
}
