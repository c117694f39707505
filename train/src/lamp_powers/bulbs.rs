//! Bulbs in shades of which views show one opening.
//!
//! A lampshade is open at both ends, and cameras look into one of them, as into the upper one of a
//! floor lamp, which is a flat lamp to them that sends more than they see. The light that leaves the
//! other one is missing, and the wall beside it would have to reflect more than the rest of it. So a
//! bulb is tried in the shade, on the axis of the opening: as strong as what it lights tells, past
//! the shade that is there.

use super::{Light, MOST_FACTOR, WEIGHT, direct, luminances, rows};
use crate::alike::{Compared, Expected};
use crate::bake::emits;
use crate::error::Result;
use crate::hidden_lamps::HiddenLamps;
use eagpt_scene::color::luminance;
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::light_basis::NO_LIGHT;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Gaussians, Gloss, Lamp, LampShape, LightGroups};
use eagpt_trace::Device;
use eagpt_trace::transport::matrix::Receiver;
use glam::{Quat, Vec3};
use std::f32::consts::PI;

/// Depth of a bulb below the opening, and its radius, in mean widths of the opening.
const DEPTH: f32 = 0.4;
const RADIUS: f32 = 0.05;
/// Power over that of the opening, at least, for it to be there.
const LEAST_POWER: f32 = 0.3;
/// Part of their known light that a bulb as strong as its opening brings receivers that tell of it,
/// at least, and their number, at least.
const TELLING: f64 = 0.2;
const LEAST_TELLING: usize = 30;

/// A bulb.
struct Bulb {
    /// It as a lamp, without a name.
    lamp: Lamp,
    /// Its discs.
    discs: Gaussians,
}

impl Bulb {
    /// One behind a flat lamp that sends this multiple of its power.
    fn behind(opening: &Lamp, factor: f32) -> Self {
        let width = 0.5 * (opening.size[0] + opening.size[1]);
        let radius = RADIUS * width;
        let normal = opening.world_from_lamp() * Vec3::Z;
        let centre = opening.centre() - DEPTH * width * normal;
        let area = 4.0 * PI * radius * radius;
        let radiance = factor * Vec3::from(opening.power) / (PI * area);
        let solid = Solid::Ball { centre, radius };
        let discs = surface(solid, Some(radiance)).discs();
        let frame = (centre, Quat::IDENTITY, Vec3::splat(2.0 * radius));
        Self {
            lamp: Lamp {
                num_gaussians: discs.len(),
                ..Lamp::unmeasured(LampShape::Ball, frame, (area, radiance))
            },
            discs,
        }
    }
}

/// A black surface that emits this radiance.
fn surface(solid: Solid, radiance: Option<Vec3>) -> Surface {
    Surface {
        solid,
        material: Material {
            albedo: Vec3::ZERO,
            radiance,
            gloss: Gloss::NONE,
        },
        spacing: None,
    }
}

/// The bulbs behind those of `lamps` that are openings of shades, in the scene of `gaussians`;
/// `received` is the light that these get of all that is known.
///
/// # Errors
/// If the device fails.
pub(crate) fn find(
    (device, gaussians): (&Device, &Gaussians),
    lamps: &[Lamp],
    received: &[(Receiver, Vec3)],
    key: RandomKey,
) -> Result<HiddenLamps> {
    let openings: Vec<&Lamp> = lamps.iter().filter(|lamp| is_opening(lamp)).collect();
    let bulbs: Vec<Bulb> = openings
        .iter()
        .map(|lamp| Bulb::behind(lamp, 1.0))
        .collect();
    let num = bulbs.len();
    if num == 0 {
        return Ok(HiddenLamps::default());
    }
    let compared = Compared::new(gaussians, received);
    // All that emits already is one more light.
    let emissions = gaussians.emissions.iter();
    let rest = |emission: &f32| {
        if emits(*emission) {
            num as u32
        } else {
            NO_LIGHT
        }
    };
    let mut of: Vec<u32> = emissions.map(rest).collect();
    for (light, bulb) in (0..).zip(&bulbs) {
        of.extend(std::iter::repeat_n(light, bulb.discs.len()));
    }
    let names = vec![String::new(); num + 1];
    let lights = LightGroups { names, of };
    let discs = bulbs.iter().flat_map(|bulb| bulb.discs.iter());
    let scene: Gaussians = gaussians.iter().chain(discs).collect();
    let tracer = device.scene(&scene)?;
    let direct = direct((&*tracer, &scene), &lights, &compared, key)?;
    let direct: Vec<Vec3> = (direct.chunks(num + 1))
        .flat_map(|parts| parts[..num].iter().copied())
        .collect();
    let known = luminances(&compared.known);
    let rows = rows(&direct, num, &known);
    let mut telling = vec![0; num];
    for (row, known) in rows.iter().zip(&known) {
        for (bulb, _) in row.iter().filter(|(_, part)| *part >= TELLING * known) {
            telling[*bulb] += 1;
        }
    }
    let expected = telling.iter().enumerate().map(|(bulb, num)| {
        let is_free = *num >= LEAST_TELLING;
        let expected = Expected {
            radiance: 0.0,
            bounds: [0.0, if is_free { MOST_FACTOR } else { 0.0 }],
            weight: WEIGHT,
        };
        (bulb, expected)
    });
    let light = Light {
        direct: &direct,
        rows: &rows,
        known: &known,
    };
    let factors = light.fit(&compared, &expected.collect());
    let found = openings.into_iter().zip(factors);
    let there = found.filter(|(_, factor)| *factor >= LEAST_POWER);
    let bulbs: Vec<Bulb> = there
        .map(|(lamp, factor)| Bulb::behind(lamp, factor))
        .collect();
    Ok(HiddenLamps {
        discs: bulbs.iter().flat_map(|bulb| bulb.discs.iter()).collect(),
        lamps: bulbs.into_iter().map(|bulb| bulb.lamp).collect(),
    })
}

