//! The light of stage 1, gathered on a device, against that of the CPU.

#![cfg(feature = "gpu")]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a test fails by panicking, and says if it was skipped"
)]

#[path = "../../trace/tests/gpu/mod.rs"]
mod gpu;
#[path = "../../trace/tests/gpu/room.rs"]
mod room;

use eagpt_testkit::gaussians::look_at;
use eagpt_trace::Device;
use eagpt_train::backend;
use eagpt_train::params::ParameterState;
use glam::DVec3;

const NUM_SAMPLES: u32 = 64;

/// Of an albedo: twenty times the 5e-7 seen on lavapipe. Rounding chooses among the discs of a flat
/// wall, but all of a wall carry the same light.
const TOLERANCE: f32 = 1e-5;
/// Part of the albedos that may be off by more: a ray at the rim of a disc may find another wall
/// behind it. None did on lavapipe.
const MOST_FLIPPED: f32 = 0.01;

#[test]
fn albedos_to_start_from_are_those_of_the_cpu() {
    let Some(device) = gpu::device("light for stage 1") else {
        return;
    };
    let state = ParameterState::new(&room::lit_room());
    let cameras = [
        look_at(DVec3::ZERO, DVec3::new(0.2, -1.0, -0.6), 24, 24),
        look_at(DVec3::ZERO, DVec3::new(-1.0, 0.3, 0.1), 24, 24),
    ];
    let [cpu, on_device] = [Device::Cpu, Device::Gpu(device)].map(|device| {
        let mut backend = backend::new(&device, state.clone(), 0).unwrap();
        let num = backend.begin_gathering(&cameras).unwrap();
        for start in (0..num).step_by(100) {
            let range = start..num.min(start + 100);
            backend.gather(range, NUM_SAMPLES, 5).unwrap();
        }
        backend.begin_albedo(&[]).unwrap();
        (num, backend.state().unwrap().gaussians().albedos)
    });
    assert!(cpu.0 > 100 && cpu.0 == on_device.0);
    let before = state.gaussians().albedos;
    let num_set = before.iter().zip(&cpu.1).filter(|(a, b)| a != b).count();
    assert!(num_set > 100, "{num_set}");
    let pairs = cpu.1.iter().zip(&on_device.1);
    let off: Vec<f32> = pairs.map(|(a, b)| (*a - *b).abs().max_element()).collect();
    let worst = off.iter().fold(0.0_f32, |most, &off| most.max(off));
    let mean = off.iter().sum::<f32>() / num_set as f32;
    eprintln!("albedos of {num_set} off by {mean:e}, at most {worst:e}");
    let num_off = off.iter().filter(|&&off| off > TOLERANCE).count();
    assert!(num_off as f32 <= MOST_FLIPPED * num_set as f32, "{num_off}");
}
