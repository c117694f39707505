//! Finds the lamps of a trained scene: `find_lamps SCENE.ply DATASET OUT.ply`.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "an example")]

use eagpt_lamps::{Evidence, find};
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_scene::{Dataset, Gaussians, ply};
use eagpt_trace::Device;
use glam::Vec3;
use std::path::Path;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let scene = ply::read_gaussians(Path::new(&args[1])).unwrap();
    let mut dataset = Dataset::open(Path::new(&args[2])).unwrap();
    if let Some(masks) = args.get(4) {
        dataset = dataset.with_masks(Path::new(masks)).unwrap();
    }
    let split = dataset.split(SplitRule::Every8th).unwrap();
    let tracer = Device::Cpu.scene(&scene).unwrap();
    let mut evidence = Evidence::default();
    for i in split.indices(Subset::Train) {
        let view = dataset.load_view(i).unwrap();
        evidence.add(&view, &tracer.gbuffer(&view.camera).unwrap());
    }
    let started = std::time::Instant::now();
    let found = find(&evidence, &scene, Vec3::Z, &Device::Cpu).unwrap();
    for lamp in &found.lamps.lamps {
        println!(
            "{} {:?} at {:.3?} size {:.3?} z {:.2?} radiance {:.1?} power {:.2?} views {} pixels {} deviation {:.3} replaced {}",
            lamp.name,
            lamp.shape,
            lamp.centre,
            lamp.size,
            lamp.world_from_lamp() * Vec3::Z,
            lamp.radiance,
            lamp.power,
            lamp.views.len(),
            lamp.num_pixels,
            lamp.deviation,
            lamp.num_gaussians
        );
    }
    let after = found.cleared.applied(&scene);
    println!(
        "{:.1} s; removed {}, moved {}, discs {}",
        started.elapsed().as_secs_f32(),
        scene.len() - after.len(),
        found.cleared.moved.len(),
        found.discs.len()
    );
    let all: Gaussians = after.iter().chain(found.discs.iter()).collect();
    ply::write_gaussians(Path::new(&args[3]), &all).unwrap();
}
