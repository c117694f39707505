//! Scripts on a row of four discs at x = 0, 1, 2, 3 and height 1, the last of them an emitter: what
//! comes out is known.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test ends with its first surprise"
)]

mod common;

use common::{Folder, disc, row};
use eagpt_edit::Edited;
use eagpt_scene::{Gaussian, Gaussians, Gloss};
use glam::{Quat, Vec2, Vec3};
use std::f32::consts::FRAC_PI_2;

/// The disc at x = 3, as the row has it.
fn lamp() -> Gaussian {
    row().get(3)
}

fn xs(gaussians: &Gaussians) -> Vec<f32> {
    gaussians.positions.iter().map(|p| p.x).collect()
}

/// Replays one step on what `select` finds.
#[track_caller]
fn step(select: &str, then: &str) -> Edited {
    Folder::new().edited(&format!("[[step]]\nselect = {select}\nthen = [{then}]"))
}

#[test]
fn every_selector_finds_its_discs() {
    for (select, expected) in [
        ("\"everything\"", vec![0.0, 1.0, 2.0, 3.0]),
        (
            "{ box = { min = [0.5, -1, 0], max = [2.5, 1, 2] } }",
            vec![1.0, 2.0],
        ),
        // Turned by 90°, its long side lies along x.
        (
            "{ box = { centre = [1, 0, 1], size = [0.5, 2.5, 1], rotate = { axis = \"z\", degrees = 90 } } }",
            vec![0.0, 1.0, 2.0],
        ),
        (
            "{ sphere = { centre = [2, 0, 1], radius = 1 } }",
            vec![1.0, 2.0, 3.0],
        ),
        (
            "{ half_space = { point = [1.5, 9, 9], normal = \"-x\" } }",
            vec![0.0, 1.0],
        ),
        (
            "{ cylinder = { from = [-1, 0, 1], to = [1.5, 0, 1], radius = 0.1 } }",
            vec![0.0, 1.0],
        ),
        ("{ emission = { min = 0.1 } }", vec![3.0]),
        (
            "{ emission = { max = 0.1 }, half_space = { point = [0.5, 0, 0], normal = \"x\" } }",
            vec![1.0, 2.0],
        ),
        (
            "{ opacity = { min = 0.9 }, size = { max = 0.15 } }",
            vec![0.0, 1.0, 2.0, 3.0],
        ),
        (
            "{ cluster = { seed = [0.1, 0, 1], radius = 1.1 } }",
            vec![0.0, 1.0, 2.0, 3.0],
        ),
        (
            "{ cluster = { seed = [0.1, 0, 1], radius = 1.1, within = { emission = { max = 0.5 } } } }",
            vec![0.0, 1.0, 2.0],
        ),
        (
            "{ not = { any = [ { emission = { min = 0.1 } }, { sphere = { centre = [1, 0, 1], radius = 0.1 } } ] } }",
            vec![0.0, 2.0],
        ),
        (
            "{ all = [ \"everything\", { emission = { min = 0.1 } } ] }",
            vec![3.0],
        ),
    ] {
        assert_eq!(
            xs(&step(select, "\"keep_only\"").gaussians),
            expected,
            "{select}"
        );
    }
}

#[test]
fn actions_on_light_and_material() {
    let lamp_with = |radiance: [f32; 3], emission: f32| Gaussian {
        radiance: radiance.into(),
        emission,
        ..lamp()
    };
    for (then, expected) in [
        ("\"lights_off\"", lamp_with([0.0; 3], 0.0)),
        ("\"make_not_emissive\"", lamp_with([1.0, 2.0, 3.0], 0.0)),
        ("{ scale_light = 2 }", lamp_with([2.0, 4.0, 6.0], 1.0)),
        (
            "{ scale_light = [1, 0.5, 0] }",
            lamp_with([1.0, 1.0, 0.0], 1.0),
        ),
        (
            "{ set_radiance = [7, 8, 9] }, \"make_emissive\"",
            lamp_with([7.0, 8.0, 9.0], 1.0),
        ),
        (
            "{ set_albedo = 0.5 }",
            Gaussian {
                albedo: Vec3::splat(0.5),
                ..lamp()
            },
        ),
        (
            "{ set_specular = [0.04, 0.05, 0.06] }, { set_roughness = 0.25 }",
            Gaussian {
                gloss: Gloss {
                    specular: Vec3::new(0.04, 0.05, 0.06),
                    roughness: 0.25,
                },
                ..lamp()
            },
        ),
        (
            "{ metal = { color = [0.9, 0.7, 0.3] } }",
            Gaussian {
                albedo: Vec3::ZERO,
                gloss: Gloss {
                    specular: Vec3::new(0.9, 0.7, 0.3),
                    roughness: 0.2,
                },
                ..lamp()
            },
        ),
        (
            "{ swap_albedo = \"bgr\" }, { scale_albedo = 2 }",
            Gaussian {
                albedo: Vec3::new(0.6, 0.4, 0.2),
                ..lamp()
            },
        ),
    ] {
        let edited = step("{ emission = { min = 0.5 } }", then).gaussians;
        let expected: Gaussians = row().iter().take(3).chain([expected]).collect();
        assert_eq!(edited, expected, "{then}");
    }
    let removed = step("{ emission = { min = 0.5 } }", "\"remove\"").gaussians;
    assert_eq!(removed, row().iter().take(3).collect());
}

