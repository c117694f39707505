//! The path tracer against closed forms, and its two methods against each other.

use crate::light::coat::Coat;
use crate::light::path::{MAX_BOUNCES, PathSample};
use crate::light::points::Points;
use crate::light::{Cache, CacheOptions, Lighting};
use crate::room::pattern::Texture;
use crate::room::shape::{Ball, Drum, Ends, Quad, Shape};
use crate::room::{Gloss, Hit, Light, MAX_CONDITIONS, Material, Room, Surface};
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::TAU;

const RADIANCE: Vec3 = Vec3::new(8.0, 6.0, 4.0);

fn key(iteration: u32) -> RandomKey {
    RandomKey::new(3, Purpose::Simulate, iteration)
}

/// A room of reflecting shapes of one albedo and emitting ones.
fn room(albedo: Vec3, shapes: &[Shape], emitting: &[Shape]) -> Room {
    let matt = Material {
        texture: Texture::plain(albedo),
        gloss: None,
    };
    let surface = |light: Option<u32>| {
        move |shape: &Shape| Surface {
            shape: *shape,
            material: 0,
            light,
        }
    };
    let surfaces = shapes
        .iter()
        .map(surface(None))
        .chain(emitting.iter().map(surface(Some(0))));
    let mut radiance = [Vec3::ZERO; MAX_CONDITIONS];
    (radiance[0], radiance[1]) = (RADIANCE, 0.5 * RADIANCE);
    let light = Light {
        name: "light".to_owned(),
        radiance,
    };
    Room::new(surfaces.collect(), vec![matt], vec![light], 2)
}

/// The inside of a box from the origin to `size`.
fn walls(size: Vec3) -> [Shape; 6] {
    let wall = |corner: Vec3, a: Vec3, b: Vec3| Shape::Quad(Quad::new(corner, [a, b]));
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * size);
    [
        wall(Vec3::ZERO, x, y),
        wall(y + z, x, -y),
        wall(Vec3::ZERO, z, x),
        wall(y, x, z),
        wall(Vec3::ZERO, y, z),
        wall(x, z, y),
    ]
}

/// Mean irradiance over π at a hit in the first condition; it has to be half as much in
/// the second.
fn irradiance(lighting: &Lighting<'_>, hit: &Hit, max_bounces: u32) -> Vec3 {
    let num = 1 << 14;
    let points = Points::new(key(0), 7);
    let mut total = [Vec3::ZERO; 2];
    for sample in 0..num {
        let path = PathSample {
            sample,
            block: 0,
            max_bounces,
        };
        let light = lighting.irradiance(hit, &points, path);
        total[0] += light[0];
        total[1] += light[1];
    }
    let [first, second] = total.map(|sum| sum / num as f32);
    // The same paths with half the light: single-precision sums of 16,384 terms.
    assert!((first - 2.0 * second).abs().max_element() < 1e-3 * first.max_element());
    first
}

fn floor() -> Shape {
    Shape::Quad(Quad::new(
        Vec3::new(-20.0, -20.0, 0.0),
        [Vec3::X * 40.0, Vec3::Y * 40.0],
    ))
}

fn down(room: &Room) -> Hit {
    room.meet(Vec3::new(0.0, 0.0, 0.1), Vec3::NEG_Z).unwrap()
}

/// Relative tolerance of 16,384 stratified samples of integrands that vary by their own size:
/// √(1/16,384) is 0.8 %, Sobol points do several times better.
const TOLERANCE: f32 = 4e-3;

#[track_caller]
fn assert_close(found: Vec3, wanted: Vec3) {
    let error = (found / wanted - 1.0).abs().max_element();
    assert!(error < TOLERANCE, "{found} is not {wanted}: {error}");
}

