//! The light of a scene by its lamps: `bake --per-light` and what reads it.

use crate::support::Workplace;
use eagpt_scene::{Gaussians, Lamp, LampShape, LightBasis, lamps, ply};
use glam::{Quat, Vec3};

/// A ball of light that a script inserts, as a lamp.
fn ball(name: &str, centre: [f32; 3], radius: f32) -> Lamp {
    let frame = (centre.into(), Quat::IDENTITY, Vec3::splat(2.0 * radius));
    Lamp {
        name: name.to_owned(),
        power: [1.0, 2.0, 4.0],
        ..Lamp::unmeasured(LampShape::Ball, frame, (1.0, Vec3::ONE))
    }
}

/// A room with three balls of light: `edits/lit.ply`, two of them in `edits/lamps.json`; baked with
/// the light of each, `baked.ply` and `baked.lights`.
pub(crate) fn workplace() -> Workplace {
    Workplace::shared("light-basis", || {
        let place = Workplace::trained();
        let balls = [
            ([-0.5, 0.3, 1.0], "[3, 2, 1]"),
            ([0.6, 0.0, 1.3], "4"),
            ([0.0, -0.6, 0.8], "2"),
        ];
        let inserted = balls.map(|(centre, radiance)| {
            format!("[[step]]\ninsert = {{ ball = {{ centre = {centre:?}, radius = 0.15, radiance = {radiance} }} }}\n")
        });
        let off = "[[step]]\nselect = { emission = { min = 0.1 } }\nthen = [\"lights_off\", { set_albedo = 0.5 }]\n";
        place.write("lit.toml", off.to_owned() + &inserted.concat());
        std::fs::create_dir(place.path("edits")).unwrap();
        place.succeeds("edit run/scene.ply lit.toml --out edits/lit.ply");
        let list = eagpt_scene::Lamps {
            lamps: vec![
                ball("left", balls[0].0, 0.15),
                ball("right", balls[1].0, 0.15),
            ],
        };
        lamps::write_lamps(&place.path("edits/lamps.json"), &list).unwrap();
        place
            .succeeds("bake edits/lit.ply --cameras room --samples 32 --out baked.ply --per-light");
        place
    })
}

fn scene(place: &Workplace, name: &str) -> Gaussians {
    ply::read_gaussians(&place.path(name)).unwrap()
}

fn close(found: &[Vec3], expected: &[Vec3], relative: f32) {
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        let off = (*found - *expected).abs().max_element();
        assert!(
            off <= relative * expected.max_element(),
            "{i}: {found} not {expected}"
        );
    }
}

/// The light of all lamps is a plain bake; that of one what a bake gives of it alone.
#[test]
fn lamps_add_up_to_the_bake() {
    let place = workplace();
    place.succeeds("bake edits/lit.ply --cameras room --samples 32 --out plain.ply");
    assert_eq!(place.bytes("plain.ply"), place.bytes("baked.ply"));
    assert!(!place.path("plain.lights").exists());
    let outputs = &place.json("baked.record.json")["outputs"];
    assert_eq!(*outputs, serde_json::json!(["baked.ply", "baked.lights"]));
    let baked = scene(&place, "baked.ply");
    let basis = LightBasis::read(&place.path("baked.lights")).unwrap();
    let names: Vec<&str> = basis
        .lights()
        .iter()
        .map(|light| light.name.as_str())
        .collect();
    assert_eq!(names, ["left", "right", "rest"]);
    basis.check(&baked).unwrap();
    close(&basis.radiances(), &baked.radiances, 1e-3);

    // The same rays with two lamps dark: they are smoothed by what they tell of themselves.
    let dark = "[[step]]\nselect = { any = [{ lamp = \"right\" }, { sphere = { centre = [0, -0.6, 0.8], radius = 0.2 }, emission = { min = 0.1 } }] }
then = [{ scale_light = 0 }]\n";
    place.write("dark.toml", dark);
    place.succeeds("edit edits/lit.ply dark.toml --out left.ply");
    place.succeeds("bake left.ply --cameras room --samples 256 --out left-baked.ply");
    let left = scene(&place, "left-baked.ply");
    let alone = basis.alone(0);
    let mean = |of: &[Vec3]| -> Vec3 {
        let dark = of.iter().zip(&baked.emissions).filter(|(_, e)| **e <= 0.1);
        dark.map(|(light, _)| *light).sum::<Vec3>() / of.len() as f32
    };
    let off = mean(&alone) / mean(&left.radiances) - Vec3::ONE;
    assert!(off.abs().max_element() < 0.03, "{off}");

    // Without the option, what an earlier bake has left goes.
    place.succeeds("bake edits/lit.ply --cameras room --samples 8 --out baked.ply --force");
    assert!(!place.path("baked.lights").exists());
}

