//! The transport matrix traced on a device against that of the CPU engine.

mod gpu;
#[path = "gpu/receivers.rs"]
mod receivers;
#[path = "gpu/room.rs"]
mod room;

use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussian, Gaussians, random_cloud};
use eagpt_testkit::gaussians::{material, sphere};
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::gpu::GpuScene;
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::light_list::LightList;
use eagpt_trace::transport::matrix::{
    Directions, Groups, NOTHING, Receiver, Tracing, TransportMatrix,
};
use glam::{EulerRot, Quat, Vec3};
use receivers::receivers;
use room::lit_room;

fn key() -> RandomKey {
    RandomKey::new(7, Purpose::Bake, 1)
}

fn trace(scene: &impl Tracer, receivers: &[Receiver], directions: Directions) -> TransportMatrix {
    scene
        .trace_transport(receivers, directions, key())
        .expect("the device works")
}

/// `scene` with its Gaussians tilted by some degrees and moved a little: flat walls have discs at
/// the same distance, of which rounding chooses.
fn uneven(scene: &Gaussians) -> Gaussians {
    let key = RandomKey::new(3, Purpose::Initialise, 0);
    (0..)
        .zip(scene.iter())
        .map(|(i, g)| {
            let centred = |number: f32| 2.0 * number - 1.0;
            let [x, y, z, w] = key.stream(i, 0).next_uniforms().map(centred);
            let size = (g.scale.x * g.scale.y).sqrt();
            Gaussian {
                position: g.position + 0.1 * size * Vec3::new(x, y, z),
                rotation: g.rotation * Quat::from_euler(EulerRot::XYZ, 0.1 * z, 0.1 * w, 0.0),
                ..g
            }
        })
        .collect()
}

/// Part of the directions whose target may differ: rays at the rim of a disc, or through two discs
/// at nearly the same distance. None of 20,000 did on lavapipe.
const MOST_FLIPPED: f64 = 1e-3;

/// Of the light of emitters at a receiver, relative to the mean over receivers: ten times the 3e-6
/// seen on lavapipe.
const LIGHT_TOLERANCE: f32 = 3e-5;

/// Holds `got` against `wanted`, but for as many flips as there may be.
#[allow(clippy::print_stderr, reason = "says how far off it is")]
fn compare(what: &str, got: &TransportMatrix, wanted: &TransportMatrix, tolerance: f32) {
    assert_eq!(got.targets.len(), wanted.targets.len(), "{what}");
    assert_eq!(got.direct.len(), wanted.direct.len(), "{what}");
    let most = |num: usize| 1.0 + MOST_FLIPPED * num as f64;
    assert_eq!(got.light_targets.len(), wanted.light_targets.len());
    let targets = got.targets.iter().chain(&got.light_targets);
    let pairs = targets.zip(wanted.targets.iter().chain(&wanted.light_targets));
    let num_flipped = pairs.filter(|(a, b)| a != b).count();

    let light = wanted.direct.iter().map(|light| light.max_element());
    let scale = (light.sum::<f32>() / wanted.direct.len() as f32).max(f32::MIN_POSITIVE);
    let pairs = got.direct.iter().zip(&wanted.direct);
    let off: Vec<f32> = pairs
        .map(|(a, b)| (*a - *b).abs().max_element() / scale)
        .collect();
    let num_off = off.iter().filter(|&&off| off > tolerance).count();
    let worst = off.into_iter().fold(0.0, f32::max);
    let num_rays = wanted.num_rays as usize;
    eprintln!("{what}: {num_flipped} of {num_rays} rays flipped, light off by at most {worst:e}");
    // A direction towards an emitter that is flipped changes the light of its receiver alone.
    assert!((num_flipped as f64) < most(num_rays), "{what}");
    assert!((num_off as f64) < most(num_rays), "{what}: {num_off} off");
    // Directions along the surface may fall to either side of it.
    let rays_off = got.num_rays.abs_diff(wanted.num_rays);
    assert!((rays_off as f64) < most(num_rays), "{what}: {rays_off}");
}

