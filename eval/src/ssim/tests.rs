use super::*;
use crate::known::KnownPixels;
use crate::window::WEIGHTS;

/// Deterministic values in [0.05, 0.95] with some structure, the second image a disturbed first.
fn pair_of(width: u32, height: u32) -> (Image<3>, Image<3>) {
    let mut reference = Image::filled(width, height, [0.0; 3]);
    let mut test = reference.clone();
    for y in 0..height {
        for x in 0..width {
            let i = (y * width + x) as usize;
            for c in 0..3 {
                let phase = c as f32 * 1.3;
                let wave = (x as f32 * 0.7 + phase).sin() * (y as f32 * 0.45 - phase).cos();
                let hash = ((i * 7919 + c * 104_729) % 1009) as f32 / 1009.0;
                reference.pixels_mut()[i][c] = 0.5 + 0.4 * wave;
                test.pixels_mut()[i][c] = 0.5 + 0.3 * wave + 0.2 * (hash - 0.5);
            }
        }
    }
    (reference, test)
}

/// The definition, in f64, one 11x11 window at a time.
fn plain_ssim(reference: &[[f64; 3]], test: &[[f64; 3]], width: usize, height: usize) -> f64 {
    let radius = RADIUS as i64;
    let mut total = 0.0;
    for c in 0..3 {
        for y in 0..height as i64 {
            for x in 0..width as i64 {
                let [mut mx, mut my, mut xx, mut yy, mut xy] = [0.0; 5];
                for dy in -radius..=radius {
                    for dx in -radius..=radius {
                        let (u, v) = (x + dx, y + dy);
                        if u < 0 || v < 0 || u >= width as i64 || v >= height as i64 {
                            continue;
                        }
                        let i = v as usize * width + u as usize;
                        let w = f64::from(WEIGHTS[dx.unsigned_abs() as usize])
                            * f64::from(WEIGHTS[dy.unsigned_abs() as usize]);
                        let (a, b) = (reference[i][c], test[i][c]);
                        mx += w * a;
                        my += w * b;
                        xx += w * a * a;
                        yy += w * b * b;
                        xy += w * a * b;
                    }
                }
                let (c1, c2) = (0.01 * 0.01, 0.03 * 0.03);
                total += (2.0 * mx * my + c1) * (2.0 * (xy - mx * my) + c2)
                    / ((mx * mx + my * my + c1) * (xx - mx * mx + yy - my * my + c2));
            }
        }
    }
    total / (3 * width * height) as f64
}

fn widened(image: &Image<3>) -> Vec<[f64; 3]> {
    image.pixels().iter().map(|p| p.map(f64::from)).collect()
}

#[test]
fn equal_images_have_similarity_one_and_no_gradient() {
    let (image, _) = pair_of(23, 17);
    assert!((ssim(&image, &image) - 1.0).abs() < 1e-7);
    let found = ssim_with_gradient(&image, &image, None);
    assert!((found.value - 1.0).abs() < 1e-7);
    // Rounding of 1/N-scaled terms near 1e3 that cancel.
    assert!(found.d_test.values().iter().all(|d| d.abs() < 1e-6));
}

#[test]
fn value_is_that_of_the_definition() {
    // Smaller than the window, larger than a band of rows, and a single pixel.
    for (width, height) in [(7, 4), (31, 53), (1, 1), (5, 97)] {
        let (reference, test) = pair_of(width, height);
        let expected = plain_ssim(
            &widened(&reference),
            &widened(&test),
            width as usize,
            height as usize,
        );
        let found = ssim(&reference, &test);
        assert!((found - expected).abs() < 2e-6, "{found} {expected}");
        assert_eq!(found, ssim_with_gradient(&reference, &test, None).value);
        assert!(found < 0.99);
    }
}

