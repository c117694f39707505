use super::*;

fn grey(values: &[f32]) -> Image<3> {
    let pixels = values.iter().map(|v| [*v; 3]).collect();
    Image::from_pixels(values.len() as u32, 1, pixels).unwrap()
}

fn single(values: &[f32]) -> Image<1> {
    Image::from_pixels(
        values.len() as u32,
        1,
        values.iter().map(|v| [*v]).collect(),
    )
    .unwrap()
}

/// A lamp, a white and a black wall that it reaches, the same walls in its shadow, and a window
/// that has gone.
fn lights(check: impl FnOnce(Lights<'_>)) {
    let before = grey(&[0.0, 0.8, 0.1, 0.8, 0.1, 16.0]);
    let after = grey(&[12.0, 0.4, 0.05, 0.08, 0.01, 0.0]);
    let (old, new) = (
        single(&[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        single(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    );
    check(Lights {
        after: &after,
        emission: Some(&new),
        before: Some(Before {
            radiance: &before,
            emission: Some(&old),
        }),
    });
}

fn change(lights: &Lights<'_>) -> Option<f64> {
    let mut change = LightChange::default();
    change.add(lights);
    change.ratio()
}

#[test]
fn six_pixels_fall_into_their_regions() {
    lights(|lights| {
        // Over the walls alone: 0.54 of 1.8.
        let change = change(&lights);
        assert!((change.unwrap() - 0.3).abs() < 1e-6);
        // The lamp is right; the lit walls are 0.1 off, the shadows 0.3, 0.3 and 0.
        let render = grey(&[12.0, 0.5, 0.15, 0.38, 0.31, 0.0]);
        let found = region_metrics(&lights, &render, change);
        let names: Vec<_> = found.keys().map(|region| region.name()).collect();
        assert_eq!(names, ["emitter", "lit", "shadow"]);
        assert_eq!(found[&Region::Emitter].psnr_linear_db, f64::INFINITY);
        assert_eq!(found[&Region::Emitter].num_pixels, 1);
        let lit = &found[&Region::Lit];
        assert!((lit.psnr_linear_db - 20.0).abs() < 1e-4, "{lit:?}");
        assert!((lit.share - 2.0 / 6.0).abs() < 1e-9);
        assert!((lit.luminance_reference - 0.225).abs() < 1e-6);
        assert!((lit.luminance_render - 0.325).abs() < 1e-6);
        let shadow = &found[&Region::Shadow];
        assert_eq!(shadow.num_pixels, 3);
        for mse in shadow.mse_linear {
            assert!((mse - 0.06).abs() < 1e-6, "{mse}");
        }
        assert!(shadow.psnr_srgb_db < shadow.psnr_linear_db);
    });
}

#[test]
fn a_brighter_photograph_has_the_same_regions() {
    lights(|lights| {
        let render = grey(&[0.5; 6]);
        let sizes = |lights: &Lights<'_>| -> Vec<u64> {
            let found = region_metrics(lights, &render, change(lights));
            found.values().map(|metrics| metrics.num_pixels).collect()
        };
        let brighter = lights.after.map(|pixel| pixel.map(|v| 8.0 * v));
        let other = Lights {
            after: &brighter,
            ..lights
        };
        assert_eq!(sizes(&lights), [1, 2, 3]);
        assert_eq!(sizes(&other), [1, 2, 3]);
    });
}

#[test]
fn what_is_not_known_is_not_split() {
    lights(|lights| {
        let render = grey(&[0.5; 6]);
        let alone = Lights {
            before: None,
            ..lights
        };
        assert_eq!(change(&alone), None);
        let found = region_metrics(&alone, &render, None);
        assert!(found.keys().eq(&[Region::Emitter, Region::Surface]));
        assert_eq!(found[&Region::Surface].num_pixels, 5);
        let nothing = Lights {
            emission: None,
            ..alone
        };
        assert!(region_metrics(&nothing, &render, None).is_empty());
    });
}

#[test]
fn views_are_pooled_by_their_pixels() {
    lights(|lights| {
        let change = change(&lights);
        let of = |values: &[f32]| region_metrics(&lights, &grey(values), change);
        let right = of(&[12.0, 0.4, 0.05, 0.08, 0.01, 0.0]);
        let wrong = of(&[12.0, 0.6, 0.25, 0.08, 0.01, 0.0]);
        let found = pooled([&right, &wrong].into_iter());
        // Errors 0, 0, 0.2, 0.2.
        let lit = &found[&Region::Lit];
        assert!((lit.mse_linear[1] - 0.02).abs() < 1e-6, "{lit:?}");
        assert_eq!((lit.num_pixels, lit.share), (4, 2.0 / 6.0));
        assert_eq!(found[&Region::Shadow].psnr_srgb_db, f64::INFINITY);
    });
}
