//! Steps under way, and the capacities of their buffers.

use super::{gpu, weights};
use crate::backend::gpu::GpuBackend;
use crate::backend::{Backend as _, RadianceStep, TrainingView};
use crate::loss::tests::view;
use crate::loss::{LossTerms, NormalTerms};
use crate::options::{HarmonicsOptions, Preset, TrainOptions};
use crate::params::{ParameterState, StepSizes};
use eagpt_scene::{Camera, SceneEdit};
use eagpt_testkit::gaussians::{look_at, random_cloud};
use eagpt_trace::Tracer as _;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::gpu::{Capacity, Counters, Device, GpuScene};
use eagpt_trace::surfel::SurfelSet;
use glam::DVec3;
use std::sync::Arc;

#[test]
fn buffers_grow_to_what_is_needed_and_stay() {
    let Some(device) = gpu::device("capacities for hits") else {
        return;
    };
    let cloud = random_cloud(400, 4);
    let mut fit = GpuScene::new(&device, &cloud).unwrap();
    let camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, 37, 29);
    let small = fit.frame(&camera.into()).unwrap().unwrap();
    let more = Counters {
        entries: small.capacity.entries + 1,
        ..Counters::default()
    };
    assert!(fit.grow(&camera.into(), &more));
    let entries = fit.frame(&camera.into()).unwrap().unwrap();
    assert!(entries.capacity.entries > small.capacity.entries && entries != small);
    let more = Counters {
        chunks: entries.capacity.chunks + 1,
        ..Counters::default()
    };
    assert!(fit.grow(&camera.into(), &more));
    let chunks = fit.frame(&camera.into()).unwrap().unwrap();
    assert!(chunks.capacity.chunks > entries.capacity.chunks);
    assert!(!fit.grow(&camera.into(), &all_of(&chunks.capacity)));
    assert_eq!(fit.frame(&camera.into()).unwrap().unwrap(), chunks);
    // They stay so when the number of Gaussians changes.
    fit.update(&random_cloud(401, 4)).unwrap();
    let later = fit.frame(&camera.into()).unwrap().unwrap();
    assert!(later != chunks && later.capacity.holds(&all_of(&chunks.capacity)));
}

/// Needs that fill `capacity`.
fn all_of(capacity: &Capacity) -> Counters {
    Counters {
        entries: capacity.entries,
        chunks: capacity.chunks,
        ..Counters::default()
    }
}

/// Several steps at once, some of which overflow, give the bits of steps that are waited for one by
/// one.
#[test]
fn steps_under_way_at_once_are_those_taken_one_by_one() {
    if let Some(device) = gpu::device("several steps at once") {
        check_steps_at_once(&device, 1);
    }
}

#[test]
fn steps_under_way_at_once_are_in_the_light_of_their_view() {
    if let Some(device) = gpu::device("several steps at once in two lights") {
        check_steps_at_once(&device, 2);
    }
}

