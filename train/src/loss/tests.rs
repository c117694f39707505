//! Every term against central differences, on a smooth artificial frame.

mod albedo;
mod points;

use super::depth_normal::directions;
use super::*;
use crate::loss::color::pq_image;
use eagpt_scene::Camera;
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::{DAffine3, DMat3, DVec3};
pub(crate) use points::points;

const WIDTH: u32 = 14;
const HEIGHT: u32 = 13;

fn camera() -> Camera {
    Camera {
        width: WIDTH,
        height: HEIGHT,
        fx: 12.0,
        fy: 12.0,
        cx: 7.0,
        cy: 6.5,
        world_from_camera: DAffine3 {
            matrix3: DMat3::IDENTITY,
            translation: DVec3::ZERO,
        },
    }
}

fn noise(i: u32) -> [f32; 4] {
    RandomKey::new(9, Purpose::Render, 1)
        .stream(i, 0)
        .next_uniforms()
}

pub(crate) fn frame() -> GBuffer {
    let pixels = (0..WIDTH * HEIGHT)
        .map(|i| {
            let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
            let [a, b, c, d] = noise(i);
            let mut s = Features::default();
            let alpha = 0.7 + 0.25 * a;
            s.0[lane::RADIANCE..][..3].copy_from_slice(&[0.2 + b, 0.1 + 0.5 * c, 2.0 * d + 0.05]);
            s.0[lane::EMISSION] = 0.3 * a + 0.1;
            s.0[lane::ALBEDO..][..3].copy_from_slice(&[0.2 + 0.5 * c, 0.4, 0.3 + 0.2 * b]);
            s.0[lane::NORMAL..][..3].copy_from_slice(&[0.2 * b, 0.1 - 0.2 * c, -0.8]);
            s.0[lane::ALPHA] = alpha;
            s.0[lane::DISTANCE] = alpha * (3.0 + 0.1 * x - 0.05 * y + 0.02 * d);
            s
        })
        .collect();
    GBuffer {
        width: WIDTH,
        height: HEIGHT,
        pixels,
    }
}

pub(crate) fn view(normal: bool) -> View {
    let image = |f: &dyn Fn([f32; 4]) -> [f32; 3]| {
        Image::from_pixels(
            WIDTH,
            HEIGHT,
            (0..WIDTH * HEIGHT).map(|i| f(noise(i + 5000))).collect(),
        )
        .unwrap()
    };
    let radiance = image(&|[a, b, c, _]| [a + 0.3, 0.2 + b, c + 0.1]);
    View {
        emission: Some(image(&|[a, ..]| [a.round(); 3]).map(|p| [p[0]])),
        normal: normal.then(|| {
            image(&|[a, b, ..]| {
                Vec3::new(0.3 * a, 0.2 * b - 0.1, -1.0)
                    .normalize()
                    .to_array()
            })
        }),
        ..View::new("test".to_owned(), camera(), radiance)
    }
}

fn only(field: &str) -> LossWeights {
    let weight = |name: &str| if name == field { 0.7 } else { 0.0 };
    LossWeights {
        color: weight("color"),
        ssim_share: 0.2,
        normal: weight("normal"),
        depth_normal: weight("depth_normal"),
        emission: weight("emission"),
        alpha: weight("alpha"),
        depth: weight("depth"),
    }
}

/// Unknown: a block in the middle and a corner, so that some windows of SSIM still count.
pub(crate) fn mask() -> Image<1> {
    let mut mask = Image::filled(WIDTH, HEIGHT, [1.0]);
    for (i, pixel) in (0..).zip(mask.pixels_mut()) {
        let (x, y) = (i % WIDTH, i / WIDTH);
        if (x == 12 && y < 2) || (x < 2 && y > 9) {
            *pixel = [0.0];
        }
    }
    mask
}

/// Clipped: every other channel.
pub(crate) fn clipped() -> Image<3> {
    let flag = |i: u32, c: u32| if (i + c).is_multiple_of(2) { 1.0 } else { 0.0 };
    let pixels = (0..WIDTH * HEIGHT).map(|i| [flag(i, 0), flag(i, 1), flag(i, 2)]);
    Image::from_pixels(WIDTH, HEIGHT, pixels.collect()).unwrap()
}

#[test]
fn gradients_match_central_differences() {
    check_gradients(None, None);
}

#[test]
fn gradients_match_central_differences_where_some_pixels_are_unknown() {
    check_gradients(Some(&mask()), None);
}