#[test]
fn every_spelling_of_a_number_counts() {
    let then = "{ set_radiance = [1_0, 0x1F, +2_0.5e1] }, { scale_light = [1, 1.0, 1e-1] }";
    let edited = step("{ emission = { min = 5e-1 } }", then).gaussians;
    let error = edited.radiances[3] - Vec3::new(10.0, 31.0, 20.5);
    assert!(error.length() < 1e-5, "{error}");
}

#[test]
fn placements_turn_and_scale_the_gaussians_too() {
    // About the middle of the row, x = 1.5, by 90° about z.
    let edited = step(
        "\"everything\"",
        "{ rotate = { axis = \"z\", degrees = 90 } }",
    );
    let quarter = Quat::from_rotation_z(FRAC_PI_2);
    for (i, g) in edited.gaussians.iter().enumerate() {
        let expected = Vec3::new(1.5, i as f32 - 1.5, 1.0);
        assert!((g.position - expected).length() < 1e-5, "{g:?}");
        assert!(g.rotation.abs_diff_eq(quarter, 1e-6), "{g:?}");
    }
    let edited = step(
        "\"everything\"",
        "{ scale = { factor = 2, about = [0, 0, 1] } }",
    );
    assert_eq!(xs(&edited.gaussians), [0.0, 2.0, 4.0, 6.0]);
    assert_eq!(edited.gaussians.scales[2], Vec2::new(0.2, 0.4));
    let edited = step(
        "\"everything\"",
        "{ place = { about = \"base\", to = [0, 0, 0] } }",
    );
    assert_eq!(xs(&edited.gaussians), [-1.5, -0.5, 0.5, 1.5]);
    assert!(edited.gaussians.positions.iter().all(|p| p.z == 0.0));
    let edited = step("\"everything\"", "{ snap_to_floor = 0.25 }");
    assert_eq!(edited.gaussians.positions[3], Vec3::new(3.0, 0.0, 0.25));
    let edited = Folder::new()
        .edited("up = \"-x\"\n[[step]]\nselect = \"everything\"\nthen = [{ snap_to_floor = 0 }]");
    assert_eq!(xs(&edited.gaussians), [-3.0, -2.0, -1.0, 0.0]);
}

