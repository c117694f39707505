//! Properties of every room: bounds of the light, units, seeds.

use super::{inside_view, lit_room, mean_and_error, path, render, render_with};
use eagpt_scene::Gaussians;
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle};
use eagpt_trace::LightOptions;
use eagpt_trace::transport::Sampling;
use glam::{DVec3, Vec3};

/// With white walls and no light but one lamp, nothing is brighter than the lamp, however many
/// bounces there are.
#[test]
fn energy_never_grows() {
    let room = cube(1.0, 0.08, |side| {
        if side == Vec3::Z {
            material(Vec3::ONE, 1.0, Vec3::ONE)
        } else {
            material(Vec3::ONE, 0.0, Vec3::ONE)
        }
    });
    let gaussians: Gaussians = room.into_iter().collect();
    // Cosine sampling, whose samples have no weights: the bound then holds for every pixel.
    let options = LightOptions {
        seed: 4,
        sampling: Sampling::Cosine,
        ..LightOptions::default()
    };
    let image = render_with(&gaussians, &inside_view(), path(16, 40), &options);
    let (mean, _) = mean_and_error(&image);
    assert!(image.pixels().iter().flatten().all(|&v| v <= 1.0 + 1e-4));
    // White walls lose nothing either: with 40 bounces nearly every path finds the lamp.
    assert!(mean > 0.97, "{mean}");
}

/// No length in the code has a unit: a room 128 times as large, or as small, looks the same. Powers
/// of two leave every rounding as it is.
#[test]
fn the_unit_of_length_does_not_matter() {
    let reference = render(&lit_room(1.0), &inside_view(), path(16, 5), 5);
    let (mean, _) = mean_and_error(&reference);
    for scale in [128.0, 1.0 / 128.0] {
        let image = render(&lit_room(scale), &inside_view(), path(16, 5), 5);
        let difference: f32 = image
            .values()
            .iter()
            .zip(reference.values())
            .map(|(a, b)| (a - b).abs())
            .sum::<f32>()
            / reference.values().len() as f32;
        assert!(
            f64::from(difference) < 1e-3 * mean,
            "scale {scale}: {difference} of {mean}"
        );
    }
}

/// Light outside a closed room stays outside, also along its edges and in its corners.
#[test]
fn closed_rooms_do_not_leak() {
    let mut all = cube(1.0, 0.06, |_| material(Vec3::ZERO, 0.0, Vec3::splat(0.8)));
    for side in [Vec3::X, Vec3::NEG_Y, Vec3::Z] {
        let (a, b) = side.any_orthonormal_pair();
        all.extend(rectangle(
            side * 1.6,
            a * 2.0,
            b * 2.0,
            0.1,
            material(Vec3::splat(10.0), 1.0, Vec3::ZERO),
        ));
    }
    let gaussians: Gaussians = all.into_iter().collect();
    let corner = look_at(
        DVec3::new(-0.5, 0.5, -0.5),
        DVec3::new(1.0, -1.0, 1.0),
        24,
        24,
    );
    let (mean, _) = mean_and_error(&render(&gaussians, &corner, path(64, 7), 6));
    // The light through the walls themselves is 1e-4 of the light at each of up to eight hits.
    assert!(mean < 10.0 * 8.0 * 1e-4, "{mean}");
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let room = lit_room(1.0);
    let in_pool = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| render(&room, &inside_view(), path(4, 4), seed))
    };
    let one = in_pool(1, 11);
    assert!(one == in_pool(3, 11));
    assert!(one != in_pool(1, 12));
}
