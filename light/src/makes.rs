//! Lamps of one make, as the two sconces of a wall: what hides them hides as much of each.

use eagpt_scene::Lamp;
use glam::Vec3;

/// Lamps of one make are at most this many times as long and as wide as each other, …
const LARGER: f32 = 1.1;
/// … and the cosines of what they face to the upward direction differ by at most this.
const TILTED: f32 = 0.05;

/// `lamps` by their make, those of one make together, by their shape, their size and the angle at
/// which they face `up`, the unit vector upwards.
pub fn of_one_make(lamps: &[&Lamp], up: Vec3) -> Vec<Vec<usize>> {
    let tilt = |lamp: &Lamp| (lamp.world_from_lamp() * Vec3::Z).dot(up);
    let is_like = |a: &Lamp, b: &Lamp| {
        let mut sizes = a.size.iter().zip(&b.size);
        let is_as_large = sizes.all(|(a, b)| a.max(*b) <= LARGER * a.min(*b));
        let is_alike = a.shape == b.shape && a.one_sided == b.one_sided;
        is_alike && is_as_large && (tilt(a) - tilt(b)).abs() <= TILTED
    };
    let mut makes: Vec<Vec<usize>> = Vec::new();
    for (i, lamp) in lamps.iter().enumerate() {
        match makes.iter_mut().find(|make| is_like(lamps[make[0]], lamp)) {
            Some(make) => make.push(i),
            None => makes.push(vec![i]),
        }
    }
    makes
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::LampShape;
    use glam::Quat;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn lamps_of_one_size_that_face_one_way_are_of_one_make() {
        let panel = |width: f32, rotation: Quat| {
            let frame = (Vec3::X, rotation, Vec3::new(width, 0.2, 0.0));
            Lamp::unmeasured(LampShape::Panel, frame, (0.02, Vec3::ONE))
        };
        let (upright, level) = (Quat::from_rotation_x(FRAC_PI_2), Quat::IDENTITY);
        let turned = Quat::from_rotation_z(1.0) * upright;
        let lamps = [
            panel(0.1, upright),
            panel(0.1, level),
            panel(0.102, turned),
            panel(0.12, upright),
        ];
        let makes = of_one_make(&lamps.each_ref(), Vec3::Z);
        assert_eq!(makes, [vec![0, 2], vec![1], vec![3]]);
    }
}