#[test]
fn a_duplicate_is_what_later_actions_and_names_mean() {
    let edited = Folder::new().edited(
        "[[step]]
         select = { sphere = { centre = [0, 0, 1], radius = 0.5 } }
         then = [{ duplicate = { move = [0, 5, 0] } }, { set_albedo = 1 }]
         as = \"copy\"
         [[step]]
         select = { emission = { min = 0.5 } }
         then = [\"remove\"]
         [[step]]
         select = \"copy\"
         then = [{ move = [0, 0, 1] }]",
    );
    let copy = Gaussian {
        albedo: Vec3::ONE,
        ..disc(0.0, 5.0, 2.0)
    };
    let expected: Gaussians = row().iter().take(3).chain([copy]).collect();
    assert_eq!(edited.gaussians, expected);
    let report = &edited.steps[2];
    assert_eq!((report.num_selected, report.num_gaussians), (1, 4));
    assert_eq!(report.bounds, Some([[0.0, 5.0, 1.0]; 2]));
    assert_eq!(report.bounds_after, Some([[0.0, 5.0, 2.0]; 2]));
    assert_eq!(edited.steps[1].bounds_after, None);
}

#[test]
fn imports_and_inserts_are_added_at_the_end() {
    let edited = Folder::new().edited(
        "[[step]]
         import = { file = \"row.ply\", select = { emission = { min = 0.5 } }, scale = 2, to = [0, 0, 9] }
         [[step]]
         insert = { ball = { centre = [0, 0, 5], radius = 1, radiance = [1, 2, 3] } }
         as = \"ball\"
         [[step]]
         select = \"ball\"
         then = [{ scale_light = 2 }]",
    );
    let imported = Gaussian {
        position: Vec3::new(0.0, 0.0, 9.0),
        scale: Vec2::new(0.2, 0.4),
        ..lamp()
    };
    assert_eq!(edited.gaussians.get(4), imported);
    assert_eq!(edited.gaussians.len(), 2505);
    for g in edited.gaussians.iter().skip(5) {
        assert_eq!((g.emission, g.radiance), (1.0, Vec3::new(2.0, 4.0, 6.0)));
    }
    let sources: Vec<&str> = edited.steps.iter().map(|step| step.source).collect();
    assert_eq!(sources, ["import", "insert", "select"]);
}

#[test]
fn trimming_acts_on_the_side_that_stays() {
    // Discs of 3σ = 0.3 along x; the plane x = 1.2 is within that of the disc at 1 only.
    let plane = |normal: &str, trim: &str, then: &str| {
        Folder::new().edited(&format!(
            "[[step]]\nselect.half_space = {{ point = [1.2, 0, 0], normal = \"{normal}\" }}\n{trim}\nthen = [\"{then}\"]"
        ))
    };
    let shrink = "trim = \"shrink\"";
    // The disc at x = 1 stays either way, once selected and once not.
    for edited in [
        plane("x", shrink, "remove"),
        plane("-x", shrink, "keep_only"),
    ] {
        assert_eq!(
            (edited.steps[0].num_shrunk, edited.steps[0].num_dropped),
            (1, 0)
        );
        assert_eq!(edited.gaussians.len(), 2);
        let cut = edited.gaussians.get(1);
        // Of 0.3 on either side 0.2 remain ahead.
        assert!((cut.position.x - 0.95).abs() < 0.01, "{cut:?}");
        assert!((cut.scale.x - 0.25 / 3.0).abs() < 0.005, "{cut:?}");
        assert_eq!(edited.gaussians.get(0), disc(0.0, 0.0, 1.0));
    }
    assert_eq!(
        xs(&plane("x", "trim = \"drop\"", "remove").gaussians),
        [0.0]
    );
    assert_eq!(xs(&plane("x", "", "remove").gaussians), [0.0, 1.0]);
    // Gaussians that are removed with the rest are not trimmed first.
    assert_eq!(plane("x", shrink, "keep_only").steps[0].num_shrunk, 0);
}

#[test]
fn a_trimmed_copy_leaves_the_original_whole() {
    let select = "{ half_space = { point = [1.2, 0, 0], normal = \"-x\" } }";
    let copied = Folder::new().edited(&format!(
        "[[step]]\nselect = {select}\ntrim = \"shrink\"\nthen = [{{ duplicate = {{ move = [0, 0, 1] }} }}]"
    ));
    let imported = Folder::new().edited(&format!(
        "[[step]]\nimport = {{ file = \"row.ply\", select = {select}, move = [0, 0, 1] }}\ntrim = \"shrink\""
    ));
    for edited in [copied, imported] {
        let gaussians = &edited.gaussians;
        assert_eq!(gaussians.iter().take(4).collect::<Gaussians>(), row());
        assert_eq!(gaussians.get(4), disc(0.0, 0.0, 2.0));
        assert!((gaussians.get(5).scale.x - 0.25 / 3.0).abs() < 0.005);
        assert_eq!((gaussians.len(), edited.steps[0].num_shrunk), (6, 1));
    }
}

#[test]
fn nothing_selected_is_allowed_where_the_script_says_so() {
    let text = |allow: &str| {
        format!(
            "[[step]]\nselect.emission = {{ min = 0.2, max = 0.3 }}\n{allow}then = [{{ move = [1, 0, 0] }}, {{ snap_to_floor = 0 }}]"
        )
    };
    let edited = Folder::new().edited(&text("allow_empty = true\n"));
    assert_eq!(edited.gaussians, row());
    assert_eq!(
        (edited.steps[0].num_selected, edited.steps[0].bounds),
        (0, None)
    );
    let refused = Folder::new().replay(&text("")).unwrap_err().to_string();
    assert!(
        refused.contains("line 2: step[0].select: selects nothing"),
        "{refused}"
    );
}

#[test]
fn a_replay_gives_the_same_bits() {
    let folder = Folder::new();
    let text = "[selections]
        near = { cluster = { seed = [0, 0, 1], radius = 1.5 } }
        [[step]]
        insert.box = { centre = [1, 1, 1], size = [1, 1, 1], albedo = 0.5, rotate = { axis = [1, 2, 3], degrees = 33 } }
        as = \"box\"
        [[step]]
        select = { any = [\"near\", \"box\"] }
        then = [{ duplicate = { rotate = { axis = \"y\", degrees = 12.5 }, scale = 0.7 } }]";
    let (first, second) = (folder.edited(text), folder.edited(text));
    assert_eq!(first, second);
    assert_eq!(first.selections[0].name, "near");
    let script = folder.read(text).unwrap();
    assert_eq!(script.blake3.len(), 64);
    assert_ne!(
        folder.read(&format!("{text}\n")).unwrap().blake3,
        script.blake3
    );
}
