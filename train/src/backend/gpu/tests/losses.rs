//! Losses and their derivatives.

use super::{gpu, off, weights};
use crate::backend::gpu::loss::{self, LossBuffers, LossOptions, lit_pixels};
use crate::backend::gpu::report::Report;
use crate::backend::gpu::target::TargetView;
use crate::backend::step::TrainingView;
use crate::loss::target::Target;
use crate::loss::tests::{clipped, frame, mask, points, view};
use crate::loss::{LossTerms, NormalTerms, PixelLight, albedo_loss, radiance_loss};
use crate::options::LossWeights;
use crate::points::SeenPoints;
use eagpt_eval::KnownPixels;
use eagpt_scene::{Image, View};
use eagpt_trace::features::{Features, GBuffer, NUM_LANES, lane};
use eagpt_trace::gpu::{Capacity, Device, Frame};
use glam::Vec3;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Of a derivative, relative to the largest of its lane: ten times the 9.4e-6 seen on lavapipe.
const TOLERANCE: f32 = 1e-4;

/// An image with the precision it has on the device: `steps` of one unit.
fn kept<const C: usize>(image: &Image<C>, range: RangeInclusive<f32>, steps: f32) -> Image<C> {
    let near = |v: f32| (v.clamp(*range.start(), *range.end()) * steps).round() / steps;
    let pixels = image.pixels().iter().map(|p| p.map(near)).collect();
    Image::from_pixels(image.width(), image.height(), pixels).unwrap()
}

fn list(terms: &LossTerms) -> [f64; 8] {
    [
        terms.total,
        terms.l1,
        terms.ssim,
        terms.normal,
        terms.depth_normal,
        terms.emission,
        terms.alpha,
        terms.depth,
    ]
}

fn training(view: View, points: Option<SeenPoints>) -> TrainingView {
    TrainingView {
        index: 0,
        light: 0,
        view: Arc::new(view),
        points: points.map(Arc::new),
    }
}

/// Terms and derivatives by the features, from the device.
fn compared(
    device: &Device,
    features: &GBuffer,
    (view, target): (&TrainingView, &Target),
    options: &LossOptions,
) -> (LossTerms, Vec<Features>) {
    let num_pixels = features.pixels.len();
    let lanes: Vec<[f32; NUM_LANES]> = features.pixels.iter().map(|s| s.0).collect();
    let made = |what| device.buffer(what, 64 * num_pixels as u64).unwrap();
    let frame = Frame {
        features: device
            .upload("features", bytemuck::cast_slice(&lanes))
            .unwrap(),
        d_features: made("d_features"),
        gradients: made("gradients"),
        attributes: made("attributes"),
        counters: made("counters"),
        capacity: Capacity::default(),
    };
    let empty = bytemuck::bytes_of(&Report::EMPTY);
    let report_buffer = device.upload("report", empty).unwrap();
    let on_device = TargetView::new(device, view, target).unwrap();
    let buffers = LossBuffers::new(device, num_pixels).unwrap();
    let at = (&view.view.camera, &on_device);
    let passes = buffers.passes(device, at, options, (&frame, &report_buffer));
    device.run(&passes).unwrap();
    let d: Vec<[f32; NUM_LANES]> = device.read(&frame.d_features, 0..num_pixels).unwrap();
    let report = device.read::<Report>(&report_buffer, 0..1).unwrap()[0];
    let terms = loss::terms(&report, &on_device, options);
    (terms, d.into_iter().map(Features).collect())
}

