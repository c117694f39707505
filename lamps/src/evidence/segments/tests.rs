#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use super::*;
use eagpt_masks::Mask;
use eagpt_scene::rng::{Purpose, RandomKey};

const PANEL: Vec3 = Vec3::new(9.0, 9.0, 10.0);
const WALL: Vec3 = Vec3::splat(0.5);

/// A picture of what has a radiance at places in pixels, of 8 × 8 points in each, and its lamps.
fn lamps(radiance: impl Fn(f32, f32) -> Vec3, noise: f32) -> Vec<Vec<Region>> {
    let (width, height) = (40, 24);
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let within = |k: u16| (f32::from(k) + 0.5) / 8.0;
            let points =
                (0..64).map(|k| radiance(x as f32 + within(k % 8), y as f32 + within(k / 8)));
            let mean = points.sum::<Vec3>() / 64.0;
            let key = RandomKey::new(3, Purpose::Simulate, 0);
            let [a, b, c, d] = key.stream(y * width + x, 0).next_uniforms();
            // Of variance 1, all but normal.
            let normal = (a + b + c + d - 2.0) * 3.0_f32.sqrt();
            pixels.push((mean * (1.0 + noise * normal)).to_array());
        }
    }
    let image = Image::from_pixels(width, height, pixels).unwrap();
    let lit = Mask::from_fn(width, height, |x, y| {
        Vec3::from(image.get(x, y)).max_element() > 4.0
    });
    let regions = lit.regions();
    regions
        .iter()
        .map(|region| divided(region, &image))
        .collect()
}

fn in_panel(x: f32, y: f32) -> bool {
    (3.3..36.6).contains(&x) && (4.2..19.5).contains(&y)
}

fn ball(at: [f32; 2], radius: f32) -> impl Fn(f32, f32) -> bool {
    move |x, y| (x - at[0]).hypot(y - at[1]) < radius
}

/// Pixels of a region whose middles are where `is_in` says, of all that it has and of all such.
fn overlap(region: &Region, is_in: impl Fn(f32, f32) -> bool) -> f32 {
    let middle = |x: u32, y: u32| is_in(x as f32 + 0.5, y as f32 + 0.5);
    let both = region.pixels.iter().filter(|[x, y]| middle(*x, *y)).count();
    let all = (0..40).flat_map(|x| (0..24).map(move |y| (x, y)));
    let num = all.filter(|(x, y)| middle(*x, *y)).count();
    both as f32 / (num + region.pixels.len() - both) as f32
}

#[test]
fn bulbs_before_a_panel_are_lamps_of_their_own() {
    for (radius, noise) in [(1.2, 0.0), (1.8, 0.02), (3.5, 0.02)] {
        let bulbs = [ball([12.2, 9.7], radius), ball([26.6, 14.4], radius)];
        let all = lamps(
            |x, y| match (bulbs.iter().any(|bulb| bulb(x, y)), in_panel(x, y)) {
                (true, _) => Vec3::new(260.0, 200.0, 120.0),
                (_, true) => PANEL,
                _ => WALL,
            },
            noise,
        );
        let [parts] = all.as_slice() else {
            panic!("{}", all.len())
        };
        assert_eq!(parts.len(), 3, "{radius}");
        for bulb in &bulbs {
            let best = parts
                .iter()
                .map(|part| overlap(part, bulb))
                .fold(0.0, f32::max);
            assert!(best > 0.55, "{radius}: {best}");
        }
        let only_panel = |x, y| in_panel(x, y) && !bulbs.iter().any(|bulb| bulb(x, y));
        assert!(overlap(&parts[0], only_panel) > 0.9);
    }
}

#[test]
fn colours_side_by_side_are_two_lamps() {
    // Their border crosses the rows of pixels slowly.
    let is_warm = |x: f32, y: f32| x < 20.0 + 0.08 * y;
    let (warm, cool) = (Vec3::new(15.0, 8.0, 4.0), Vec3::new(6.0, 10.0, 16.0));
    let all = lamps(
        |x, y| match (in_panel(x, y), is_warm(x, y)) {
            (true, true) => warm,
            (true, false) => cool,
            _ => WALL,
        },
        0.01,
    );
    let [parts] = all.as_slice() else {
        panic!("{}", all.len())
    };
    assert_eq!(parts.len(), 2);
    let of =
        |part: &Region, warm: bool| overlap(part, |x, y| in_panel(x, y) && is_warm(x, y) == warm);
    let [warm, cool] = [of(&parts[0], true), of(&parts[1], false)];
    assert!(warm > 0.9 && cool > 0.9, "{warm} {cool}");
}

#[test]
fn a_lamp_is_one_whatever_its_border_shade_or_view() {
    let shaded = |x: f32, _: f32| PANEL * (1.0 + 0.05 * x);
    let view = |x: f32, y: f32| {
        let key = RandomKey::new(5, Purpose::Simulate, 0);
        let [grain, ..] = key.stream(y as u32 * 40 + x as u32, 0).next_uniforms();
        PANEL
            * if y < 11.0 {
                4.0 + 0.02 * grain
            } else {
                0.6 + 2.0 * grain
            }
    };
    // A window, and a blind before it that lets some light through.
    let blind = |_: f32, y: f32| PANEL * if y < 9.0 { 0.55 } else { 1.0 };
    let plain = |_: f32, _: f32| PANEL;
    let radiances: [&dyn Fn(f32, f32) -> Vec3; 4] = [&plain, &shaded, &view, &blind];
    for (k, radiance) in radiances.into_iter().enumerate() {
        let tilted = |x: f32, y: f32| in_panel(x + 0.3 * y - 4.0, y + 0.1 * x);
        let all = lamps(
            |x, y| if tilted(x, y) { radiance(x, y) } else { WALL },
            0.01,
        );
        assert_eq!(all.iter().map(Vec::len).collect::<Vec<_>>(), [1], "{k}");
    }
    // A few pixels, none of which the lamp fills.
    let small = ball([20.3, 11.8], 1.3);
    let all = lamps(|x, y| if small(x, y) { PANEL * 8.0 } else { WALL }, 0.0);
    assert_eq!(all.iter().map(Vec::len).collect::<Vec<_>>(), [1]);
}
