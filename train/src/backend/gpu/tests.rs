//! Each stage against its twin on the CPU.

use super::GpuBackend;
use super::loss::{LossBuffers, LossOptions, lit_pixels};
use super::params::ResidentState;
use super::report;
use super::wanted::WantedView;
use crate::backend::{Backend as _, RadianceStep, TrainingView};
use crate::loss::target::Target;
use crate::loss::tests::{frame, mask, view};
use crate::loss::{LossTerms, NormalTerms, PixelLight, albedo_loss, radiance_loss};
use crate::options::{HarmonicsOptions, LossWeights, Preset, TrainOptions};
use crate::params::{CLASSES, NUM_PARAMETERS, ParameterState, StepSizes};
use eagpt_eval::KnownPixels;
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_scene::{Camera, Image, View};
use eagpt_testkit::gaussians::{directional, look_at, random_cloud};
use eagpt_trace::blend::LocalGradient;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::gpu::{Device, Frame, FrameRoom, GpuFit};
use eagpt_trace::sums::{NUM_LANES, SumImage, Sums, lane};
use eagpt_trace::surfel::SurfelSet;
use glam::{DVec3, Vec3};
use std::ops::RangeInclusive;
use std::sync::Arc;

#[path = "../../../../trace/tests/gpu/mod.rs"]
mod gpu;

/// Of a derivative, relative to the largest of its lane: ten times the 9.4e-6 seen on lavapipe.
const TOLERANCE: f32 = 1e-4;

/// Of a parameter or moment, relative to the largest of its kind: ten times the 3e-7 seen on lavapipe.
const STEP_TOLERANCE: f32 = 3e-6;

fn weights() -> LossWeights {
    TrainOptions::preset(Preset::Draft).radiance.weights
}

/// Largest difference in lane `k`, relative to the largest value.
fn off(got: &[Sums], wanted: &[Sums], k: usize) -> f32 {
    let scale = wanted.iter().fold(0.0_f32, |m, s| m.max(s.0[k].abs()));
    let pairs = got.iter().zip(wanted);
    let worst = pairs.fold(0.0_f32, |m, (a, b)| m.max((a.0[k] - b.0[k]).abs()));
    if worst == 0.0 { 0.0 } else { worst / scale }
}

/// What is left of an image on the device: `steps` of one unit.
fn kept<const C: usize>(image: &Image<C>, range: RangeInclusive<f32>, steps: f32) -> Image<C> {
    let near = |v: f32| (v.clamp(*range.start(), *range.end()) * steps).round() / steps;
    let pixels = image.pixels().iter().map(|p| p.map(near)).collect();
    Image::from_pixels(image.width(), image.height(), pixels).unwrap()
}

fn list(terms: &LossTerms) -> [f64; 7] {
    [
        terms.total,
        terms.l1,
        terms.ssim,
        terms.normal,
        terms.depth_normal,
        terms.emission,
        terms.alpha,
    ]
}

/// Terms and derivatives by the sums, from the device.
fn compared(
    device: &Device,
    sums: &SumImage,
    (view, target): (&View, &Target),
    options: &LossOptions,
) -> (LossTerms, Vec<Sums>) {
    let num_pixels = sums.pixels.len();
    let lanes: Vec<[f32; NUM_LANES]> = sums.pixels.iter().map(|s| s.0).collect();
    let made = |what| device.buffer(what, 64 * num_pixels as u64).unwrap();
    let frame = Frame {
        sums: device.upload("sums", bytemuck::cast_slice(&lanes)).unwrap(),
        d_sums: made("d_sums"),
        gradients: made("gradients"),
        payloads: made("payloads"),
        totals: made("totals"),
        room: FrameRoom {
            entries: 0,
            chunks: 0,
        },
    };
    let words = bytemuck::cast_slice(&report::EMPTY).to_vec();
    let report_buffer = device.upload("report", &words).unwrap();
    let on_device = WantedView::new(device, view, target).unwrap();
    let buffers = LossBuffers::new(device, num_pixels).unwrap();
    let at = (&view.camera, &on_device);
    let steps = buffers.steps(device, at, options, (&frame, &report_buffer));
    device.run(&steps).unwrap();
    let d: Vec<[f32; NUM_LANES]> = device.read(&frame.d_sums, 0..num_pixels).unwrap();
    let words: Vec<u32> = device.read(&report_buffer, 0..report::NUM_WORDS).unwrap();
    let report = report::Report(words.try_into().unwrap());
    let terms = super::loss::terms(&report, &on_device, options);
    (terms, d.into_iter().map(Sums).collect())
}

