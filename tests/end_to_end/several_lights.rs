//! Training on datasets of one place in several lights.

use crate::support::Workplace;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::lamps::EMISSION_THRESHOLD;
use eagpt_scene::{Gaussians, ply};

/// Power of a lamp beside another one.
const DIM: f32 = 0.01;

const SHORT: &str =
    "--preset draft --iterations 40 --albedo-iterations 4 --set output.checkpoint_every=20";

/// A room by day and in the evening, of whose two lamps each shines in one of them.
fn workplace() -> Workplace {
    Workplace::shared("two-lights", || {
        let place = Workplace::empty();
        place.succeeds(
            "synth small-room --out room --parts truth --size 48x32 --views 8 --spp 4 --points 900",
        );
        place.succeeds(&format!(
            "train room/truth/day room/truth/evening --out run {SHORT}"
        ));
        place
    })
}

fn scene(place: &Workplace, path: &str) -> Gaussians {
    ply::read_gaussians(&place.path(path)).unwrap()
}

fn num_emitting(scene: &Gaussians) -> usize {
    let emitting = scene.emissions.iter().filter(|e| **e > EMISSION_THRESHOLD);
    emitting.count()
}

/// Same geometry and albedo, another light.
#[test]
fn lights_share_geometry_and_albedo() {
    let place = workplace();
    let [day, evening, all] = [
        "run/scene.ply",
        "run/lights/evening/scene.ply",
        "run/all-lamps/scene.ply",
    ]
    .map(|path| scene(&place, path));
    for other in [&evening, &all] {
        assert_eq!(day.positions, other.positions);
        assert_eq!(day.rotations, other.rotations);
        assert_eq!(day.opacities, other.opacities);
        assert_eq!(day.albedos, other.albedos);
    }
    assert_ne!(day.radiances, evening.radiances);
    // Every lamp is one of the lamps of all lights.
    let shines_in = |scene: &Gaussians, i: usize| scene.emissions[i] > EMISSION_THRESHOLD;
    for i in 0..all.len() {
        let any = shines_in(&day, i) || shines_in(&evening, i);
        assert_eq!(shines_in(&all, i), any, "{i}");
    }
    assert!(num_emitting(&day) > 0 && num_emitting(&evening) > 0);
    let listed = |path: &str| place.json(path)["lamps"].as_array().unwrap().len();
    let all = listed("run/all-lamps/lamps.json");
    assert!(all >= listed("run/lamps.json").max(listed("run/lights/evening/lamps.json")));
    let record = place.json("run/record.json");
    assert_eq!(record["inputs"].as_array().unwrap().len(), 6);
}

/// A lamp that is dimmer than surfaces which another lamp lights is found where that one is alone.
#[test]
fn lamps_are_found_by_comparison_with_a_light_that_has_them_off() {
    let place = workplace();
    let cameras = place.path("room/truth/day/transforms.json");
    std::fs::create_dir_all(place.path("both/Radiance-exr")).unwrap();
    std::fs::copy(cameras, place.path("both/transforms.json")).unwrap();
    let radiance = |light: &str, name: &str| {
        exr::read_rgb(&place.path(&format!("{light}/Radiance-exr/{name}"))).unwrap()
    };
    let names: Vec<String> = std::fs::read_dir(place.path("room/truth/day/Radiance-exr"))
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    for name in &names {
        let mut both = radiance("room/truth/day", name);
        let evening = radiance("room/truth/evening", name);
        for (sum, lamp) in both.pixels_mut().iter_mut().zip(evening.pixels()) {
            *sum = std::array::from_fn(|c| sum[c] + DIM * lamp[c]);
        }
        let path = place.path(&format!("both/Radiance-exr/{name}"));
        exr::write_rgb(&path, &both, Precision::Float).unwrap();
    }
    place.succeeds("masks both --off room/truth/day --out compared");
    place.succeeds("masks both --out alone");
    // Each lamp is dark in the light of the other.
    place.succeeds("masks room/truth/evening --off room/truth/day --out evening");
    let mask = |path: &str, name: &str| {
        let mask = exr::read_single(&place.path(&format!("{path}/Emissive-exr/{name}"))).unwrap();
        mask.values().iter().map(|m| *m > 0.5).collect::<Vec<_>>()
    };
    let overlap = |path: &str| {
        let (mut both, mut either) = (0, 0);
        for name in &names {
            let pairs = mask(path, name).into_iter();
            for (found, lamp) in pairs.zip(mask("room/truth/evening", name)) {
                both += u32::from(found && lamp);
                either += u32::from(found || lamp);
            }
        }
        f64::from(both) / f64::from(either)
    };
    let [compared, alone, evening] = ["compared", "alone", "evening"].map(overlap);
    // Of a hundred pixels many are at a border.
    assert!(compared >= 0.8, "{compared}");
    assert!(evening >= 0.8, "{evening}");
    assert!(alone < 0.1, "{alone}");
    let record = place.json("compared/masks.record.json");
    assert_eq!(
        record["options"]["off"],
        serde_json::json!(["room/truth/day"])
    );
    place.succeeds(
        "synth small-room --out other --parts truth --size 40x32 --views 8 --spp 1 --points 9",
    );
    place.fails(
        "masks both --off other/truth/day --out strange",
        &[
            "other/truth/day/transforms.json",
            "no view has a camera of",
            "both",
        ],
    );
}

