use super::*;

/// A lit wall with a lamp, and the same disturbed.
fn pair_of(width: u32, height: u32) -> (Image<3>, Image<3>) {
    let mut reference = Image::filled(width, height, [0.0; 3]);
    let mut test = reference.clone();
    for y in 0..height {
        for x in 0..width {
            let i = (y * width + x) as usize;
            let lamp = if x / 7 == 2 && y / 5 == 1 { 20.0 } else { 0.0 };
            for c in 0..3 {
                let wave = (x as f32 * 0.4 + c as f32).sin() * (y as f32 * 0.3).cos();
                let hash = ((i * 7919 + c * 104_729) % 1009) as f32 / 1009.0;
                reference.pixels_mut()[i][c] = 0.3 + 0.2 * wave + lamp;
                test.pixels_mut()[i][c] = 0.3 + 0.2 * wave + 0.1 * hash + lamp;
            }
        }
    }
    (reference, test)
}

#[test]
fn equal_images_have_no_error_and_no_error_is_outside_0_to_1() {
    let (reference, test) = pair_of(37, 29);
    let options = FlipOptions::default();
    let equal = flip_hdr(&reference, &reference, &options).unwrap();
    assert_eq!(equal.mean, 0.0);
    assert!(equal.error.values().iter().all(|e| *e == 0.0));
    assert_eq!(flip_ldr(&test, &test, options.ppd).unwrap().mean, 0.0);
    let other = flip_hdr(&reference, &test, &options).unwrap();
    assert!(other.mean > 0.01 && other.mean < 0.9, "{}", other.mean);
    assert!(other.error.values().iter().all(|e| (0.0..=1.0).contains(e)));
}

#[test]
fn which_image_is_the_test_does_not_matter_to_ldr_flip() {
    let (reference, test) = pair_of(33, 26);
    let there = flip_ldr(&reference, &test, 67.0).unwrap();
    let back = flip_ldr(&test, &reference, 67.0).unwrap();
    assert!(there.mean > 0.01);
    assert_eq!(there.error, back.error);
}

#[test]
fn a_mirrored_pair_has_the_mirrored_error() {
    let (reference, test) = pair_of(40, 21);
    let mirrored = |image: &Image<3>| {
        let pixels = image.pixels().chunks(40).flat_map(|row| row.iter().rev());
        Image::from_pixels(40, 21, pixels.copied().collect()).unwrap()
    };
    let error = flip_ldr(&reference, &test, 67.0).unwrap().error;
    let other = flip_ldr(&mirrored(&reference), &mirrored(&test), 67.0)
        .unwrap()
        .error;
    for (row, other) in error.values().chunks(40).zip(other.values().chunks(40)) {
        for (a, b) in row.iter().zip(other.iter().rev()) {
            // Sums in the other order.
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
    }
}

#[test]
fn images_smaller_than_the_filters_and_values_that_are_no_light() {
    let reference = Image::filled(1, 1, [0.5; 3]);
    let test = Image::filled(1, 1, [f32::NAN, -3.0, f32::INFINITY]);
    let found = flip_hdr(&reference, &test, &FlipOptions::default()).unwrap();
    assert!(found.mean > 0.1 && found.mean <= 1.0, "{}", found.mean);
    assert!(flip_ldr(&reference, &test, 67.0).unwrap().mean.is_finite());
    let black = Image::filled(3, 2, [0.0; 3]);
    let found = flip_hdr(&black, &black, &FlipOptions::default()).unwrap();
    assert_eq!(found.mean, 0.0);
}

#[test]
fn more_exposures_never_lower_an_error() {
    let (reference, test) = pair_of(24, 25);
    let at = |stop, num| {
        let options = FlipOptions {
            start_exposure: Some(-2.0),
            stop_exposure: Some(stop),
            num_exposures: Some(num),
            ..FlipOptions::default()
        };
        flip_hdr(&reference, &test, &options).unwrap().error
    };
    let (few, many) = (at(-2.0, 1), at(2.0, 5));
    assert!(few.values().iter().zip(many.values()).all(|(a, b)| a <= b));
    assert_ne!(few, many);
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    let (reference, test) = pair_of(45, 250);
    let run = |num_threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(num_threads)
            .build()
            .unwrap()
            .install(|| flip_hdr(&reference, &test, &FlipOptions::default()).unwrap())
    };
    // Bands of 125, 62 and 32 rows.
    let one = run(1);
    for num_threads in [2, 5] {
        let many = run(num_threads);
        assert_eq!(one.mean.to_bits(), many.mean.to_bits());
        assert_eq!(one.error, many.error);
    }
}