#[test]
fn losses_and_their_derivatives_are_those_of_the_cpu() {
    let Some(device) = gpu::device("losses on a device") else {
        return;
    };
    let (sums, weights) = (frame(), weights());
    let (mut failures, mut worst) = (Vec::new(), 0.0_f32);
    for (with_map, with_mask, normals) in [
        (true, false, NormalTerms::On),
        (false, false, NormalTerms::On),
        (true, true, NormalTerms::On),
        (false, true, NormalTerms::Off),
    ] {
        let mut view = view(with_map);
        view.valid = with_mask.then(mask);
        view.normal = view.normal.map(|map| kept(&map, -1.0..=1.0, 32_767.0));
        view.emission = view.emission.map(|mask| kept(&mask, 0.0..=1.0, 65_535.0));
        let target = Target::new(&view.radiance);
        let (wanted_terms, wanted_d) = radiance_loss(&sums, &view, &target.pq(), &weights, normals);

        let options = LossOptions {
            weights,
            normals,
            rays_per_axis: 1,
            lit: None,
        };
        let (terms, d) = compared(&device, &sums, (&view, &target), &options);

        let name = format!("map {with_map}, mask {with_mask}, {normals:?}");
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
    let mut sums = frame();
    for pixel in sums.pixels.iter_mut().step_by(5) {
        pixel.0[lane::EMISSION] = 0.9;
    }
    let mut view = view(false);
    view.valid = Some(mask());
    let target = Target::new(&view.radiance);
    // Every pixel under a light of its own; emitters among them.
    let arriving =
        (0..sums.pixels.len()).map(|i| Vec3::new(0.7, 1.0, 1.3) * (0.5 + (i % 7) as f32));
    let light = PixelLight::new(&sums, arriving.collect(), 0.5);
    let num_emitters = light.emitted.iter().flatten().count();
    assert!(num_emitters > 0 && num_emitters < sums.pixels.len());
    let weights = LossWeights {
        color: 1.0,
        ..weights()
    };
    let albedos: Vec<Vec3> = sums.pixels.iter().map(Sums::albedo).collect();
    let known = view.valid.as_ref().map(KnownPixels::new);
    let share = weights.ssim_share;
    let (wanted_terms, wanted_d) =
        albedo_loss(&albedos, &light, &target.pq(), share, known.as_ref());
    let lit = lit_pixels(&device, &light).unwrap();
    let options = LossOptions {
        weights,
        normals: NormalTerms::Off,
        rays_per_axis: 1,
        lit: Some(lit),
    };
    let (terms, d) = compared(&device, &sums, (&view, &target), &options);
    for (got, wanted) in list(&terms).into_iter().zip(list(&wanted_terms)) {
        let off = (got - wanted).abs();
        assert!(off <= f64::from(TOLERANCE) * wanted.abs(), "{terms:?}");
    }
    let mut all_wanted = vec![Sums::default(); wanted_d.len()];
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

/// The report of the step that was submitted last.
fn reported(device: &Device, state: &ResidentState) -> report::Report {
    let words = state.read_report().unwrap().wait(device).unwrap();
    report::Report(words.try_into().unwrap())
}

/// Four steps with other gradients each: moments, corrections and everything that follows from parameters.
#[test]
fn steps_of_adam_are_those_of_the_cpu() {
    let Some(device) = gpu::device("Adam on a device") else {
        return;
    };
    let mut cpu = ParameterState::new(&directional(random_cloud(130, 4), 5));
    // Quaternions do not stay of unit length.
    for (i, raw) in cpu.raw.values.iter_mut().enumerate() {
        raw[5..9]
            .iter_mut()
            .for_each(|q| *q *= 1.0 + 0.01 * i as f32);
    }
    let mut gaussians = cpu.gaussians();
    let mut set = SurfelSet::new(&gaussians);
    let fit = GpuFit::new(&device, &set).unwrap();
    let mut gpu = ResidentState::new(&device, &cpu, &fit).unwrap();
    let camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, 16, 16);
    let eye = camera.origin();
    let frame = fit.frame(&camera).unwrap().unwrap();
    let harmonics = HarmonicsOptions {
        degree: 1,
        from: 0.0,
        rate: 0.02,
        decay: 0.5,
    };
    let options = TrainOptions::preset(Preset::Draft);
    for time in 0..4 {
        fit.forward(&camera).unwrap();
        let gradients: Vec<LocalGradient> = (0..cpu.len())
            .map(|i| {
                let value = |k: usize| ((i * 37 + k * 11 + time * 5) % 101) as f32 / 50.0 - 1.0;
                LocalGradient(std::array::from_fn(value))
            })
            .collect();
        let lanes: Vec<[f32; NUM_LANES]> = gradients.iter().map(|g| g.0).collect();
        device.write(&frame.gradients, bytemuck::cast_slice(&lanes));
        let sizes =
            StepSizes::radiance(&options.radiance.rates, 2.0, 0.1).with_harmonics(&harmonics, 0.9);
        cpu.step(&gaussians, eye, &gradients, &sizes).unwrap();
        cpu.write_gaussians(&mut gaussians);
        gpu.begin();
        device.run(&gpu.steps(&fit, (&frame, eye), &sizes)).unwrap();
        gpu.count(&sizes);
        let report = reported(&device, &gpu);
        assert_eq!(gpu.bad_gradient(&report).unwrap(), None);
    }
    set.update(&gaussians);
    let state = gpu.state().unwrap();
    let steps = |state: &ParameterState| (state.raw.num_steps, state.harmonics.num_steps);
    assert_eq!((steps(&state), steps(&cpu)), ((4, 4), (4, 4)));
    let mut failures = Vec::new();
    for (name, got, wanted) in [
        ("values", &state.raw.values, &cpu.raw.values),
        ("first", &state.raw.first, &cpu.raw.first),
        ("second", &state.raw.second, &cpu.raw.second),
    ] {
        for (class, range) in CLASSES {
            let worst = relative(got, wanted, range);
            eprintln!("{name} of {class}: off by {worst:e}");
            if worst > STEP_TOLERANCE {
                failures.push(format!("{name} of {class}: off by {worst:e}"));
            }
        }
    }
    let arrays = state.harmonics.arrays();
    for (k, (got, wanted)) in arrays.into_iter().zip(cpu.harmonics.arrays()).enumerate() {
        let worst = relative(got, wanted, 0..NUM_COEFFICIENTS);
        eprintln!("harmonics {k}: off by {worst:e}");
        if worst > STEP_TOLERANCE {
            failures.push(format!("harmonics {k}: off by {worst:e}"));
        }
    }
    // What is traced is what follows from the parameters.
    let seen = fit.camera_sums(&camera).unwrap();
    let (wanted, _) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing);
    let off = off(&seen.pixels, &wanted.pixels, lane::RADIANCE);
    if off > 1e-3 {
        failures.push(format!("traced: off by {off:e}"));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

fn relative<const K: usize>(
    got: &[[f32; K]],
    wanted: &[[f32; K]],
    range: std::ops::Range<usize>,
) -> f32 {
    let mut worst = 0.0_f32;
    for k in range {
        let scale = wanted.iter().fold(0.0_f32, |m, raw| m.max(raw[k].abs()));
        for (a, b) in got.iter().zip(wanted) {
            let off = (a[k] - b[k]).abs();
            if off > 0.0 {
                worst = worst.max(off / scale);
            }
        }
    }
    worst
}

#[test]
fn nothing_moves_along_a_gradient_that_is_no_number() {
    let Some(device) = gpu::device("gradients that are no numbers") else {
        return;
    };
    let before = ParameterState::new(&random_cloud(70, 4));
    let set = SurfelSet::new(&before.gaussians());
    let fit = GpuFit::new(&device, &set).unwrap();
    let state = ResidentState::new(&device, &before, &fit).unwrap();
    let camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, 16, 16);
    let frame = fit.frame(&camera).unwrap().unwrap();
    let mut lanes = vec![[1.0_f32; NUM_LANES]; before.len()];
    lanes[66][12] = f32::NAN;
    lanes[67][0] = f32::INFINITY;
    device.write(&frame.gradients, bytemuck::cast_slice(&lanes));
    state.begin();
    let sizes = StepSizes {
        raw: [0.1; NUM_PARAMETERS],
        ..StepSizes::albedo(0.1)
    };
    device
        .run(&state.steps(&fit, (&frame, Vec3::ZERO), &sizes))
        .unwrap();
    let report = reported(&device, &state);
    let bad = state.bad_gradient(&report).unwrap().unwrap();
    assert_eq!((bad.class, bad.index), ("emission", 66));
    // Nor do the steps behind it move anything, until somebody has looked.
    device.write(&frame.gradients, &vec![0; 64 * before.len()]);
    state.begin();
    device
        .run(&state.steps(&fit, (&frame, Vec3::ZERO), &sizes))
        .unwrap();
    assert_eq!(reported(&device, &state).first_bad(), None);
    assert_eq!(state.state().unwrap(), before);
}

/// A step for whose hits there is no room at first is the step that it would have been.
#[test]
fn a_step_without_room_is_taken_again() {
    let Some(device) = gpu::device("room for hits") else {
        return;
    };
    let cloud = random_cloud(400, 4);
    let fit = GpuFit::new(&device, &SurfelSet::new(&cloud)).unwrap();
    let camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, 37, 29);
    let small = fit.frame(&camera).unwrap().unwrap();
    let more = FrameRoom {
        entries: small.room.entries + 1,
        chunks: 0,
    };
    assert!(fit.make_room(&camera, more).unwrap());
    let entries = fit.frame(&camera).unwrap().unwrap();
    assert!(entries.room.entries > small.room.entries && entries != small);
    let more = FrameRoom {
        entries: 0,
        chunks: entries.room.chunks + 1,
    };
    assert!(fit.make_room(&camera, more).unwrap());
    let chunks = fit.frame(&camera).unwrap().unwrap();
    assert!(chunks.room.chunks > entries.room.chunks);
    assert!(!fit.make_room(&camera, chunks.room).unwrap());
}