/// A run that is stopped between lights goes on with the light that it was in.
#[test]
fn a_resumed_run_of_two_lights_is_bit_identical() {
    let place = workplace();
    let checkpoints = place.path("run/checkpoints");
    for name in ["radiance-000040", "albedo-000008"] {
        std::fs::remove_file(checkpoints.join(format!("{name}.ckpt"))).unwrap();
    }
    let before = place.contents("run");
    place.succeeds("train room/truth/day room/truth/evening --out run --resume");
    for name in [
        "scene.ply",
        "lights/evening/scene.ply",
        "all-lamps/scene.ply",
    ] {
        assert_eq!(place.bytes(&format!("run/{name}")), before[name], "{name}");
    }
    place.fails(
        "train room/truth/day --out run --resume",
        &["another dataset"],
    );
}

#[test]
fn lights_that_cannot_be_told_apart_are_errors() {
    let place = workplace();
    place.fails(
        &format!("train room/truth/day room/truth/day --out two {SHORT}"),
        &["room/truth/day", "another light is called \"day\""],
    );
    place.fails(
        &format!("train room/truth/day room/truth/dusk --out two {SHORT}"),
        &["room/truth/dusk"],
    );
    place.fails(
        &format!(
            "train room/truth/day room/truth/evening --start run/scene.ply --stage albedo \
             --out two {SHORT}"
        ),
        &["run/scene.ply", "has one light", "evening"],
    );
    assert!(!place.path("two").exists());
}

/// On a GPU, too, every light has lamps of its own, and geometry and albedo are those of all.
#[test]
fn two_lights_are_trained_on_a_gpu() {
    let place = workplace();
    if !crate::device::has_device(&place, "training in two lights by the program") {
        return;
    }
    place.succeeds(&format!(
        "train room/truth/day room/truth/evening --out on-gpu --device gpu {SHORT}"
    ));
    let device = &place.json("on-gpu/record.json")["device"];
    assert!(device.as_str().unwrap().starts_with("gpu: "), "{device}");
    let [day, evening] =
        ["on-gpu/scene.ply", "on-gpu/lights/evening/scene.ply"].map(|path| scene(&place, path));
    assert!(num_emitting(&day) > 0 && num_emitting(&evening) > 0);
    assert_ne!(day.emissions, evening.emissions);
    assert_eq!(day.positions, evening.positions);
    assert_eq!(day.albedos, evening.albedos);
    assert_ne!(day.radiances, evening.radiances);
}

