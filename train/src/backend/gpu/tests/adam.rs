//! Steps along gradients.

use super::{gpu, off};
use crate::backend::gpu::params::ResidentState;
use crate::backend::gpu::report::Report;
use crate::options::{HarmonicsOptions, Preset, TrainOptions};
use crate::params::{CLASSES, EMISSION, NUM_PARAMETERS, ParameterState, RADIANCE, StepSizes};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_testkit::gaussians::{directional, look_at, random_cloud};
use eagpt_trace::Tracer as _;
use eagpt_trace::blend::LocalGradient;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::features::{NUM_LANES, lane};
use eagpt_trace::gpu::{Device, GpuScene};
use eagpt_trace::surfel::SurfelSet;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Of a parameter or moment, relative to the largest of its kind: ten times the 3e-7 seen on
/// lavapipe.
const STEP_TOLERANCE: f32 = 3e-6;

/// The report of the step that was submitted last.
fn reported(device: &Device, state: &ResidentState) -> Report {
    state
        .submit(device.commands())
        .unwrap()
        .wait(device)
        .unwrap()[0]
}

/// Four steps with other gradients each: moments, corrections and everything that follows from
/// parameters.
#[test]
fn steps_of_adam_are_those_of_the_cpu() {
    if let Some(device) = gpu::device("Adam on a device") {
        check_steps(&device, start(0), &[0; 4]);
    }
}

#[test]
fn fixed_gaussians_stay_to_the_bit_and_the_others_move_as_on_the_cpu() {
    let Some(device) = gpu::device("fixed Gaussians on a device") else {
        return;
    };
    let before = start(67);
    let states = check_steps(&device, before.clone(), &[0; 4]);
    let first = before.num_moving();
    for state in states {
        assert_eq!(state.num_fixed, 67);
        for (got, old) in state.raw.arrays().into_iter().zip(before.raw.arrays()) {
            assert_eq!(got[first..], old[first..]);
            assert_ne!(got[first - 1], old[first - 1]);
        }
        let harmonics = state.harmonics.arrays().into_iter();
        for (got, old) in harmonics.zip(before.harmonics.arrays()) {
            assert_eq!(got[first..], old[first..]);
        }
    }
}

/// Every light has its own light, moments and harmonics. Of the fixed Gaussians each shines in one
/// of the two lights, and learns its radiance in the other.
#[test]
fn steps_in_several_lights_are_those_of_the_cpu() {
    let Some(device) = gpu::device("several lights on a device") else {
        return;
    };
    let mut state = start(67);
    let first = state.num_moving();
    state = state.with_lights(&[random_cloud(130, 6)]);
    for i in first..state.len() {
        let shines = |light: usize| if i % 2 == light { 4.0 } else { -4.0 };
        state.raw.values[i][EMISSION] = shines(0);
        state.lights.stored[1].light.values[i][EMISSION - RADIANCE] = shines(1);
    }
    let before = state.in_lights();
    let [gpu, cpu] = check_steps(&device, state, &[0, 1, 1, 0, 1]);
    assert_eq!((gpu.lights.current, cpu.lights.current), (1, 1));
    for (light, (got, old)) in gpu.in_lights().iter().zip(&before).enumerate() {
        for i in first..old.len() {
            assert_eq!(got.positions[i], old.positions[i]);
            let same = got.radiances[i] == old.radiances[i];
            assert_eq!(same, i % 2 == light, "{i} in light {light}");
        }
        assert_ne!(got.radiances[0], old.radiances[0]);
    }
}

/// The state that steps start from; so many of its Gaussians are fixed.
fn start(num_fixed: usize) -> ParameterState {
    let mut cpu = ParameterState::new(&directional(random_cloud(130, 4), 5));
    // Quaternions do not stay of unit length.
    for (i, raw) in cpu.raw.values.iter_mut().enumerate() {
        raw[5..9]
            .iter_mut()
            .for_each(|q| *q *= 1.0 + 0.01 * i as f32);
    }
    cpu.num_fixed = num_fixed;
    cpu
}