#[test]
fn a_rectangle_overhead_has_its_form_factor() {
    let (x, y, height) = (0.7, 0.4, 1.3);
    let light = Quad::new(
        Vec3::new(-x, y, height),
        [Vec3::X * (2.0 * x), Vec3::NEG_Y * (2.0 * y)],
    );
    let room = room(Vec3::splat(0.5), &[floor()], &[Shape::Quad(light)]);
    // Parallel rectangle above a corner (Howell, configuration B-4), four times.
    let corner = |x: f32, y: f32| {
        let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / TAU
    };
    let factor = 4.0 * corner(x / height, y / height);
    let found = irradiance(&Lighting::new(&room), &down(&room), 1);
    assert_close(found, RADIANCE * factor);
}

#[test]
fn a_ball_has_the_square_of_its_sine() {
    for (centre, radius) in [
        (Vec3::new(0.0, 0.0, 2.0), 0.3),
        (Vec3::new(1.5, 0.5, 1.0), 0.4),
        (Vec3::new(0.1, 0.0, 0.6), 0.5),
    ] {
        let ball = Shape::Ball(Ball { centre, radius });
        let room = room(Vec3::splat(0.5), &[floor()], &[ball]);
        // Sphere above the horizon: sin² of its half angle times the cosine of its middle.
        let distance = centre.length();
        let factor = (radius / distance).powi(2) * centre.z / distance;
        let hit = down(&room);
        let found = irradiance(&Lighting::new(&room), &hit, 1);
        assert_close(found, RADIANCE * factor);
    }
}

/// An emitting ball in the middle of a hollow one: by symmetry every point of the wall reflects the
/// same, ρ L F / (1 − ρ (1 − F)) with the share F = (r / R)² of its view that the light takes.
#[test]
fn light_in_a_hollow_ball_is_a_geometric_series() {
    let ball = |radius: f32| {
        Shape::Ball(Ball {
            centre: Vec3::new(0.3, -0.2, 1.0),
            radius,
        })
    };
    for albedo in [0.3_f32, 0.8] {
        let room = room(Vec3::splat(albedo), &[ball(2.0)], &[ball(0.5)]);
        let factor = (0.5_f32 / 2.0).powi(2);
        let wanted = RADIANCE * (factor / (1.0 - albedo * (1.0 - factor)));
        let hit = room.meet(Vec3::new(0.3, -0.2, 2.0), Vec3::X).unwrap();
        let found = irradiance(&Lighting::new(&room), &hit, MAX_BOUNCES);
        assert_close(found, wanted);
        // One bounce is direct light alone, two add its first reflection.
        let one = irradiance(&Lighting::new(&room), &hit, 1);
        assert_close(one, RADIANCE * factor);
        let two = irradiance(&Lighting::new(&room), &hit, 2);
        assert_close(two, RADIANCE * (factor * (1.0 + albedo * (1.0 - factor))));
    }
}

#[test]
fn solved_light_agrees_with_paths() {
    let mut walls = walls(Vec3::new(3.0, 2.0, 2.5)).to_vec();
    walls.push(Shape::Ball(Ball {
        centre: Vec3::new(0.7, 0.6, 0.4),
        radius: 0.4,
    }));
    let lamp = Shape::Ball(Ball {
        centre: Vec3::new(2.0, 1.2, 1.8),
        radius: 0.15,
    });
    let room = room(Vec3::new(0.7, 0.5, 0.3), &walls, &[lamp]);
    let paths = Lighting::new(&room);
    let mut solved = Lighting::new(&room);
    solved.cache = Some(Cache::solve(&solved, key(1), &CacheOptions::default()));
    for direction in [
        Vec3::NEG_Z,
        Vec3::new(0.9, 0.2, 0.1),
        Vec3::new(-0.8, -0.3, -0.5),
        Vec3::new(0.1, 0.9, 0.4),
    ] {
        let hit = room
            .meet(Vec3::new(1.2, 1.0, 1.1), direction.normalize())
            .unwrap();
        let wanted = irradiance(&paths, &hit, MAX_BOUNCES);
        let found = irradiance(&solved, &hit, MAX_BOUNCES);
        // Cells of 10 cm blur the light of the wall close to the lamp, and their 96 rays leave it a
        // percent of noise.
        let error = (found / wanted - 1.0).abs().max_element();
        assert!(error < 0.02, "{found} is not {wanted}: {error}");
    }
}