/// A light that is left out is a mix of the lamps of the others.
#[test]
fn a_light_that_is_held_out_is_shown_by_switching_lamps() {
    let place = workplace();
    let lights = "room/truth/day room/truth/evening";
    let run = format!("train {lights} --test-condition evening --out one {SHORT} --json");
    let told = place.succeeds(&run);
    assert!(told.contains("\"message\":\"test_condition\""), "{told}");
    let relit = &place.json("one/record.json")["measured"]["test_condition"];
    assert!(!relit["factors"].as_array().unwrap().is_empty(), "{relit}");
    assert_eq!(relit["fitted"].as_array().unwrap().len(), 3);
    assert!(place.path("one/relit/evening.ply").exists());
    assert!(!place.path("one/lights").exists());
    let record = place.json("one/record.json");
    assert_eq!(record["inputs"].as_array().unwrap().len(), 3);

    place.write("lights.toml", "[lights]\nevening = { \"*\" = 0.5 }\n");
    place.succeeds(&format!("{run} --lights lights.toml --force"));
    let relit = &place.json("one/record.json")["measured"]["test_condition"];
    assert_eq!(relit["fitted"], serde_json::json!([]));
    for factor in relit["factors"].as_array().unwrap() {
        assert_eq!(factor[1], serde_json::json!([0.5, 0.5, 0.5]));
    }
    let compared = &relit["compared"];
    assert!(
        compared["psnr_srgb_db"].as_f64().unwrap() > 5.0,
        "{compared}"
    );

    // The results of an earlier run are not those of the next.
    place.succeeds(&format!("train room/truth/day --out one {SHORT} --force"));
    assert!(!place.path("one/relit").exists());

    place.fails(
        &format!("train {lights} --test-condition dusk --out two {SHORT}"),
        &["--test-condition dusk: no folder of room/truth/day"],
    );
    place.write("night.toml", "[lights]\nnight = {}\n");
    place.fails(
        &format!("train {lights} --test-condition evening --lights night.toml --out two {SHORT}"),
        &["night.toml", "`evening` is missing"],
    );
}

/// A project trains on two lights, each with masks of its own, and changes the light of a scene in
/// which the lamps of both are on.
#[test]
fn a_project_trains_on_several_lights() {
    let place = workplace();
    place.write(
        "p.toml",
        r#"
out = "project"
dataset = "room/truth/day"
other_lights = ["room/truth/evening"]
[masks]
threshold = 8
[train]
preset = "draft"
iterations = 40
albedo_iterations = 4
[render]
modes = ["0-bounce"]
[[relight]]
name = "evening"
script = "off.toml"
reference = "room/truth/evening"
[bake]
samples = 8
bounces = 2
"#,
    );
    place.write(
        "off.toml",
        "[[step]]\nselect = { half_space = { point = [0, 0, 2], normal = \"z\" } }\n\
         then = [\"make_not_emissive\"]\n",
    );
    place.succeeds("run p.toml");
    for light in ["day", "evening"] {
        assert!(
            place
                .path(&format!("project/masks/{light}/Emissive-exr"))
                .is_dir()
        );
    }
    let edited = place.json("project/edit/evening.record.json");
    assert_eq!(
        edited["inputs"][0]["path"],
        "project/train/all-lamps/scene.ply"
    );
    // The lamp in the ceiling is off, the other one on.
    let emitting = num_emitting(&scene(&place, "project/edit/evening.ply"));
    let all = num_emitting(&scene(&place, "project/train/all-lamps/scene.ply"));
    assert!(emitting > 0 && emitting < all, "{emitting} of {all}");
    let metrics = place.json("project/eval/evening/baked/metrics.json");
    assert!(metrics["mean"]["psnr_srgb_db"].as_f64().unwrap() > 5.0);
    let report = std::fs::read_to_string(place.path("project/report.html")).unwrap();
    for light in ["day", "evening"] {
        assert!(report.contains(&format!("Emission masks: {light}")));
    }
    let again = place.succeeds("run p.toml --dry-run");
    assert!(again.ends_with("\n0 of 13 steps would run\n"), "{again}");

    // Rows of the paper's tables are of the same training.
    let dry = place.succeeds("paper p.toml --rows baked --out tables --dry-run");
    let root = "/p/scenes/full/seed-0/train/all-lamps/scene.ply";
    assert!(dry.contains(root), "{dry}");

    place.write(
        "twice.toml",
        "dataset = \"room/truth/day\"\nother_lights = [\"room/truth/day\"]\n",
    );
    place.fails(
        "run twice.toml",
        &["twice.toml", "line 2", "other_lights[0]", "`day`"],
    );
}

/// With several lights, masks of one of them are not those of another.
#[test]
fn masks_of_several_lights_are_in_folders_of_their_names() {
    let place = workplace();
    let train = format!("train room/truth/day room/truth/evening --out two --masks m {SHORT}");
    place.succeeds("masks room/truth/day --threshold 8 --out m/day");
    place.fails(&train, &["m/evening/Emissive-exr"]);
    assert!(!place.path("two").exists());
}
