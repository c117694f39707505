//! `eagpt paper`: rows, seeds and lights of a small room in one table.

use crate::support::Workplace;
use serde_json::Value;

const PROJECT: &str = r#"
dataset = "room"
[train]
preset = "draft"
iterations = 40
albedo_iterations = 10
[render]
spp = 2
antialias = 1
[[relight]]
name = "ball"
script = "ball.toml"
reference = "room"
[bake]
samples = 8
bounces = 2
"#;

const BALL: &str =
    "[[step]]\ninsert = { ball = { centre = [0, 0, 1], radius = 0.3, radiance = 5 } }\n";

fn place() -> Workplace {
    let place = Workplace::new();
    place.write("p.toml", PROJECT);
    place.write("ball.toml", BALL);
    place
}

/// The cells of a table without times and folders.
fn cells(place: &Workplace, table: &str) -> Vec<Value> {
    let table = place.json(&format!("{table}/table.json"));
    let mut cells = table["cells"].as_array().unwrap().clone();
    for cell in &mut cells {
        cell["folders"] = Value::Null;
        cell["values"]["seconds_per_frame"] = Value::Null;
    }
    cells
}

#[test]
fn rows_and_seeds_become_a_table_and_resume() {
    let place = place();
    let paper = "paper b-kitchen=p.toml --rows baked,0-bounce,bounces-3 --seeds 1,2";
    let dry = place.succeeds(&format!("{paper} --out whole --dry-run"));
    assert!(
        dry.contains("2 scenes to train, 8 projects in all, 0 of them done"),
        "{dry}"
    );
    assert!(!place.path("whole").exists());
    let told = place.succeeds(&format!("{paper} --out whole"));
    assert!(
        told.contains("| bounces-3 |") && told.contains(" ± "),
        "{told}"
    );
    let found = cells(&place, "whole/b-kitchen/table");
    let names: Vec<(&str, &str)> = found
        .iter()
        .map(|cell| {
            (
                cell["row"].as_str().unwrap(),
                cell["condition"].as_str().unwrap(),
            )
        })
        .collect();
    let wanted = [
        ("0-bounce", "original"),
        ("0-bounce", "ball"),
        ("baked", "ball"),
        ("bounces-3", "original"),
        ("bounces-3", "ball"),
    ];
    assert_eq!(names, wanted);
    let psnr = &found[0]["values"]["psnr_srgb_db"];
    let values: Vec<f64> = (psnr["values"].as_array().unwrap().iter())
        .map(|value| value.as_f64().unwrap())
        .collect();
    assert_eq!(values.len(), 2);
    let mean = (values[0] + values[1]) / 2.0;
    assert!((psnr["mean"].as_f64().unwrap() - mean).abs() < 1e-9);
    // Of two values, the deviation of the sample is their distance over the root of two.
    let sd = (values[0] - values[1]).abs() / 2.0_f64.sqrt();
    assert!((psnr["sd"].as_f64().unwrap() - sd).abs() < 1e-9);
    assert_eq!(found[0]["published"]["psnr_srgb_db"], 37.57);
    assert_eq!(found[2]["published"]["psnr_srgb_db"], 28.97);
    // The row is that of its own project, and its scene that of the other rows.
    let row = "whole/b-kitchen/rows/bounces-3/seed-2";
    let metrics = place.json(&format!("{row}/eval/ball/path/metrics.json"));
    assert_eq!(
        metrics["mean"]["psnr_srgb_db"],
        found[4]["values"]["psnr_srgb_db"]["values"][1]
    );
    let record = place.json(&format!("{row}/render/original/path/record.json"));
    assert_eq!(record["options"]["integrator"]["max_bounces"], 3);
    assert!(!place.path(&format!("{row}/train")).exists());
    // Everything is there: nothing is trained or rendered again, and a row's project is one of
    // `eagpt run`.
    let scene = place.path("whole/b-kitchen/scenes/full/seed-1/train/scene.ply");
    let before = std::fs::metadata(&scene).unwrap().modified().unwrap();
    let again = place.succeeds(&format!("{paper} --out whole --json"));
    let ran = |line: &&str| line.contains("run-step") && !line.contains("up-to-date");
    assert_eq!(again.lines().find(ran), None);
    assert_eq!(
        std::fs::metadata(&scene).unwrap().modified().unwrap(),
        before
    );
    place.succeeds(&format!("run {row}.toml"));

    // In parts, one of them killed, to the same numbers.
    let part = |part: &str| format!("{paper} --out parts --shard {part}");
    #[cfg(debug_assertions)]
    place.is_killed_at("rendering=2", &part("2/2"));
    place.succeeds(&part("2/2"));
    place.fails(
        &format!("{paper} --out parts"),
        &["parts: shard-1-of-2.record.json is missing"],
    );
    place.succeeds(&part("1/2"));
    place.succeeds(&format!("{paper} --out parts"));
    assert_eq!(cells(&place, "parts/b-kitchen/table"), found);
}

#[test]
fn what_cannot_be_made_is_told_before_anything_is() {
    let place = place();
    for (arguments, parts) in [
        (
            "paper p.toml p.toml",
            vec!["two datasets are called `p`", "NAME=DATASET"],
        ),
        ("paper gone", vec!["gone"]),
        ("paper room --metrics psnr", vec!["psnr"]),
    ] {
        place.fails_cleanly(&format!("{arguments} --rows 0-bounce"), &parts);
    }
    place.write(
        "c.toml",
        PROJECT.replace("dataset = \"room\"", "capture = \"room\""),
    );
    place.fails_cleanly("paper c.toml", &["c.toml: capture", "`eagpt run`"]);
    place.write("c.toml", PROJECT.replace("spp = 2", "spps = 2"));
    place.fails_cleanly(
        "paper c.toml",
        &["spps", "no such option of `eagpt render`"],
    );
    assert_eq!(
        place.run("paper room --rows 2-bounce").status.code(),
        Some(2)
    );
    // A folder takes the sections of a project, and an ablation its own.
    let told = place.succeeds(
        "paper room --config p.toml --rows inaccurate-masks,no-normal-consistency --dry-run",
    );
    assert!(told.contains("--grow 4"), "{told}");
    assert!(
        told.contains("--set radiance.weights.depth_normal=0"),
        "{told}"
    );
    assert!(told.contains("--iterations 40"), "{told}");
}