/// Rays that are kept serve the light of each lamp as well.
#[test]
fn a_transport_matrix_serves_lamps() {
    let place = workplace();
    let bake = "bake edits/lit.ply --cameras room --samples 32 --transport k.transport";
    place.succeeds(&format!("{bake} --out first.ply"));
    place.succeeds(&format!("{bake} --out second.ply --per-light"));
    assert_is_of_emitters(&place, "second");
    assert_eq!(place.bytes("second.lights"), place.bytes("baked.lights"));
}

/// Asserts that a bake with 32 samples has traced rays from emitters alone.
fn assert_is_of_emitters(place: &Workplace, name: &str) {
    let emissions = scene(place, &format!("{name}.ply")).emissions;
    let num_emitters = emissions.iter().filter(|&&emission| emission > 0.1).count() as u64;
    let num_rays = place.json(&format!("{name}.record.json"))["options"]["num_rays"].as_u64();
    let num_rays = num_rays.expect("a record counts rays");
    assert!(
        (1..=32 * num_emitters).contains(&num_rays),
        "{num_rays} of {num_emitters}"
    );
}

/// Rays that were traced for all light serve a weak lamp as well, and all light is that of these
/// rays.
#[test]
fn a_transport_matrix_serves_a_weak_lamp() {
    let place = workplace();
    let weak = "[[step]]\nselect = { lamp = \"right\" }\nthen = [{ scale_light = 0.15 }]\n";
    place.write("weak.toml", weak);
    place.succeeds("edit edits/lit.ply weak.toml --out edits/weak.ply");
    let bake = "bake edits/weak.ply --cameras room --samples 32 --transport weak.transport";
    place.succeeds(&format!("{bake} --out all.ply"));
    place.succeeds(&format!(
        "{bake} --out lamps.ply --per-light --lamps edits/lamps.json"
    ));
    assert_is_of_emitters(&place, "lamps");
    assert_eq!(place.bytes("lamps.ply"), place.bytes("all.ply"));
}

#[test]
fn what_has_no_lamps_is_told() {
    let place = workplace();
    place.fails(
        "bake baked.ply --cameras room --out b.ply --per-light",
        &["lamps.json: no such file"],
    );
    place.fails(
        "bake baked.ply --cameras room --out b.ply --per-light --method views",
        &["--per-light", "--method gaussians"],
    );
    let mut list = lamps::read_lamps(&place.path("edits/lamps.json")).unwrap();
    list.lamps[1].name = "rest".to_owned();
    lamps::write_lamps(&place.path("mine.json"), &list).unwrap();
    place.fails(
        "bake baked.ply --cameras room --out b.ply --per-light --lamps mine.json",
        &["mine.json: name: `rest`"],
    );
    std::fs::write(place.path("b.lights"), "mine").unwrap();
    place.fails(
        "bake edits/lit.ply --cameras room --out b.ply",
        &["b.lights", "--force"],
    );
}

