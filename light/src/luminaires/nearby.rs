//! Surfaces near a bulb, which it lights about as much as all else does: they tell of it even if
//! they are few in a large room, or in one full of daylight.

use crate::alike::Residual;

/// Light of a bulb on a surface near it, in that of all else, at least.
const LEAST_RAISED: f64 = 0.5;
/// Surfaces near it, at least.
const LEAST_NEARBY: usize = 12;
/// Part of their loss that a bulb explains, at least, and that which is enough by itself. Measured
/// in eleven rooms: .63 to .87 of 13 bulbs and sets of them, .49 to .77 at three places in a cove
/// with a strip; at most .64 at 14 places of none.
const LEAST: f64 = 0.5;
const ENOUGH: f64 = 0.65;

/// Whether this part of the loss of what is near tells of a bulb, or of none; `None` if the rest of
/// the room has to.
pub(super) fn tells(explained: Option<f64>) -> Option<bool> {
    match explained? {
        part if part >= ENOUGH => Some(true),
        part if part < LEAST => Some(false),
        _ => None,
    }
}

/// The part of their loss that a bulb explains, where receivers get this light of all else and that
/// of the bulb, by the residuals without and with it, all `[receivers]`; `None` if they are few.
pub(super) fn explained(
    (light, of_bulb): (&[f64], impl Iterator<Item = f64>),
    residuals: [&[Residual]; 2],
) -> Option<f64> {
    let is_near = |(i, (light, of_bulb)): (usize, (&f64, f64))| {
        let counts = residuals[0][i].weight > 0.0;
        (counts && of_bulb >= LEAST_RAISED * light).then_some(i)
    };
    let near: Vec<usize> = (light.iter().zip(of_bulb).enumerate())
        .filter_map(is_near)
        .collect();
    let [before, after] = residuals.map(|of| near.iter().map(|i| of[*i].loss()).sum::<f64>());
    (near.len() >= LEAST_NEARBY && before > 0.0).then(|| 1.0 - after / before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alike::Compared;
    use crate::alike::testing::in_cube;
    use eagpt_scene::Gaussians;
    use eagpt_testkit::gaussians::{cube, material};
    use glam::Vec3;

    /// Albedos of the cube, in turns.
    const ALBEDOS: [f64; 3] = [0.48, 0.5, 0.52];
    /// Light of the bulb where it is strongest, in the known light.
    const MOST: f64 = 4.0;

    /// The part explained by a bulb that lights the ceiling of a cube of half edge 1 up to a
    /// distance, if that is what radiances tell, or else by the same light though nothing is lit.
    fn of_spot(radius: f32, is_lit: bool) -> Option<f64> {
        let discs = cube(1.0, 0.1, |_| material(Vec3::ONE, 0.0, Vec3::ONE));
        let light = |at: Vec3| {
            let near = 1.0 - at.distance(Vec3::Z) / radius;
            MOST * f64::from(near.max(0.0))
        };
        let more: Vec<f64> = discs.iter().map(|disc| light(disc.position)).collect();
        let sent = |(i, more): (usize, &f64)| {
            let albedo = ALBEDOS[i % ALBEDOS.len()];
            albedo * (1.0 + if is_lit { *more } else { 0.0 })
        };
        let radiances: Vec<f64> = more.iter().enumerate().map(sent).collect();
        let received = (discs.iter().zip(0..)).map(|(disc, i)| (in_cube(disc, i), Vec3::ONE));
        let received: Vec<_> = received.collect();
        let gaussians: Gaussians = discs.into_iter().collect();
        let compared = Compared::new(&gaussians, &received);
        let num = received.len();
        let known = vec![1.0; num];
        let with: Vec<f64> = more.iter().map(|more| 1.0 + more).collect();
        let segments = compared.segments(&vec![Vec3::ZERO; num]);
        let residuals = [&known, &with].map(|of| compared.residuals(&segments, [&radiances, of]));
        let residuals = residuals.each_ref().map(Vec::as_slice);
        explained((&known, more.into_iter()), residuals)
    }

    #[test]
    fn what_a_bulb_lights_tells_of_it() {
        let lit = of_spot(0.6, true);
        assert!(lit.is_some_and(|part| part > 0.95), "{lit:?}");
        assert_eq!(tells(lit), Some(true));
    }

    #[test]
    fn what_it_would_light_and_is_dark_tells_of_none() {
        let dark = of_spot(0.6, false);
        assert!(dark.is_some_and(|part| part < 0.0), "{dark:?}");
        assert_eq!(tells(dark), Some(false));
    }

    #[test]
    fn few_surfaces_tell_nothing() {
        assert_eq!(of_spot(0.15, true), None);
        assert_eq!(tells(None), None);
    }

    #[test]
    fn a_part_in_between_leaves_it_to_the_room() {
        let told = [0.1, LEAST, ENOUGH].map(|part| tells(Some(part)));
        assert_eq!(told, [Some(false), None, Some(true)]);
    }
}
