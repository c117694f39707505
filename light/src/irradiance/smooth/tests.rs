use super::*;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_trace::transport::start::Surface;

const SIDE: u32 = 40;

/// Two walls that meet at a right angle, and a table top below which the first goes on.
fn receivers() -> Vec<Receiver> {
    let wall = |num: u32, normal: Vec3, place: fn(f32, f32) -> Vec3| {
        (0..SIDE * SIDE).map(move |i| {
            let along = |i: u32| (i as f32 + 0.5) / SIDE as f32;
            let surface = Surface {
                position: place(along(i % SIDE), along(i / SIDE)),
                normal,
                offset: 0.01,
            };
            (num * SIDE * SIDE + i, surface)
        })
    };
    wall(0, Vec3::Z, |x, y| Vec3::new(x, y, 0.0))
        .chain(wall(1, Vec3::X, |y, z| Vec3::new(0.0, y, z)))
        .chain(wall(2, Vec3::Z, |x, y| Vec3::new(x, y, 0.06)))
        .collect()
}

/// Noise about `light`, of standard deviation `deviation`.
fn noisy(light: impl Fn(u32) -> f32, deviation: f32) -> Vec<Vec3> {
    let key = RandomKey::new(4, Purpose::Initialise, 0);
    (0..3 * SIDE * SIDE)
        .map(|i| {
            let uniform = key.stream(i, 0).next_uniforms();
            let sum: f32 = uniform.iter().map(|u| u - 0.5).sum();
            // Four uniform numbers: the variance of their sum is a third.
            Vec3::splat(light(i) + deviation * sum * 3.0_f32.sqrt())
        })
        .collect()
}

fn rms(of: &[Vec3], light: impl Fn(u32) -> f32) -> f32 {
    let off = (0..).zip(of).map(|(i, l)| (l.x - light(i)).powi(2));
    (off.sum::<f32>() / of.len() as f32).sqrt()
}

/// Each surface with a light of its own, the first with the edge of a shadow: noise goes, surfaces
/// and shadow stay, and so does the sum.
#[test]
fn noise_goes_and_shadows_stay() {
    let light = |i: u32| match i / (SIDE * SIDE) {
        0 if i % SIDE < SIDE / 2 => 1.0,
        0 => 3.0,
        1 => 2.0,
        _ => 6.0,
    };
    let deviation = 0.2;
    let before = noisy(light, deviation);
    let variances = vec![deviation * deviation; before.len()];
    let after = Smoothing::new(&receivers()).apply(&before, &variances);
    // Twenty or so neighbours that count, fewer along borders, leave less than half of the noise.
    assert!((rms(&before, light) / deviation - 1.0).abs() < 0.05);
    assert!(
        rms(&after, light) < 0.45 * deviation,
        "{}",
        rms(&after, light)
    );
    let sum = |of: &[Vec3]| of.iter().map(|l| f64::from(l.x)).sum::<f64>();
    assert!((sum(&after) / sum(&before) - 1.0).abs() < 1e-5);
}

#[test]
fn light_without_noise_stays() {
    let exact = noisy(|i| 1.0 + (i % 7) as f32, 0.0);
    let smoothing = Smoothing::new(&receivers());
    assert_eq!(smoothing.apply(&exact, &vec![0.0; exact.len()]), exact);
    assert_eq!(Smoothing::new(&[]).apply(&[], &[]), Vec::new());
}

/// Parts are smoothed by the weights of their sum: they add up to it, and one that is the same
/// share of all light stays so.
#[test]
fn parts_are_smoothed_as_their_sum() {
    let before = noisy(|i| 1.0 + (i % SIDE) as f32 / SIDE as f32, 0.2);
    let variances = vec![0.04; before.len()];
    let parts: Vec<Vec3> = (0..)
        .zip(&before)
        .flat_map(|(i, all)| {
            let some = *all * (0.5 + 0.5 * (i as f32).sin());
            [some, 0.25 * *all, 0.75 * *all - some]
        })
        .collect();
    let smoothing = Smoothing::new(&receivers());
    let whole = smoothing.apply(&before, &variances);
    let smoothed = smoothing.apply_to_parts(&before, &variances, &parts, 3);
    assert_ne!(whole, before);
    for (row, all) in smoothed.chunks_exact(3).zip(&whole) {
        let sum: Vec3 = row.iter().sum();
        assert!((sum - *all).abs().max_element() < 1e-5, "{sum} {all}");
        assert!((row[1] - 0.25 * *all).abs().max_element() < 1e-6);
    }
    let twice: Vec<Vec3> = parts.iter().map(|part| 2.0 * *part).collect();
    let double: Vec<Vec3> = smoothed.iter().map(|part| 2.0 * *part).collect();
    assert_eq!(
        smoothing.apply_to_parts(&before, &variances, &twice, 3),
        double
    );
}
