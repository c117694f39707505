//! Every script in `examples/` can be read, and says what it does.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test ends with its first surprise"
)]

use eagpt_edit::{Script, replay};
use eagpt_scene::{Gaussians, Gloss, Harmonics, ply};
use glam::{Quat, Vec2, Vec3};
use std::path::Path;

#[test]
fn every_example_can_be_read() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let dir = tempfile::tempdir().unwrap();
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&examples).unwrap() {
        let path = entry.unwrap().path();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let name = path.file_name().unwrap().to_owned();
            std::fs::copy(&path, dir.path().join(&name)).unwrap();
            names.push(name.into_string().unwrap());
        }
    }
    assert!(names.len() >= 12, "{names:?}");
    // The lamp is imported by another script.
    let lamp = Script::read(&dir.path().join("make-lamp.toml")).unwrap();
    let lamp = replay(&lamp, Gaussians::default()).unwrap().gaussians;
    ply::write_gaussians(&dir.path().join("lamp.ply"), &lamp).unwrap();
    for name in &names {
        let script = Script::read(&dir.path().join(name));
        let script = script.unwrap_or_else(|error| panic!("{error}"));
        for (index, step) in script.steps.iter().enumerate() {
            assert!(step.title.is_some(), "{name}: step[{index}] has no title");
        }
    }
}

#[test]
fn the_lamp_is_as_high_as_its_script_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/make-lamp.toml");
    // A scene of which nothing is kept.
    let mut scene = Gaussians::default();
    scene.push(eagpt_scene::Gaussian {
        position: Vec3::new(9.0, 9.0, 9.0),
        scale: Vec2::ONE,
        rotation: Quat::IDENTITY,
        opacity: 1.0,
        radiance: Vec3::ONE,
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 1.0,
        albedo: Vec3::ONE,
    });
    let lamp = replay(&Script::read(&path).unwrap(), scene)
        .unwrap()
        .gaussians;
    let (low, high) = lamp.bounds().unwrap();
    assert!(
        low.z.abs() < 1e-6 && (high.z - 1.72).abs() < 0.01,
        "{low} {high}"
    );
    let bulb: Vec<usize> = (0..lamp.len())
        .filter(|i| lamp.emissions[*i] == 1.0)
        .collect();
    assert!(bulb.iter().all(|i| lamp.positions[*i].z > 1.47));
    assert_eq!(bulb.len(), 2500);
}