#[test]
fn gradients_match_central_differences_where_some_channels_are_clipped() {
    check_gradients(None, Some(&clipped()));
}

#[test]
fn clipped_channels_are_pulled_up_and_never_down() {
    let mut view = view(false);
    view.clipped = Some(clipped());
    let target = pq_image(&view.radiance);
    let features = frame();
    let loss = |features: &GBuffer, view: &View| {
        radiance_loss(
            features,
            view,
            &target,
            None,
            &only("color"),
            NormalTerms::Off,
        )
    };
    let (terms, d) = loss(&features, &view);
    let flags = clipped();
    let mut as_bright = features.clone();
    let (mut num_below, mut num_beyond) = (0, 0);
    for i in 0..d.len() {
        for c in (0..3).filter(|&c| flags.pixels()[i][c] > 0.0) {
            let slope = d[i].0[lane::RADIANCE + c];
            let wanted = view.radiance.pixels()[i][c];
            let shown = &mut as_bright.pixels[i].0[lane::RADIANCE + c];
            if *shown > wanted {
                assert_eq!(slope, 0.0);
                *shown = wanted;
                num_beyond += 1;
            } else {
                num_below += usize::from(slope < 0.0);
            }
        }
    }
    assert!(
        num_below > 50 && num_beyond > 50,
        "{num_below} {num_beyond}"
    );
    // It is as if they were as bright as the picture says, which without the mask is right.
    view.clipped = None;
    let (same, _) = loss(&as_bright, &view);
    assert!((same.total - terms.total).abs() < 1e-7 * terms.total);
    assert!(loss(&features, &view).0.total > 1.1 * terms.total);
}