/// Lights are set by scripts and at rendering, one after the other, without a ray.
#[test]
fn lights_are_set_in_scripts_and_renderings() {
    let place = workplace();
    let basis = LightBasis::read(&place.path("baked.lights")).unwrap();
    place.write("double.toml", "[[step]]\nset_light = { \"*\" = 2 }\n");
    place.succeeds("edit baked.ply double.toml --out double.ply");
    let double = scene(&place, "double.ply");
    let expected: Vec<Vec3> = basis.radiances().iter().map(|light| 2.0 * *light).collect();
    assert_eq!(double.radiances, expected);
    let record = place.json("double.record.json");
    assert_eq!(record["options"]["lights"], "baked.lights");
    assert_eq!(
        record["outputs"],
        serde_json::json!(["double.ply", "double.lights"])
    );

    place.write(
        "mix.toml",
        "[[step]]\nset_light = { \"*\" = 0, left = [1, 0.8, 0.6], rest = 0.25 }\n",
    );
    place.succeeds("edit double.ply mix.toml --out mix.ply");
    let mix = scene(&place, "mix.ply");
    let [left, rest] = [basis.alone(0), basis.alone(2)];
    let expected: Vec<Vec3> = (left.iter().zip(&rest))
        .map(|(left, rest)| Vec3::new(1.0, 0.8, 0.6) * *left + 0.25 * *rest)
        .collect();
    close(&mix.radiances, &expected, 1e-6);

    // Rendered without an edit: the same pictures.
    let render = "--cameras room --split test --mode 0-bounce";
    place.succeeds(&format!("render mix.ply {render} --out mix"));
    place.succeeds(&format!(
        "render baked.ply {render} --set-light *=0 --set-light left=1,0.8,0.6 --set-light rest=0.25 --out set"
    ));
    assert_eq!(place.bytes("mix/000.exr"), place.bytes("set/000.exr"));
    let record = place.json("set/record.json");
    assert_eq!(record["options"]["set_light"][1], "left=1,0.8,0.6");
    assert_eq!(record["inputs"][2]["path"], "baked.lights");
    place.fails(
        &format!("render baked.ply {render} --set-light lamp=0 --out none"),
        &[
            "--set-light",
            "`lamp` is no light: there are left, right, rest",
        ],
    );
    place.fails(
        &format!("render mix.ply {render} --set-light left=0 --lights baked.lights --out none"),
        &["baked.lights", "another light"],
    );
    place.fails(
        "edit edits/lit.ply mix.toml --out none.ply",
        &["mix.toml: sets lights", "edits/lit.lights: no such file"],
    );
    // A basis that no longer is the light of the scene goes.
    place.write(
        "grey.toml",
        "[[step]]\nselect = \"everything\"\nthen = [{ set_albedo = 0.5 }]\n",
    );
    place.succeeds("edit mix.ply grey.toml --out double.ply --force");
    assert!(!place.path("double.lights").exists());
}

/// A mix that is photographed is found again, as a script that gives the scene that light.
#[test]
fn lights_are_fitted_to_photographs() {
    let place = workplace();
    let dataset = |name: &str, lights: &str| {
        let out = format!("{name}/Radiance-exr");
        place.succeeds(&format!(
            "render baked.ply --cameras room --split all --mode 0-bounce --antialias 1 {lights} --out {out}"
        ));
        let cameras = std::fs::read(place.path("room/transforms.json")).unwrap();
        std::fs::write(place.path(&format!("{name}/transforms.json")), cameras).unwrap();
    };
    dataset(
        "evening",
        "--set-light left=0.5,1,2 --set-light right=0 --set-light rest=3",
    );
    dataset("day", "");
    let fit = "lamps fit baked.ply --reference evening";
    let told = place.succeeds(&format!("{fit} --out evening.toml"));
    assert!(
        told.contains("left") && told.contains("0.500 1.000 2.000"),
        "{told}"
    );
    assert!(told.contains("0.0 % of the light of"), "{told}");
    place.succeeds("edit baked.ply evening.toml --out evening.ply");
    let mut basis = LightBasis::read(&place.path("baked.lights")).unwrap();
    let mix = [Vec3::new(0.5, 1.0, 2.0), Vec3::ZERO, Vec3::splat(3.0)];
    for (k, factor) in mix.into_iter().enumerate() {
        basis.set_factor(k, factor);
    }
    // The script has five digits.
    close(
        &scene(&place, "evening.ply").radiances,
        &basis.radiances(),
        1e-3,
    );

    let told = place.succeeds(&format!("{fit} --before day --views 001,004 --json"));
    let done: serde_json::Value = serde_json::from_str(told.lines().last().unwrap()).unwrap();
    let lights = done["lights"].as_array().unwrap();
    assert_eq!(lights.len(), 3);
    for (light, factor) in lights.iter().zip(mix) {
        for channel in 0..3 {
            let found = light["factor"][channel].as_f64().unwrap() as f32;
            assert!((found - factor[channel]).abs() < 2e-3, "{light}");
            let before = light["before"][channel].as_f64().unwrap();
            assert!((before - 1.0).abs() < 2e-3, "{light}");
        }
    }
    place.fails(
        &format!("{fit} --out evening.toml"),
        &["evening.toml", "--force"],
    );
    place.fails(
        &format!("{fit} --out baked.lights --force"),
        &["baked.lights", "an input"],
    );
    place.fails(
        &format!("{fit} --num-views 99"),
        &[
            "evening/transforms.json",
            "99 views are asked for, there are 12",
        ],
    );
    place.fails(
        "lamps fit run/scene.ply --reference evening --lights baked.lights",
        &["baked.lights: scene: of a scene of"],
    );
}