/// What several steps at once leave, some of which lack room, has the bits of what steps leave that are waited for one by one.
#[test]
fn steps_under_way_at_once_are_those_taken_one_by_one() {
    let Some(device) = gpu::device("several steps at once") else {
        return;
    };
    // Faint Gaussians: more hits in every pixel than room is made for at first.
    let mut cloud = random_cloud(3000, 4);
    cloud.opacities.fill(0.05);
    let set = SurfelSet::new(&cloud);
    let eyes = [DVec3::new(3.0, 0.2, 0.4), DVec3::new(-0.4, 2.5, 0.3)];
    let views = eyes.map(|eye| {
        let camera = look_at(eye, DVec3::ZERO, 37, 29);
        let (seen, _) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing);
        let mut view = view(false);
        (view.normal, view.emission, view.alpha) = (None, None, None);
        view.radiance = seen.extract(|sums| (sums.radiance() * 1.2).to_array());
        view.camera = camera;
        Arc::new(view)
    });
    let weights = weights();
    let rates = TrainOptions::preset(Preset::Draft).radiance.rates;
    let [at_once, one_by_one] = [false, true].map(|waits| {
        let state = ParameterState::new(&cloud);
        let mut backend = GpuBackend::new(&device, state, 1 << 20).unwrap();
        let usual = frame_room(&backend, &views[0].camera);
        let mut taken = Vec::new();
        for iteration in 1..=9 {
            let index = iteration as usize % 2;
            let view = TrainingView {
                index,
                view: Arc::clone(&views[index]),
            };
            let step = RadianceStep {
                iteration,
                weights: &weights,
                normals: NormalTerms::Off,
                // Buffers of another size in the end.
                rays_per_axis: 1 + iteration / 6,
                sizes: StepSizes::radiance(&rates, 2.0, 0.1),
            };
            taken.extend(backend.radiance_step(&view, &step).unwrap());
            if waits {
                taken.extend(backend.finish().unwrap());
            }
            if iteration == 5 {
                assert!(waits || taken.len() < 5, "nothing is under way");
                taken.extend(backend.finish().unwrap());
                let room = frame_room(&backend, &views[0].camera);
                assert!(!room.is_within(&usual), "no step lacked room");
            }
        }
        taken.extend(backend.finish().unwrap());
        let told: Vec<(u32, LossTerms)> = taken
            .into_iter()
            .map(|step| (step.iteration, step.outcome.unwrap()))
            .collect();
        (told, backend.state().unwrap())
    });
    assert!(at_once.0.iter().map(|(iteration, _)| *iteration).eq(1..=9));
    assert!(at_once == one_by_one);
    assert_eq!(at_once.1.raw.num_steps, 9);
}

fn frame_room(backend: &GpuBackend, camera: &Camera) -> FrameRoom {
    let frame = backend.host.engine.fit.frame(camera).unwrap();
    frame.unwrap().room
}