/// Between a lamp and the ceiling that it hangs a millimetre below it is as bright as in the lamp;
/// a cell that has a part of that place shows the room none of it.
#[test]
fn light_behind_a_lamp_does_not_leak_from_cells() {
    let can = Drum {
        base: Vec3::new(1.02, 0.97, 1.98),
        radii: [0.04; 2],
        height: 0.019,
        axes: Mat3::IDENTITY,
        ends: Ends::Closed,
    };
    let room = room(
        Vec3::splat(0.6),
        &walls(Vec3::splat(2.0)),
        &[Shape::Drum(can)],
    );
    let paths = Lighting::new(&room);
    let mut solved = Lighting::new(&room);
    solved.cache = Some(Cache::solve(&solved, key(1), &CacheOptions::default()));
    let hit = room.meet(Vec3::new(0.5, 0.6, 1.0), Vec3::NEG_Z).unwrap();
    let wanted = irradiance(&paths, &hit, MAX_BOUNCES);
    let found = irradiance(&solved, &hit, MAX_BOUNCES);
    // Of paths and of the light close to the lamp, each some percent of noise.
    let error = (found / wanted - 1.0).abs().max_element();
    assert!(error < 0.04, "{found} is not {wanted}: {error}");
}

/// Facets that reflect everything lose only what goes from one to another, and nearly smooth ones
/// reflect as a mirror does.
#[test]
fn coats_mirror_by_the_law_of_reflection_and_lose_little() {
    let direction = Vec3::new(0.6, 0.0, -0.8);
    let coat = |reflectance: f32, roughness: f32| Gloss {
        reflectance: Vec3::splat(reflectance),
        roughness,
    };
    let points = Points::new(key(1), 3);
    let mean = |gloss: Gloss| {
        let num = 4096;
        let weight = |sample| {
            let [a, b, ..] = points.block(sample, 0);
            let found = Coat::new(direction, Vec3::Z, gloss).sample(Vec2::new(a, b));
            found.map_or(0.0, |(towards, weight)| {
                assert!(towards.z > 0.0 && weight.x <= 1.0 + 1e-5);
                weight.x
            })
        };
        (0..num).map(weight).sum::<f32>() / num as f32
    };
    for (roughness, least) in [(0.05, 0.999), (0.3, 0.98)] {
        let white = mean(coat(1.0, roughness));
        assert!(white > least && white < 1.0 + 1e-4, "{roughness}: {white}");
    }
    // The integral of the lobe over a grid of directions.
    let rough = mean(coat(1.0, 0.6));
    assert!((rough - 0.8044).abs() < 4e-3, "{rough}");
    // Schlick's share at this cosine: 0.05 + 0.95 · 0.2⁵.
    assert!((mean(coat(0.05, 0.05)) - 0.0503).abs() < 5e-4);
    let smooth = Coat::new(direction, Vec3::Z, coat(1.0, 0.03));
    let (towards, _) = smooth.sample(Vec2::new(0.3, 0.7)).unwrap();
    assert!(towards.dot(Vec3::new(0.6, 0.0, 0.8)) > 0.9999);
}

