//! Lamps by name, on a row of four discs at x = 0, 1, 2, 3 and height 1, of which some emit.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    dead_code,
    reason = "a test ends with its first surprise; helpers are shared with other tests"
)]

mod common;

use common::{Folder, row};
use eagpt_edit::{Edited, replay};
use eagpt_scene::{Gaussians, Lamp, LampShape, Lamps};

/// A ball of size 0.5 around a disc of the row.
fn ball(name: &str, x: f32) -> Lamp {
    Lamp {
        name: name.to_owned(),
        shape: LampShape::Ball,
        centre: [x, 0.0, 1.0],
        rotation: [1.0, 0.0, 0.0, 0.0],
        size: [0.5; 3],
        one_sided: false,
        area: 0.8,
        radiance: [1.0, 2.0, 3.0],
        power: [2.5, 5.0, 7.5],
        num_gaussians: 1,
        views: vec!["000".to_owned()],
        num_pixels: 10,
        deviation: 0.0,
        factor: [1.0; 3],
    }
}

fn lamps() -> Lamps {
    let lamps = vec![
        ball("ceiling-1", 1.0),
        ball("ceiling-2", 2.0),
        ball("wall", 3.0),
    ];
    Lamps { lamps }
}

/// The row with emitters at x = 0, 2 and 3.
fn scene() -> Gaussians {
    let mut scene = row();
    scene.emissions = vec![1.0, 0.05, 0.9, 1.0];
    scene
}

fn edited(text: &str) -> eagpt_scene::Result<Edited> {
    let mut script = Folder::new().read(text)?;
    assert!(script.needs_lamps());
    script.set_lamps(lamps())?;
    replay(&script, scene())
}

#[test]
fn a_lamp_is_what_emits_in_its_place() {
    for (select, expected) in [
        ("{ lamp = \"ceiling-2\" }", vec![2.0]),
        // The disc in the first one does not emit, and the one at 0 is in no lamp.
        ("{ lamp = \"ceiling-*\" }", vec![2.0]),
        ("{ lamp = \"*\" }", vec![2.0, 3.0]),
        ("{ not = { lamp = \"*\" } }", vec![0.0, 1.0]),
        ("{ lamp = \"*\", emission = { min = 0.95 } }", vec![3.0]),
        ("\"named\"", vec![3.0]),
    ] {
        let text = format!(
            "[selections]\nnamed = {{ lamp = \"wall\" }}\n[[step]]\nselect = {select}\nthen = [\"keep_only\"]"
        );
        let found = edited(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
        let xs: Vec<f32> = found.gaussians.positions.iter().map(|p| p.x).collect();
        assert_eq!(xs, expected, "{select}");
        assert_eq!(found.selections[0].num_selected, 1);
    }
}

#[test]
fn places_stay_where_training_found_the_lamps() {
    let select = "[[step]]\nselect = { lamp = \"wall\" }\n";
    let text = format!(
        "{select}then = [{{ move = [-3, 0, 0] }}]\nas = \"moved\"\n\
         {select}allow_empty = true\nthen = [\"remove\"]\n\
         [[step]]\nselect = \"moved\"\nthen = [\"lights_off\"]\n"
    );
    let found = edited(&text).unwrap();
    let nums: Vec<usize> = found.steps.iter().map(|step| step.num_selected).collect();
    assert_eq!(nums, [1, 0, 1]);
    assert_eq!(found.gaussians.emissions[3], 0.0);
}

#[test]
fn names_that_no_lamp_has_are_told_with_those_there_are() {
    let text = "[[step]]\nselect = { lamp = \"ceiling-3\" }\nthen = [\"remove\"]";
    let message = edited(text).unwrap_err().to_string();
    for part in [
        "a.toml: line 2: step[0].select.lamp: `ceiling-3` is no lamp",
        "there are ceiling-1, ceiling-2, wall",
    ] {
        assert!(message.contains(part), "{message}");
    }
    let folder = Folder::new();
    let mut script = folder.read(text).unwrap();
    let message = replay(&script, scene()).unwrap_err().to_string();
    assert!(
        message.contains("lamps of the scene are not known"),
        "{message}"
    );
    let message = script.set_lamps(Lamps::default()).unwrap_err().to_string();
    assert!(
        message.ends_with("is no lamp: the scene has none"),
        "{message}"
    );
    let plain = folder.read("[[step]]\nselect = \"everything\"\nthen = [\"remove\"]");
    assert!(!plain.unwrap().needs_lamps());
    let import = "[[step]]\nimport = { file = \"row.ply\", select = { lamp = \"*\" } }";
    let message = folder.read(import).unwrap_err().to_string();
    assert!(
        message.contains("step[0].import.select: refers to lamps"),
        "{message}"
    );
}