#[test]
fn losses_and_their_derivatives_are_those_of_the_cpu() {
    let Some(device) = gpu::device("losses on a device") else {
        return;
    };
    let (features, weights) = (frame(), weights());
    let (mut failures, mut worst) = (Vec::new(), 0.0_f32);
    for (with_map, with_mask, is_clipped, normals) in [
        (true, false, false, NormalTerms::On),
        (false, false, false, NormalTerms::On),
        (true, true, false, NormalTerms::On),
        (false, true, false, NormalTerms::Off),
        (false, false, true, NormalTerms::Off),
        (true, true, true, NormalTerms::On),
        (false, true, true, NormalTerms::On),
    ] {
        let mut view = view(with_map);
        view.valid = with_mask.then(mask);
        view.clipped = is_clipped.then(clipped);
        view.normal = view.normal.map(|map| kept(&map, -1.0..=1.0, 32_767.0));
        view.emission = view.emission.map(|mask| kept(&mask, 0.0..=1.0, 65_535.0));
        let target = Target::new(&view.radiance);
        let seen = with_mask.then(points);
        let (wanted_terms, wanted_d) = radiance_loss(
            &features,
            &view,
            &target.pq(),
            seen.as_ref()
                .map(|seen| seen.pixels(&view.camera))
                .as_deref(),
            &weights,
            normals,
        );

        let options = LossOptions {
            weights,
            normals,
            antialias: false,
            lit: None,
        };
        let (terms, d) = compared(
            &device,
            &features,
            (&training(view, seen), &target),
            &options,
        );

        let name = format!("map {with_map}, mask {with_mask}, clipped {is_clipped}, {normals:?}");
        for (got, wanted) in list(&terms).into_iter().zip(list(&wanted_terms)) {
            if (got - wanted).abs() > f64::from(TOLERANCE) * wanted.abs().max(0.01) {
                failures.push(format!("{name}: {terms:?} instead of {wanted_terms:?}"));
                break;
            }
        }
        for k in 0..NUM_LANES {
            let off = off(&d, &wanted_d, k);
            worst = worst.max(off);
            // A pixel that is not finite compares as no difference.
            let is_finite = d.iter().all(|s| s.0[k].is_finite());
            if off > TOLERANCE || !is_finite {
                failures.push(format!("{name}: lane {k} off by {off:e}"));
            }
        }
    }
    eprintln!("derivatives off by at most {worst:e}");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn losses_of_albedos_are_those_of_the_cpu() {
    let Some(device) = gpu::device("losses of albedos on a device") else {
        return;
    };
    for is_clipped in [false, true] {
        compare_albedos(&device, is_clipped);
    }
}

fn compare_albedos(device: &Device, is_clipped: bool) {
    let mut features = frame();
    for pixel in features.pixels.iter_mut().step_by(5) {
        pixel.0[lane::EMISSION] = 0.9;
    }
    let mut view = view(false);
    view.valid = Some(mask());
    view.clipped = is_clipped.then(clipped);
    let target = Target::new(&view.radiance);
    // Every pixel under a light of its own; emitters among them.
    let irradiance =
        (0..features.pixels.len()).map(|i| Vec3::new(0.7, 1.0, 1.3) * (0.5 + (i % 7) as f32));
    let light = PixelLight::new(&features, irradiance.collect(), 0.5);
    let num_emitters = light.emitted.iter().flatten().count();
    assert!(num_emitters > 0 && num_emitters < features.pixels.len());
    let weights = LossWeights {
        color: 1.0,
        ..weights()
    };
    let albedos: Vec<Vec3> = features.pixels.iter().map(Features::albedo).collect();
    let known = view.valid.as_ref().map(KnownPixels::new);
    let share = weights.ssim_share;
    let (wanted_terms, wanted_d) = albedo_loss(
        &albedos,
        &light,
        &target.pq(),
        share,
        known.as_ref(),
        view.clipped.as_ref(),
    );
    let lit = lit_pixels(device, &light).unwrap();
    let options = LossOptions {
        weights,
        normals: NormalTerms::Off,
        antialias: false,
        lit: Some(lit),
    };
    let (terms, d) = compared(
        device,
        &features,
        (&training(view, None), &target),
        &options,
    );
    for (got, wanted) in list(&terms).into_iter().zip(list(&wanted_terms)) {
        let off = (got - wanted).abs();
        assert!(off <= f64::from(TOLERANCE) * wanted.abs(), "{terms:?}");
    }
    let mut all_wanted = vec![Features::default(); wanted_d.len()];
    for (lanes, d) in all_wanted.iter_mut().zip(&wanted_d) {
        lanes.0[lane::ALBEDO..][..3].copy_from_slice(&d.to_array());
    }
    for k in 0..NUM_LANES {
        let off = off(&d, &all_wanted, k);
        assert!(off <= TOLERANCE, "lane {k} off by {off:e}");
        assert!(d.iter().all(|s| s.0[k].is_finite()));
    }
    assert!(wanted_d.iter().any(|d| *d != Vec3::ZERO));
}
