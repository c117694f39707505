//! Shades: surfaces that shine of the light of a lamp that they are around.

use eagpt_scene::Lamps;
use eagpt_scene::lamps::Lamp;
use glam::Vec3;

/// Lets lamps that masks show reach the `places` of a surface that shines if its box, that of
/// `glow`, is around them: paper about a bulb goes on and off with it. Whether there are any.
pub fn join_as_shade(lamps: &mut Lamps, glow: &Lamp, places: impl Iterator<Item = Vec3>) -> bool {
    let is_within = |lamp: &Lamp| lamp.num_pixels > 0 && glow.distance(lamp.centre()) == 0.0;
    if !lamps.lamps.iter().any(is_within) {
        return false;
    }
    for place in places {
        let Some(nearest) = lamps.nearest(place, is_within) else {
            continue;
        };
        let lamp = &mut lamps.lamps[nearest];
        lamp.reach = lamp.reach.max(lamp.distance(place));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_testkit::lamps::boxed;

    #[test]
    fn a_shade_is_a_part_of_the_lamp_within_it() {
        let shown = |name: &str, x: f32| Lamp {
            num_pixels: 20,
            ..boxed(name, [x, 0.0, 0.0], [0.1; 3])
        };
        let mut lamps = Lamps {
            lamps: vec![
                Lamp {
                    num_pixels: 0,
                    ..boxed("unseen-1", [0.0; 3], [4.0; 3])
                },
                shown("ball-1", 0.1),
                shown("ball-2", 2.0),
            ],
        };
        let glow = |x: f32| boxed("glow-1", [x, 0.0, 0.0], [0.8; 3]);
        let places = |x: f32| [-0.4, 0.4].map(|d| Vec3::new(x + d, 0.0, 0.0)).into_iter();
        assert!(!join_as_shade(&mut lamps, &glow(1.0), places(1.0)));
        assert!(lamps.lamps.iter().all(|lamp| lamp.reach == 0.0));
        assert!(join_as_shade(&mut lamps, &glow(0.0), places(0.0)));
        let reaches: Vec<f32> = lamps.lamps.iter().map(|lamp| lamp.reach).collect();
        assert_eq!([reaches[0], reaches[2]], [0.0; 2]);
        assert!((reaches[1] - 0.45).abs() < 1e-6, "{reaches:?}");
    }
}