/// The same integral by directions towards the whole hemisphere: what is evaluated is what is
/// sampled, and densities add up to one.
#[test]
fn coats_are_evaluated_as_they_are_sampled() {
    let direction = Vec3::new(0.6, 0.3, -0.74).normalize();
    for roughness in [0.3, 0.6, 0.9] {
        let gloss = Gloss {
            reflectance: Vec3::new(1.0, 0.5, 0.04),
            roughness,
        };
        let coat = Coat::new(direction, Vec3::Z, gloss);
        let points = Points::new(key(2), 4);
        let (num, mut sums) = (1 << 14, [Vec3::ZERO; 2]);
        let (mut density, mut num_up) = (0.0, 0.0);
        for sample in 0..num {
            let [a, b, c, d] = points.block(sample, 0);
            if let Some((towards, weight)) = coat.sample(Vec2::new(a, b)) {
                sums[0] += weight;
                num_up += 1.0;
                let (value, density) = coat.evaluate(towards);
                // Rounding of the half vector, by how fast the sharpest lobe falls.
                assert!((value / density - weight).abs().max_element() < 2e-3);
            }
            let level = (1.0 - c * c).sqrt();
            let (sin, cos) = (TAU * d).sin_cos();
            let found = coat.evaluate(Vec3::new(level * cos, level * sin, c));
            sums[1] += found.0 * TAU;
            density += found.1 * TAU;
        }
        let [sampled, evaluated] = sums.map(|sum| sum / num as f32);
        let error = (sampled - evaluated).abs().max_element();
        assert!(error < 5e-3, "{roughness}: {sampled} is not {evaluated}");
        assert!((density - num_up).abs() < 5e-3 * num as f32, "{roughness}");
    }
}

/// A coat below a small lamp: directions by facets alone, which hardly ever meet it, have the same
/// mean as both kinds together, whose samples scatter far less.
#[test]
fn directions_towards_lights_change_only_the_noise_of_coats() {
    let lamp = Quad::new(Vec3::new(1.1, 0.1, 1.5), [Vec3::X * 0.2, Vec3::NEG_Y * 0.2]);
    let room = room(Vec3::splat(0.5), &[floor()], &[Shape::Quad(lamp)]);
    let lighting = Lighting::new(&room);
    let direction = Vec3::new(0.6, 0.0, -0.8);
    let hit = room.meet(-0.3 * direction, direction).unwrap();
    for roughness in [0.1, 0.4, 0.7] {
        let gloss = Gloss {
            reflectance: Vec3::splat(0.6),
            roughness,
        };
        let coat = Coat::new(direction, hit.normal, gloss);
        let num = 1 << 14;
        // Sum and sum of squares of each: samples of independent sequences.
        let mut sums = [[0.0_f64; 2]; 2];
        for element in 0..num {
            let points = Points::new(key(3), element);
            let [a, b, c, d] = points.block(0, 0);
            let path = PathSample {
                sample: 0,
                block: 2,
                max_bounces: 1,
            };
            let found = coat.sample(Vec2::new(a, b));
            let by_facets = found.map_or(Vec3::ZERO, |(towards, weight)| {
                let next = room.meet(hit.position + hit.normal * 1e-4, towards);
                next.map_or(Vec3::ZERO, |next| {
                    weight * lighting.reflected(&next, &points, path)[0]
                })
            });
            let both = (path, Vec2::new(c, d));
            let by_both = lighting.mirrored(&hit, (direction, gloss), (&points, both))[0];
            for (sums, light) in sums.iter_mut().zip([by_facets, by_both]) {
                sums[0] += f64::from(light.x);
                sums[1] += f64::from(light.x).powi(2);
            }
        }
        let statistics = |[sum, squares]: [f64; 2]| {
            let mean = sum / f64::from(num);
            (mean, squares / f64::from(num) - mean * mean)
        };
        let [(facets, of_facets), (both, of_both)] = sums.map(statistics);
        let error = ((of_facets + of_both) / f64::from(num)).sqrt();
        assert!(
            both > 0.0 && (facets - both).abs() < 3.0 * error,
            "{roughness}: {facets} is not {both}, by {error}"
        );
        let least = if roughness < 0.2 { 1.0 } else { 10.0 };
        assert!(
            of_facets > least * of_both,
            "{roughness}: {of_facets} is not far above {of_both}"
        );
    }
}