#[test]
fn gradient_is_that_of_central_differences() {
    let (width, height) = (14, 51);
    let (reference, test) = pair_of(width, height);
    let d_test = ssim_with_gradient(&reference, &test, None).d_test;
    let (size_x, size_y) = (width as usize, height as usize);
    let reference = widened(&reference);
    let step = 1e-4;
    // Corners, edges, both sides of a band boundary, the middle.
    let checked = [
        0,
        13,
        14,
        47 * 14 + 6,
        48 * 14 + 7,
        25 * 14 + 7,
        50 * 14,
        50 * 14 + 13,
    ];
    let scale = d_test.values().iter().fold(0.0_f32, |a, b| a.max(b.abs()));
    assert!(scale > 1e-5);
    for i in checked {
        for c in 0..3 {
            let mut moved = widened(&test);
            moved[i][c] += step;
            let above = plain_ssim(&reference, &moved, size_x, size_y);
            moved[i][c] -= 2.0 * step;
            let below = plain_ssim(&reference, &moved, size_x, size_y);
            let expected = (above - below) / (2.0 * step);
            let found = f64::from(d_test.pixels()[i][c]);
            assert!(
                (found - expected).abs() < 2e-4 * f64::from(scale),
                "pixel {i} channel {c}: {found} {expected}, largest {scale}"
            );
        }
    }
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    let (reference, test) = pair_of(67, 131);
    let run = |num_threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(num_threads)
            .build()
            .unwrap()
            .install(|| ssim_with_gradient(&reference, &test, None))
    };
    let (one, many) = (run(1), run(5));
    assert_eq!(one.value.to_bits(), many.value.to_bits());
    assert_eq!(one.d_test, many.d_test);
}

#[test]
fn windows_that_do_not_count_take_no_part() {
    let (width, height) = (31, 61);
    let (reference, test) = pair_of(width, height);
    let mut mask = Image::filled(width, height, [1.0]);
    for y in 20..40 {
        for x in 12..31 {
            mask.pixels_mut()[(y * width + x) as usize] = [0.0];
        }
    }
    let known = KnownPixels::new(&mask);
    let windows = known.windows();
    let others = Windows {
        counts: windows.counts.iter().map(|counts| !counts).collect(),
        num: windows.counts.len() - windows.num,
    };
    let [some, rest] =
        [&windows, &others].map(|windows| ssim_with_gradient(&reference, &test, Some(windows)));
    let all = ssim_with_gradient(&reference, &test, None);
    let num = [windows.num, others.num, windows.counts.len()].map(|num| num as f64);
    // The same terms in another order.
    let sum = some.value * num[0] + rest.value * num[1];
    assert!((sum - all.value * num[2]).abs() < 1e-9 * num[2]);
    assert_eq!(some.value, ssim_in(&reference, &test, Some(&windows)));
    let largest = |image: &Image<3>| image.values().iter().fold(0.0_f32, |a, b| a.max(b.abs()));
    let scale = largest(&all.d_test) * num[2] as f32;
    let parts = some.d_test.values().iter().zip(rest.d_test.values());
    for ((some, rest), all) in parts.zip(all.d_test.values()) {
        let sum = some * num[0] as f32 + rest * num[1] as f32;
        assert!((sum - all * num[2] as f32).abs() < 1e-5 * scale);
    }

    // Unknown pixels have no effect and no gradient.
    let garbage = Image::filled(width, height, [0.7, 30.0, 0.0]);
    let other = known.with_reference(&garbage, &reference);
    let again = ssim_with_gradient(&other, &test, Some(&windows));
    assert_eq!(again.value.to_bits(), some.value.to_bits());
    assert_eq!(again.d_test, some.d_test);
    for (index, d) in some.d_test.pixels().iter().enumerate() {
        assert!(known.has(index) || *d == [0.0; 3]);
    }
    let none = KnownPixels::new(&Image::filled(width, height, [0.0])).windows();
    let found = ssim_with_gradient(&reference, &test, Some(&none));
    assert_eq!(found.value, 1.0);
    assert!(found.d_test.values().iter().all(|d| *d == 0.0));
}