fn check_steps_at_once(device: &Arc<Device>, num_lights: usize) {
    // Faint Gaussians: more hits in every pixel than fit at first.
    let mut cloud = random_cloud(3000, 4);
    cloud.opacities.fill(0.05);
    let set = SurfelSet::new(&cloud);
    let eyes = [DVec3::new(3.0, 0.2, 0.4), DVec3::new(-0.4, 2.5, 0.3)];
    let views = eyes.map(|eye| {
        let camera = look_at(eye, DVec3::ZERO, 37, 29);
        let (seen, _) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing);
        let mut view = view(false);
        (view.normal, view.emission, view.alpha) = (None, None, None);
        view.radiance = seen.extract(|features| (features.radiance() * 1.2).to_array());
        view.camera = camera;
        Arc::new(view)
    });
    let weights = weights();
    let stage = TrainOptions::preset(Preset::Draft).radiance;
    let rates = stage.rates;
    let harmonics = HarmonicsOptions {
        degree: 1,
        ..stage.harmonics
    };
    let [at_once, one_by_one] = [false, true].map(|waits| {
        let mut state = ParameterState::new(&cloud);
        if num_lights > 1 {
            let mut other = cloud.clone();
            other.radiances.iter_mut().for_each(|r| *r *= 0.3);
            state = state.with_lights(&[other]);
            state.begin_harmonics();
        }
        let mut backend = GpuBackend::new(device, state, 1 << 20).unwrap();
        let usual = capacity(&backend, &views[0].camera);
        let mut taken = Vec::new();
        for iteration in 1..=9 {
            let index = iteration as usize % 2;
            let view = TrainingView {
                index,
                light: index % num_lights,
                view: Arc::clone(&views[index]),
                points: None,
            };
            backend.show_light(view.light).unwrap();
            let step = RadianceStep {
                iteration,
                weights: &weights,
                normals: NormalTerms::Off,
                // Buffers of another size in the end.
                antialias: iteration >= 6,
                sizes: StepSizes::radiance(&rates, 2.0, 0.1).with_harmonics(&harmonics, 0.9),
            };
            taken.extend(backend.radiance_step(&view, &step).unwrap());
            if waits {
                taken.extend(backend.finish().unwrap());
            }
            if iteration == 5 {
                assert!(waits || taken.len() < 5, "nothing is under way");
                taken.extend(backend.finish().unwrap());
                let grown = capacity(&backend, &views[0].camera);
                assert!(!usual.holds(&all_of(&grown)), "no step overflowed");
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
    if num_lights > 1 {
        let mut state = at_once.1;
        for (light, num_steps) in [4, 5].into_iter().enumerate() {
            state.show_light(light);
            assert_eq!(state.harmonics.num_steps, num_steps);
        }
    }
}

/// An edit between two steps: on the device is what it makes of the state, and the steps behind it
/// leave fixed Gaussians alone.
#[test]
fn an_edited_scene_goes_on() {
    let Some(device) = gpu::device("an edit between steps") else {
        return;
    };
    let cloud = random_cloud(200, 4);
    let mut backend = GpuBackend::new(&device, ParameterState::new(&cloud), 1 << 20).unwrap();
    let mut view = view(false);
    let (width, height) = (view.camera.width, view.camera.height);
    view.camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, width, height);
    let view = TrainingView {
        index: 0,
        light: 0,
        view: Arc::new(view),
        points: None,
    };
    let weights = weights();
    let rates = TrainOptions::preset(Preset::Draft).radiance.rates;
    let step = |backend: &mut GpuBackend, iteration| {
        let step = RadianceStep {
            iteration,
            weights: &weights,
            normals: NormalTerms::Off,
            antialias: false,
            sizes: StepSizes::radiance(&rates, 2.0, 0.1),
        };
        let mut taken = backend.radiance_step(&view, &step).unwrap();
        taken.extend(backend.finish().unwrap());
        assert!(taken.len() == 1 && taken[0].outcome.is_ok());
    };
    step(&mut backend, 1);
    let mut edited = backend.state().unwrap();
    let edit = SceneEdit {
        keep: (0..200).map(|i| i % 3 != 0).collect(),
        moved: vec![(4, cloud.get(0))],
        fixed: random_cloud(30, 5),
    };
    backend.edit(&edit, &[]).unwrap();
    edited.edit(&edit);
    assert_eq!(backend.state().unwrap(), edited);
    step(&mut backend, 2);
    let after = backend.state().unwrap();
    assert_eq!(
        (after.num_fixed, after.num_moving()),
        (30, edited.num_moving())
    );
    let first = after.num_moving();
    for (got, old) in after.raw.arrays().into_iter().zip(edited.raw.arrays()) {
        assert_eq!(got[first..], old[first..]);
        assert_ne!(got[..first], old[..first]);
    }
    backend.attribute(&view).unwrap();
    backend.densify(240).unwrap();
    let split = backend.state().unwrap();
    assert_ne!(split.raw.values, after.raw.values);
    assert_eq!(split.num_fixed, 30);
    let first_fixed = split.num_moving();
    assert_eq!(split.raw.values[first_fixed..], edited.raw.values[first..]);
}

fn capacity(backend: &GpuBackend, camera: &Camera) -> Capacity {
    let frame = backend.trainer.scene.frame(&(*camera).into()).unwrap();
    frame.unwrap().capacity
}
