//! `render --denoise`.

use crate::support::Workplace;
use eagpt_scene::{Image, exr};
use serde_json::Value;

const SCENE: &str = "render run/scene.ply --cameras room";
const RENDER: &str = "render run/scene.ply --cameras room --views 000 --mode path";

fn image(place: &Workplace, path: &str) -> Image<3> {
    exr::read_rgb(&place.path(path)).unwrap()
}

fn emission(place: &Workplace, path: &str) -> Image<1> {
    exr::read_single(&place.path(path)).unwrap()
}

/// The view in which emitters are largest.
fn view_with_a_lamp(place: &Workplace) -> String {
    place.succeeds(&format!(
        "{SCENE} --mode 0-bounce --split all --split-rule all --aov emission --out look"
    ));
    let lit = |view: &String| {
        let image = emission(place, &format!("look/emission/{view}.exr"));
        image.values().iter().filter(|e| **e > 0.1).count()
    };
    let views = (0..12).map(|i| format!("{i:03}"));
    views.max_by_key(lit).unwrap()
}

/// Mean squared error relative to the brightness there; a twentieth keeps black pixels from
/// deciding.
fn error(image: &Image<3>, reference: &Image<3>) -> f64 {
    let pairs = image.values().iter().zip(reference.values());
    let sum: f64 = pairs
        .map(|(a, b)| f64::from((a - b) / (b.abs() + 0.05)).powi(2))
        .sum();
    sum / image.values().len() as f64
}

#[test]
fn the_filter_denoises_all_but_emitters() {
    let place = Workplace::trained();
    let view = view_with_a_lamp(&place);
    for (out, arguments) in [
        ("noisy", "--spp 8 --seed 1 --aov emission"),
        ("clean", "--spp 8 --seed 1 --denoise filter"),
        ("more", "--spp 16 --seed 1"),
        ("reference", "--spp 128 --seed 2"),
    ] {
        place.succeeds(&format!(
            "{SCENE} --views {view} --mode path {arguments} --out {out}"
        ));
    }
    let [noisy, clean, more, reference] = ["noisy", "clean", "more", "reference"]
        .map(|dir| image(&place, &format!("{dir}/{view}.exr")));
    let errors = [&noisy, &clean, &more].map(|image| error(image, &reference));
    assert!(
        errors[1] < errors[2],
        "noisy, denoised, twice the samples: {errors:?}"
    );
    let emission = emission(&place, &format!("noisy/emission/{view}.exr"));
    let mut num = 0;
    for (i, [e]) in emission.pixels().iter().enumerate() {
        // The mask is stored with half precision.
        if *e > 0.101 {
            assert_eq!(noisy.pixels()[i], clean.pixels()[i]);
            num += 1;
        }
    }
    assert!(num > 0, "the lamp is in view");

    let record = place.json("clean/record.json");
    assert_eq!(
        record["options"]["denoise"],
        serde_json::json!({"asked": "filter", "ran": {"name": "filter"}})
    );
    assert!(record["seconds"]["denoising"].is_number());
    let record = place.json("noisy/record.json");
    assert_eq!(record["options"]["denoise"]["ran"], Value::Null);
    assert!(record["seconds"]["denoising"].is_null());
}

#[test]
fn auto_runs_something_and_threads_do_not_matter() {
    let place = Workplace::trained();
    for (threads, denoise) in [(1, "auto"), (2, "auto"), (1, "filter"), (2, "filter")] {
        place.succeeds(&format!(
            "{RENDER} --spp 4 --denoise {denoise} --threads {threads} --out {denoise}{threads}"
        ));
    }
    for denoise in ["auto", "filter"] {
        let [one, two] = [1, 2].map(|n| place.bytes(&format!("{denoise}{n}/000.exr")));
        assert_eq!(one, two, "{denoise}");
    }
    let ran = place.json("auto1/record.json")["options"]["denoise"]["ran"].clone();
    match ran["name"].as_str().unwrap() {
        "oidn" => {
            assert!(ran["version"].as_str().unwrap().starts_with("2."));
            assert!(ran["library"].is_string());
        }
        name => assert_eq!(name, "filter"),
    }
}

#[test]
fn one_bounce_is_denoised_and_zero_bounces_are_not() {
    let place = Workplace::trained();
    let render = "render run/scene.ply --cameras room --views 000 --spp 4";
    for mode in ["0-bounce", "1-bounce"] {
        place.succeeds(&format!("{render} --mode {mode} --out {mode}"));
        place.succeeds(&format!(
            "{render} --mode {mode} --denoise filter --out {mode}-clean"
        ));
    }
    let same = |mode: &str| {
        place.bytes(&format!("{mode}/000.exr")) == place.bytes(&format!("{mode}-clean/000.exr"))
    };
    assert!(same("0-bounce") && !same("1-bounce"));
    let record = place.json("0-bounce-clean/record.json");
    assert_eq!(record["options"]["denoise"]["asked"], "filter");
    assert_eq!(record["options"]["denoise"]["ran"], Value::Null);
    assert!(record["warnings"].to_string().contains("--denoise"));
}

#[test]
fn a_missing_library_is_one_line() {
    let place = Workplace::trained();
    place.write("text.so", "no library");
    std::fs::create_dir(place.path("empty")).unwrap();
    for denoise in ["oidn", "auto"] {
        for path in ["nowhere", "empty", "text.so"] {
            place.fails_cleanly(
                &format!("{RENDER} --denoise {denoise} --oidn {path} --out out"),
                &["Open Image Denoise", path],
            );
        }
    }
    place.fails_cleanly(
        &format!("{RENDER} --denoise filter --oidn nowhere --out out"),
        &["--oidn", "nowhere", "--denoise"],
    );
}