/// Takes a step in each of `lights` on the device and on the CPU, and compares the states, which it
/// returns.
fn check_steps(
    device: &Arc<Device>,
    mut cpu: ParameterState,
    lights: &[usize],
) -> [ParameterState; 2] {
    let mut gaussians = cpu.gaussians();
    let mut set = SurfelSet::new(&gaussians);
    let fit = GpuScene::new(device, &gaussians).unwrap();
    let mut gpu = ResidentState::new(device, &cpu, &fit).unwrap();
    let camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, 16, 16);
    let eye = camera.origin();
    let frame = fit.frame(&camera.into()).unwrap().unwrap();
    let harmonics = HarmonicsOptions {
        degree: 1,
        from: 0.0,
        rate: 0.02,
        decay: 0.5,
    };
    let options = TrainOptions::preset(Preset::Draft);
    for (time, &light) in lights.iter().enumerate() {
        cpu.show_light(light);
        cpu.write_gaussians(&mut gaussians);
        gpu.show_light(light, &fit).unwrap();
        let mut commands = device.commands();
        fit.forward(&camera.into(), &mut commands).unwrap();
        device.submit(commands).unwrap();
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
        device
            .run(&gpu.passes(&fit, (&frame, eye), &sizes))
            .unwrap();
        gpu.count(&sizes);
        let report = reported(device, &gpu);
        assert_eq!(gpu.bad_gradient(&report).unwrap(), None);
    }
    set.update(&gaussians);
    let mut state = gpu.state().unwrap();
    let mut failures = Vec::new();
    for light in 0..cpu.lights.num() {
        state.show_light(light);
        cpu.show_light(light);
        let in_light = lights.iter().filter(|other| **other == light).count() as u32;
        for state in [&state, &cpu] {
            let steps = (state.raw.num_steps, state.harmonics.num_steps);
            assert_eq!(steps, (lights.len() as u32, in_light));
        }
        let worst = compared(&state, &cpu);
        eprintln!("light {light}: {worst:?}");
        failures.extend(worst.into_iter().filter(|(_, off)| *off > STEP_TOLERANCE));
    }
    for state in [&mut state, &mut cpu] {
        state.show_light(lights[lights.len() - 1]);
    }
    // The traced Gaussians are those of the parameters.
    let seen = fit.gbuffer(&camera).unwrap();
    let (wanted, _) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing);
    let off = off(&seen.pixels, &wanted.pixels, lane::RADIANCE);
    if off > 1e-3 {
        failures.push(("traced".to_owned(), off));
    }
    assert!(failures.is_empty(), "{failures:?}");
    [state, cpu]
}

/// Largest relative difference of each class of parameters, their moments, and those of the
/// harmonics, in the current light.
fn compared(got: &ParameterState, wanted: &ParameterState) -> Vec<(String, f32)> {
    let mut worst = Vec::new();
    let arrays = got.raw.arrays().into_iter().zip(wanted.raw.arrays());
    for (name, (got, wanted)) in ["values", "first", "second"].iter().zip(arrays) {
        for (class, range) in CLASSES {
            worst.push((format!("{name} of {class}"), relative(got, wanted, range)));
        }
    }
    let arrays = got.harmonics.arrays().into_iter();
    for (k, (got, wanted)) in arrays.zip(wanted.harmonics.arrays()).enumerate() {
        let off = relative(got, wanted, 0..NUM_COEFFICIENTS);
        worst.push((format!("harmonics {k}"), off));
    }
    worst
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
    let fit = GpuScene::new(&device, &before.gaussians()).unwrap();
    let state = ResidentState::new(&device, &before, &fit).unwrap();
    let camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, 16, 16);
    let frame = fit.frame(&camera.into()).unwrap().unwrap();
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
        .run(&state.passes(&fit, (&frame, Vec3::ZERO), &sizes))
        .unwrap();
    let report = reported(&device, &state);
    let bad = state.bad_gradient(&report).unwrap().unwrap();
    assert_eq!((bad.class, bad.index), ("emission", 66));
    // Nor do the steps behind it move anything, until somebody has looked.
    device.write(&frame.gradients, &vec![0; 64 * before.len()]);
    state.begin();
    device
        .run(&state.passes(&fit, (&frame, Vec3::ZERO), &sizes))
        .unwrap();
    assert_eq!(reported(&device, &state).first_bad(), None);
    assert_eq!(state.state().unwrap(), before);
}