/// Whether a lamp is flat and sends more than views see.
fn is_opening(lamp: &Lamp) -> bool {
    lamp.shape == LampShape::Panel && lamp.one_sided && luminance(lamp.factor) > 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alike::testing::in_cube;
    use crate::irradiance;
    use eagpt_scene::rng::Purpose;
    use eagpt_testkit::gaussians::{cube, material};
    use eagpt_testkit::lamps::boxed;

    const ALBEDO: f32 = 0.6;
    /// Middle of a shade of these edge lengths.
    const SHADE: (Vec3, [f32; 2]) = (Vec3::new(0.5, 0.0, -0.4), [0.4, 0.3]);

    fn key(number: u32) -> RandomKey {
        RandomKey::new(5, Purpose::Albedo, number)
    }

    /// A black flat surface.
    fn wall(centre: Vec3, edges: [Vec3; 2]) -> Gaussians {
        let wall = Surface {
            spacing: Some(0.02),
            ..surface(Solid::Quad { centre, edges }, None)
        };
        wall.discs()
    }

    /// A white cube of half edge 1, in which a shade stands that is closed above and open below.
    fn room() -> Vec<eagpt_scene::Gaussian> {
        let (centre, [width, height]) = SHADE;
        let half = 0.5 * width;
        let sides = [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y].map(|out| {
            let along = width * Vec3::new(-out.y, out.x, 0.0);
            wall(centre + half * out, [along, height * Vec3::Z])
        });
        let top = centre + 0.5 * height * Vec3::Z;
        let top = wall(top, [width * Vec3::X, width * Vec3::Y]);
        let mut discs = cube(1.0, 0.08, |_| material(Vec3::ZERO, 0.0, Vec3::ONE));
        discs.extend(sides.iter().chain([&top]).flat_map(Gaussians::iter));
        discs
    }

    /// The upper opening of the shade as a lamp of this factor and of power 1.
    fn opening(factor: f32) -> Lamp {
        let (centre, [width, height]) = SHADE;
        let above = centre + 0.5 * height * Vec3::Z;
        Lamp {
            shape: LampShape::Panel,
            one_sided: true,
            power: [1.0; 3],
            factor: [factor; 3],
            ..boxed("panel-1", above.to_array(), [width, width, 0.0])
        }
    }

    /// Powers of the bulbs found behind an opening of this factor where one of this power is.
    fn powers(factor: f32, power: f32) -> Vec<f32> {
        let mut gaussians: Gaussians = room().into_iter().collect();
        let num_walls = cube(1.0, 0.08, |_| material(Vec3::ZERO, 0.0, Vec3::ONE)).len();
        let receivers: Vec<Receiver> = (gaussians.iter().zip(0..))
            .take(num_walls)
            .map(|(disc, i)| in_cube(&disc, i))
            .collect();
        let bulb = Bulb::behind(&opening(factor), power);
        let lit: Gaussians = gaussians.iter().chain(bulb.discs.iter()).collect();
        let tracer = Device::Cpu.scene(&lit).unwrap();
        let dark = vec![Vec3::ZERO; lit.len()];
        let direct = irradiance::received(&*tracer, &receivers, &dark, (512, key(1))).unwrap();
        let mut received = Vec::new();
        for (receiver, direct) in receivers.into_iter().zip(direct) {
            let known = Vec3::splat(0.05 + 0.02 * receiver.1.position.y);
            gaussians.radiances[receiver.0 as usize] = ALBEDO * (known + direct);
            received.push((receiver, known));
        }
        let scene = (&Device::Cpu, &gaussians);
        let found = find(scene, &[opening(factor)], &received, key(2)).unwrap();
        found.lamps.iter().map(|lamp| lamp.power[0]).collect()
    }

    #[test]
    fn what_a_shade_lights_tells_of_its_bulb() {
        for power in [1.0, 2.5] {
            let [found] = powers(2.0, power)[..] else {
                panic!("one bulb")
            };
            // The weight on light takes little, noise of the light of single receivers the rest.
            assert!((found / power - 1.0).abs() < 0.1, "{found} {power}");
        }
        assert!(powers(2.0, 0.0).is_empty());
        // All that a lamp sends is what views see of it.
        assert!(powers(1.0, 2.5).is_empty());
    }
}