fn check_gradients(valid: Option<&Image<1>>, clipped: Option<&Image<3>>) {
    let mut failures = Vec::new();
    for (field, with_map, lanes) in [
        ("color", true, lane::RADIANCE..lane::RADIANCE + 3),
        ("normal", true, lane::NORMAL..lane::NORMAL + 3),
        ("depth_normal", true, lane::ALPHA..lane::DISTANCE + 1),
        ("depth_normal", false, lane::NORMAL..lane::DISTANCE + 1),
        ("emission", true, lane::EMISSION..lane::EMISSION + 1),
        ("alpha", true, lane::ALPHA..lane::ALPHA + 1),
        ("depth", true, lane::ALPHA..lane::DISTANCE + 1),
    ] {
        let (mut view, weights) = (view(with_map), only(field));
        view.valid = valid.cloned();
        view.clipped = clipped.cloned();
        let target = pq_image(&view.radiance);
        let seen = points().pixels(&view.camera);
        let loss = |features: &GBuffer| {
            let (points, normals) = (Some(&seen[..]), NormalTerms::On);
            radiance_loss(features, &view, &target, points, &weights, normals)
        };
        let base = frame();
        let (terms, analytic) = loss(&base);
        assert!(terms.total > 0.0, "{field} is active");
        let largest = analytic
            .iter()
            .flat_map(|s| s.0)
            .fold(0.0_f32, |m, x| m.max(x.abs()));
        // Pixels whose error is far from 0, where L1 has its kink.
        for pixel in [0, 5, 18, 40, 93, 100, (WIDTH * HEIGHT - 1) as usize] {
            for k in lanes.clone() {
                // Large enough that single-precision features of the loss keep four digits of the
                // difference.
                let h = 4e-3 * base.pixels[pixel].0[k].abs().max(0.1);
                let (mut up, mut down) = (base.clone(), base.clone());
                up.pixels[pixel].0[k] += h;
                down.pixels[pixel].0[k] -= h;
                let width = f64::from(up.pixels[pixel].0[k] - down.pixels[pixel].0[k]);
                let numeric = (loss(&up).0.total - loss(&down).0.total) / width;
                let got = f64::from(analytic[pixel].0[k]);
                // Second-order error of the difference and its rounding; worst seen 0.7 % of the
                // largest.
                if (got - numeric).abs() > 0.02 * f64::from(largest) {
                    failures.push(format!(
                        "{field}, pixel {pixel}, lane {k}: {got:e} instead of {numeric:e}"
                    ));
                }
            }
        }
        for (pixel, features) in analytic.iter().enumerate() {
            // The differences of depth at a known pixel reach its neighbours.
            let is_unknown = valid.is_some_and(|v| v.pixels()[pixel] == [0.0]);
            if is_unknown && field != "depth_normal" && features.0 != [0.0; 16] {
                failures.push(format!("{field} moves pixel {pixel}, which is unknown"));
            }
            for k in (0..16).filter(|k| !lanes.contains(k)) {
                if features.0[k] != 0.0 {
                    failures.push(format!("{field} moves lane {k} of pixel {pixel}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn what_is_unknown_changes_no_bit() {
    let mut garbled = view(true);
    garbled.valid = Some(mask());
    let plain = garbled.clone();
    let known = KnownPixels::new(&mask());
    let garbage = |image: &Image<1>| known.with_reference(&image.map(|_| [0.37]), image);
    let garbage3 = |image: &Image<3>| known.with_reference(&image.map(|_| [7.0, 0.0, 0.1]), image);
    let [radiance, normal] =
        [Some(&plain.radiance), plain.normal.as_ref()].map(|image| image.map(garbage3));
    garbled.radiance = radiance.unwrap();
    garbled.normal = normal;
    garbled.emission = garbled.emission.as_ref().map(garbage);
    garbled.alpha = Some(garbage(&Image::filled(WIDTH, HEIGHT, [1.0])));
    assert_ne!(garbled, plain);
    let weights = LossWeights {
        emission: 0.3,
        alpha: 0.2,
        normal: 0.5,
        depth_normal: 0.1,
        depth: 0.4,
        ..only("color")
    };
    let loss = |view: &View| {
        let target = pq_image(&view.radiance);
        let points = points().pixels(&view.camera);
        radiance_loss(
            &frame(),
            view,
            &target,
            Some(&points),
            &weights,
            NormalTerms::On,
        )
    };
    let ((terms, d_features), (wanted, wanted_d)) = (loss(&garbled), loss(&plain));
    assert_eq!(terms, wanted);
    assert!(d_features.iter().zip(&wanted_d).all(|(a, b)| a.0 == b.0));

    let irradiance = vec![Vec3::ONE; frame().pixels.len()];
    let albedo = |view: &View| {
        let target = pq_image(&view.radiance);
        let light = PixelLight::new(&frame(), irradiance.clone(), 0.5);
        albedo_loss(
            &albedos_of(&frame()),
            &light,
            &target,
            0.2,
            Some(&known),
            None,
        )
    };
    let ((terms, d_albedos), (wanted, wanted_d)) = (albedo(&garbled), albedo(&plain));
    assert!(terms.l1 > 0.0 && terms.ssim < 1.0);
    assert_eq!(terms, wanted);
    for (i, (a, b)) in d_albedos.iter().zip(&wanted_d).enumerate() {
        assert!(a == b && (known.has(i) || *a == Vec3::ZERO));
    }
}

fn albedos_of(features: &GBuffer) -> Vec<Vec3> {
    features.pixels.iter().map(Features::albedo).collect()
}

#[test]
fn a_view_of_which_nothing_is_known_moves_nothing() {
    let mut view = view(true);
    view.valid = Some(Image::filled(WIDTH, HEIGHT, [0.0]));
    let target = pq_image(&view.radiance);
    let weights = only("color");
    let (terms, d_features) =
        radiance_loss(&frame(), &view, &target, None, &weights, NormalTerms::On);
    assert_eq!((terms.total, terms.l1, terms.ssim), (0.0, 0.0, 1.0));
    assert!(d_features.iter().all(|d| d.0 == [0.0; 16]));
}

#[test]
fn an_absent_mask_is_no_mask_of_zeros() {
    let mut view = view(true);
    view.emission = None;
    let target = pq_image(&view.radiance);
    let (terms, d) = radiance_loss(
        &frame(),
        &view,
        &target,
        None,
        &only("emission"),
        NormalTerms::On,
    );
    assert_eq!(terms.total, 0.0);
    assert!(d.iter().all(|s| s.0[lane::EMISSION] == 0.0));
}

#[test]
fn a_flat_wall_has_the_normal_of_its_depth() {
    // The plane z = 3, seen straight on: distances grow towards the corners, normals point back at
    // the camera.
    let mut features = frame();
    for (s, d) in features.pixels.iter_mut().zip(directions(&camera())) {
        s.0[lane::ALPHA] = 1.0;
        s.0[lane::DISTANCE] = 3.0 / d.z;
    }
    let map = Image::filled(WIDTH, HEIGHT, [0.0, 0.0, -1.0]);
    let mut d_features = vec![Features::default(); features.pixels.len()];
    let value = depth_normal::add(&features, &camera(), Some(&map), 1.0, None, &mut d_features);
    assert!(value.abs() < 1e-6, "{value}");
}