/// The same random numbers, directions and discs: what differs is rounding.
#[test]
fn entries_and_light_are_those_of_the_cpu() {
    let Some(device) = gpu::device("matrix") else {
        return;
    };
    for (name, scene, directions) in [
        ("room", uneven(&lit_room()), Directions::divided(32, 2)),
        ("cloud", random_cloud(700, 3), Directions::divided(64, 4)),
    ] {
        let receivers = receivers(&scene);
        let on_device = GpuScene::new(&device, &scene).unwrap();
        let got = trace(&on_device, &receivers, directions);
        let wanted = trace(&CpuScene::new(&scene), &receivers, directions);
        let num_met = wanted.targets.iter().filter(|&&i| i != NOTHING).count();
        assert!(num_met > 100 && wanted.direct.iter().any(|light| light.x > 0.0));
        compare(name, &got, &wanted, LIGHT_TOLERANCE);
    }
}

/// Entries of a device with the weights of the host: the light of groups of emitters adds up to
/// what the device has found.
#[test]
fn groups_of_emitters_add_up_to_the_light_of_the_device() {
    let Some(device) = gpu::device("groups of emitters") else {
        return;
    };
    let scene = uneven(&lit_room());
    let receivers = receivers(&scene);
    let directions = Directions::divided(32, 2);
    let matrix = trace(
        &GpuScene::new(&device, &scene).unwrap(),
        &receivers,
        directions,
    );
    let lights = LightList::new(&SurfelSet::new(&scene));
    let tracing = Tracing {
        receivers: &receivers,
        directions,
        key: key(),
        lights: lights.as_ref(),
    };
    let side = |position: &Vec3| u32::from(position.x > 0.0);
    let of: Vec<u32> = scene.positions.iter().map(side).collect();
    let apart = matrix.direct_of_groups(&tracing, &scene.radiances, Groups { num: 2, of: &of });
    assert!(
        [0, 1].map(|k| apart.iter().skip(k).step_by(2).any(|light| light.x > 0.0)) == [true; 2]
    );
    let sums = apart.chunks_exact(2).map(|row| row[0] + row[1]).collect();
    let together = TransportMatrix {
        direct: sums,
        ..matrix.clone()
    };
    compare("groups", &together, &matrix, LIGHT_TOLERANCE);
}

/// More directions than a dispatch takes. Features of 33,500 values in another order: their
/// rounding is seen at 1e-5.
#[test]
fn any_number_of_directions_is_followed() {
    let Some(device) = gpu::device("many directions") else {
        return;
    };
    let scene = uneven(&lit_room());
    let receivers = &receivers(&scene)[..2];
    let directions = Directions {
        bsdf: 17_000,
        to_lights: 16_500,
    };
    let on_device = GpuScene::new(&device, &scene).unwrap();
    let got = trace(&on_device, receivers, directions);
    let wanted = trace(&CpuScene::new(&scene), receivers, directions);
    compare("many directions", &got, &wanted, 1e-4);
}

/// The same bits in every run, with whatever receivers are traced together, and after the scene was
/// another one.
#[test]
fn entries_are_repeatable() {
    let Some(device) = gpu::device("repeatable matrix") else {
        return;
    };
    let scene = uneven(&lit_room());
    let receivers = receivers(&scene);
    let directions = Directions::divided(20, 3);
    let on_device = GpuScene::new(&device, &scene).unwrap();
    let together = trace(&on_device, &receivers, directions);
    assert!(together == trace(&on_device, &receivers, directions));

    let mut other = GpuScene::new(&device, &lit_room()).unwrap();
    assert!(together != trace(&other, &receivers, directions));
    other.update(&scene).unwrap();
    let mut pieces = TransportMatrix::default();
    for some in receivers.chunks(100) {
        pieces.append(trace(&other, some, directions));
    }
    assert!(together == pieces);
    assert_eq!(trace(&other, &[], directions), TransportMatrix::default());
}

/// Without emitters there is no light, and no direction towards any is followed.
#[test]
fn what_nothing_lights_has_entries_all_the_same() {
    let Some(device) = gpu::device("matrix in the dark") else {
        return;
    };
    let scene = sphere(600, 1.0, |_| material(Vec3::ONE, 0.0, Vec3::ONE));
    let receivers = receivers(&scene);
    let directions = Directions::divided(32, 2);
    let on_device = GpuScene::new(&device, &scene).unwrap();
    let got = trace(&on_device, &receivers, directions);
    assert!(got.direct.iter().all(|light| *light == Vec3::ZERO));
    assert_eq!(got.num_rays, 16 * 600);
    let wanted = trace(&CpuScene::new(&scene), &receivers, directions);
    compare("in the dark", &got, &wanted, LIGHT_TOLERANCE);
}
