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
use eagpt_scene::{Gaussians, Lamp, LampShape, Lamps, LightBasis, LightGroups};
use glam::{Quat, Vec3};

/// A ball of size 0.5 around a disc of the row.
fn ball(name: &str, x: f32) -> Lamp {
    let frame = (Vec3::new(x, 0.0, 1.0), Quat::IDENTITY, Vec3::splat(0.5));
    Lamp {
        name: name.to_owned(),
        ..Lamp::unmeasured(LampShape::Ball, frame, (0.8, Vec3::new(1.0, 2.0, 3.0)))
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

/// Of the row the light of the lamps "ceiling-2" and "wall" and of the rest, at x = 2, 3 and 0; the
/// disc at x = 1 reflects 1, 2 and 4 of them.
fn basis() -> LightBasis {
    let groups = LightGroups::new(&scene(), &lamps()).unwrap();
    assert_eq!(groups.names, ["ceiling-2", "wall", "rest"]);
    let mut reflected = vec![Vec3::ZERO; 4 * 3];
    for (k, light) in [1.0, 2.0, 4.0].into_iter().enumerate() {
        reflected[3 + k] = Vec3::splat(light);
    }
    LightBasis::new(&scene(), &groups, &reflected)
}

fn set(text: &str) -> eagpt_scene::Result<Edited> {
    let mut script = Folder::new().read(text)?;
    assert!(script.needs_basis());
    script.set_basis(basis())?;
    replay(&script, scene())
}

#[test]
fn lights_are_set_by_name() {
    let own = Vec3::new(1.0, 2.0, 3.0);
    for (lights, factors, selected) in [
        ("{ wall = 2 }", [1.0, 2.0, 1.0], 1),
        ("{ \"*\" = 0.5, rest = 0 }", [0.5, 0.5, 0.0], 3),
        ("{ rest = 3, \"*\" = 0.5 }", [0.5, 0.5, 3.0], 3),
        ("{ \"c*\" = 0, \"w*\" = 0 }", [0.0, 0.0, 1.0], 2),
    ] {
        let found = set(&format!("[[step]]\nset_light = {lights}\n")).unwrap();
        let [ceiling, wall, rest] = factors;
        let reflected = ceiling + 2.0 * wall + 4.0 * rest;
        let expected = [
            rest * own,
            Vec3::splat(reflected),
            ceiling * own,
            wall * own,
        ];
        assert_eq!(found.gaussians.radiances, expected, "{lights}");
        let step = &found.steps[0];
        assert_eq!((step.source, step.num_selected), ("set_light", selected));
        let basis = found.basis.unwrap();
        let now = basis.lights().iter().map(|light| light.factor.x);
        assert!(now.eq(factors), "{lights}");
    }
    // A colour, then again; what emits is what the step goes on with.
    let text = "[[step]]\nset_light = { wall = [1, 0.5, 0] }\n\
                [[step]]\nset_light = { rest = 0 }\n\
                [[step]]\nset_light = { \"ceiling-*\" = 0 }\nthen = [\"make_not_emissive\", { set_albedo = 0.7 }]\n";
    let found = set(text).unwrap();
    let reflecting = Vec3::new(2.0, 1.0, 0.0);
    assert_eq!(found.gaussians.radiances[1], reflecting);
    assert_eq!(found.gaussians.emissions, [1.0, 0.05, 0.0, 1.0]);
    // It is the light of another scene now.
    assert_eq!(found.basis, None);
}

#[test]
fn lights_that_cannot_be_set_are_told() {
    for (text, parts) in [
        (
            "[[step]]\nset_light = { window = 1 }",
            [
                "line 2",
                "`window` is no light: there are ceiling-2, wall, rest",
            ],
        ),
        (
            "[[step]]\nset_light = { \"c*\" = 1, \"*2\" = 0 }",
            ["line 2", "`ceiling-2` is set by `*2` too"],
        ),
        (
            "[[step]]\nset_light = { wall = -1 }",
            ["set_light.wall", "-1 is negative"],
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ set_albedo = 0.5 }]\n[[step]]\nset_light = { wall = 1 }",
            ["line 5: step[1].set_light", "a scene with other albedos"],
        ),
        (
            "[[step]]\nselect = { emission = { min = 0.5 } }\nthen = [{ scale_light = 2 }]\n[[step]]\nset_light = { wall = 1 }",
            ["line 5: step[1].set_light", "emitters have another light"],
        ),
        (
            "[[step]]\nset_light = { wall = 1 }\ninsert.ball = { centre = [0, 0, 0], radius = 1, albedo = 1 }",
            ["step[0]", "one too many"],
        ),
    ] {
        let message = set(text).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    }
    let script = Folder::new()
        .read("[[step]]\nset_light = { wall = 1 }")
        .unwrap();
    let message = replay(&script, scene()).unwrap_err().to_string();
    assert!(message.contains("by its lamps is not known"), "{message}");
}
