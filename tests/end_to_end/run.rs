//! The whole chain from a project file.

use crate::support::Workplace;
use serde_json::Value;
use std::collections::BTreeMap;

const PROJECT: &str = r#"
out = "run"
seed = 3
dataset = "room"
[masks]
[train]
preset = "draft"
iterations = 60
albedo_iterations = 10
[render]
modes = ["0-bounce", "path"]
aov = ["albedo"]
spp = 4
[render.path]
bounces = 3
[[relight]]
name = "dim"
script = "dim.toml"
reference = "room"
[bake]
samples = 8
bounces = 2
"#;

const DIM: &str =
    "[[step]]\nselect = { emission = { min = 0.1 } }\nthen = [{ scale_light = 0.5 }]\n";

fn place() -> Workplace {
    let place = Workplace::new();
    place.write("p.toml", PROJECT);
    place.write("dim.toml", DIM);
    place
}

/// The same with its run in `run`.
fn ran() -> Workplace {
    let place = Workplace::shared("project", || {
        let place = place();
        place.succeeds("run p.toml");
        place
    });
    // Nothing runs, but a run knows where its project is.
    place.succeeds("run p.toml");
    place
}

/// Steps with the reasons they ran for, as the program tells them to machines.
fn reasons(place: &Workplace, arguments: &str) -> Vec<(String, String)> {
    let told = place.succeeds(&format!("run p.toml --json {arguments}"));
    let steps = told
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .filter(|message| message["message"] == "run-step");
    steps
        .map(|step| {
            let text = |key: &str| step[key].as_str().unwrap().to_owned();
            (text("step"), text("reason"))
        })
        .collect()
}

/// Everything but times, locks and logs.
fn results(place: &Workplace, dir: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files = place.contents(dir);
    files.retain(|name, _| {
        let kept = ["scene.ply", "metrics.json", ".exr"];
        kept.iter().any(|end| name.ends_with(end))
            || name.starts_with("edit") && name.ends_with(".ply")
    });
    // The time of a frame is part of the metrics.
    for (name, bytes) in &mut files {
        if name.ends_with("metrics.json") {
            let mut value: Value = serde_json::from_slice(bytes).unwrap();
            value["render"]["seconds_per_frame"] = Value::Null;
            *bytes = value.to_string().into_bytes();
        }
    }
    files
}

#[test]
fn only_what_has_changed_runs_again() {
    let place = place();
    let dry = place.succeeds("run p.toml --dry-run");
    let train = "    eagpt train room --out run/train --preset draft --iterations 60 \
                 --albedo-iterations 10 --seed 3 --masks run/masks\n";
    assert!(dry.contains(train), "{dry}");
    assert!(!place.path("run").exists(), "a dry run wrote something");
    assert!(
        dry.ends_with("16 of 16 steps would run; 16 of them never ran\n"),
        "{dry}"
    );

    let first = reasons(&place, "");
    let names: Vec<&str> = first.iter().map(|step| step.0.as_str()).collect();
    let wanted = [
        "masks",
        "train",
        "render/original/0-bounce",
        "render/original/path",
        "eval/original/0-bounce",
        "eval/original/path",
        "edit/dim",
        "render/dim/0-bounce",
        "render/dim/path",
        "bake/dim",
        "render/dim/baked",
        "eval/dim/0-bounce",
        "eval/dim/path",
        "eval/dim/baked",
        "table",
        "report",
    ];
    assert_eq!(names, wanted);
    assert!(first.iter().all(|step| step.1 == "new"), "{first:?}");
    let page = String::from_utf8(place.bytes("run/report.html")).unwrap();
    for part in [
        "own light, training views",
        "Light: original",
        "Light: dim",
        "baked",
        "data:image/jpeg",
        "\\toprule",
    ] {
        assert!(page.contains(part), "no `{part}` in the report");
    }
    // A record tells the command of its step.
    let record = place.json("run/render/dim/path/record.json");
    assert_eq!(record["arguments"][0], "render");
    let arguments = record["arguments"].as_array().unwrap();
    let at = arguments
        .iter()
        .position(|word| word == "--bounces")
        .unwrap();
    assert_eq!(arguments[at + 1], "3");

    let again = reasons(&place, "");
    assert!(again.iter().all(|step| step.1 == "up-to-date"), "{again:?}");

    // The numbers of the separate commands.
    place.succeeds("masks room --out masks");
    place.succeeds("train room --masks masks --preset draft --iterations 60 --albedo-iterations 10 --seed 3 --out alone");
    assert!(place.bytes("alone/scene.ply") == place.bytes("run/train/scene.ply"));

    // An option of baking concerns what is baked, and nothing before.
    place.write("p.toml", PROJECT.replace("samples = 8", "samples = 9"));
    let changed: Vec<String> = reasons(&place, "")
        .into_iter()
        .filter(|step| step.1 != "up-to-date")
        .map(|step| step.0)
        .collect();
    assert_eq!(
        changed,
        [
            "bake/dim",
            "render/dim/baked",
            "eval/dim/baked",
            "table",
            "report"
        ]
    );
    // A result that was tampered with is made again.
    place.write("run/edit/dim.ply", b"ply");
    let mended = reasons(&place, "--until edit");
    assert_eq!(mended.last().unwrap().1, "damaged");

    let forced = reasons(&place, "--from table");
    let forced: Vec<&str> = forced
        .iter()
        .filter(|step| step.1 != "up-to-date")
        .map(|step| step.0.as_str())
        .collect();
    assert_eq!(forced, ["table", "report"]);
}

#[test]
#[cfg(debug_assertions)]
fn a_killed_run_resumes_to_the_same_results() {
    let place = ran();
    let wanted = results(&place, "run");
    // In training; in the second rendering; in the comparison with references.
    for (failpoint, done, missing) in [
        ("radiance=30", "masks", "train/scene.ply"),
        (
            "rendering=3",
            "render/original/0-bounce/record.json",
            "render/original/path/record.json",
        ),
        (
            "comparing=1",
            "render/original/path/record.json",
            "eval/original/0-bounce/metrics.json",
        ),
    ] {
        place.is_killed_at(failpoint, "run p.toml --out broken");
        let has = |file: &str| place.path("broken").join(file).exists();
        assert!(has(done), "{failpoint}: no {done}");
        assert!(!has(missing), "{failpoint}: {missing}");
    }
    place.succeeds("run p.toml --out broken");
    let found = results(&place, "broken");
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(&wanted));
    for (name, bytes) in &found {
        // Paths are part of what metrics say.
        let same = if name.ends_with("metrics.json") {
            String::from_utf8_lossy(bytes)
                .replace("broken/", "run/")
                .as_bytes()
                == wanted[name]
        } else {
            *bytes == wanted[name]
        };
        assert!(same, "{name} differs");
    }
}

#[test]
fn a_run_is_verified_to_the_bit() {
    let place = ran();
    let told = place.succeeds("run --verify run");
    for product in ["train/scene.ply", "eval/dim/path/metrics.json"] {
        assert!(told.contains(&format!("same  {product}")), "{told}");
    }
    assert!(!place.path("run.verify").exists());
    // Somebody else's run.
    let mut record = place.json("run/run.json");
    record["steps"]["train"]["products"]["train/scene.ply"] = "0".repeat(64).into();
    place.write("run/run.json", record.to_string());
    let metrics = String::from_utf8(place.bytes("run/eval/original/path/metrics.json")).unwrap();
    place.write(
        "run/eval/original/path/metrics.json",
        metrics.replacen("\"psnr_srgb_db\": ", "\"psnr_srgb_db\": 1", 1),
    );
    place.write("run/run.json", record.to_string());
    let output = place.run("run --verify run --until eval");
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8(output.stdout).unwrap();
    for product in ["train/scene.ply", "eval/original/path/metrics.json"] {
        assert!(told.contains(&format!("differs  {product}")), "{told}");
    }
    assert!(told.contains("same  eval/dim/path/metrics.json"), "{told}");
    assert!(place.path("run.verify/train/scene.ply").exists());
}

#[test]
fn a_project_is_checked_before_anything_runs() {
    let place = place();
    for (from, to, parts) in [
        (
            "spp = 4",
            "spps = 4",
            vec!["p.toml: line 13: render.spps: no such option of `eagpt render`"],
        ),
        (
            "[bake]",
            "[bakes]",
            vec!["p.toml: line 20: bakes: unknown field `bakes`", "`bake`"],
        ),
        (
            "preset = \"draft\"",
            "preset = \"swift\"",
            vec![
                "p.toml: line 7: train.preset: invalid value 'swift'",
                "draft, fast, paper",
            ],
        ),
        (
            "out = \"run\"",
            "out = 3",
            vec!["p.toml: line 2: out: invalid type: integer `3`"],
        ),
        (
            "\"path\"]",
            "\"paths\"]",
            vec!["p.toml: line 11: render.modes", "`paths` is no mode"],
        ),
        (
            "script = \"dim.toml\"",
            "script = \"gone.toml\"",
            vec!["gone.toml: no such file"],
        ),
        (
            "dataset = \"room\"",
            "dataset = \"rooms\"",
            vec!["rooms", "no such f"],
        ),
        (
            "samples = 8",
            "out = \"x.ply\"",
            vec!["bake.out: no such option"],
        ),
    ] {
        place.write("p.toml", PROJECT.replace(from, to));
        place.fails_cleanly("run p.toml", &parts);
    }
    place.write("p.toml", PROJECT);
    place.fails_cleanly("run p.toml --until paint", &["`paint` is no step", "train"]);
    place.fails_cleanly("run p.toml --from table --until masks", &["comes after"]);
    place.fails_cleanly("run --verify room", &["room: no run"]);
    // Options of all modes hold for each, unless it has its own.
    place.write("p.toml", PROJECT.replace("spp = 4", "spp = 4\nseed = 5"));
    let dry = place.succeeds("run p.toml --dry-run");
    let line = |end: &str| dry.lines().find(|line| line.ends_with(end)).unwrap();
    for end in ["render/original/0-bounce", "render/original/path"] {
        let line = line(end);
        assert_eq!(line.matches("--seed 5").count(), 1, "{line}");
        assert_eq!(line.matches("--seed").count(), 1, "{line}");
    }
    assert!(line("render/original/path").contains("--bounces 3"));
    place.write("p.toml", PROJECT);
    place.succeeds("init new.toml --dataset room --preset draft");
    place.succeeds("run new.toml --dry-run");
    place.fails_cleanly("init new.toml", &["is there already"]);
}

/// From RAW brackets of a virtual room to the report, as the demo does it.
#[test]
fn a_simulated_capture_becomes_a_report() {
    let place = Workplace::new();
    let project = r#"
out = "run"
simulate = "small-room"
conditions = ["day", "evening"]
measure = "run/capture/truth/day"
[synth]
views = 10
size = "48x32"
spp = 2
[ingest]
vignetting = "-0.22,0.05,-0.01"
[poses]
model = "run/capture/colmap/sparse/0"
align = "like"
field = "like"
like = "run/capture/truth/day"
[normals]
maps = "run/capture/truth/day/Normal-exr"
space = "world"
axes = "x,y,z"
[train]
preset = "draft"
iterations = 40
albedo_iterations = 5
[render]
modes = ["0-bounce"]
aov = ["albedo"]
[[relight]]
name = "dim"
script = "dim.toml"
condition = "evening"
"#;
    place.write("p.toml", project);
    place.write("dim.toml", DIM);
    // A light of the capture is measured by its own photographs.
    place.succeeds("run p.toml --until train");
    let dataset = place.json("run/dataset/day/transforms.json");
    let truth = place.json("run/capture/truth/day/transforms.json");
    assert_eq!(dataset["frames"].as_array().unwrap().len(), 10);
    for key in ["w", "h", "fx", "fy", "cx", "cy"] {
        assert_eq!(dataset[key], truth[key], "{key}");
    }
    // Maps that the rig knows fit the world that the model was moved into.
    let reading = &place.json("run/normals/normals/report.json")["reading"];
    assert_eq!(reading["space"], "world", "{reading}");
    assert_eq!(reading["axes"], "x,y,z", "{reading}");
    let trained = place.json("run/train/record.json");
    let arguments = trained["arguments"].as_array().unwrap();
    assert!(
        arguments.iter().any(|word| word == "--normals"),
        "{arguments:?}"
    );
    let import = place.json("run/dataset/import.json");
    assert_eq!(import["alignment"]["reference"]["num_cameras"], 10);
    let without = project.replace("condition = \"evening\"", "");
    place.write("p.toml", without);
    place.succeeds("run p.toml");
    let mean = &place.json("run/eval/original/0-bounce/metrics.json")["mean"];
    assert!(
        mean["albedo_psnr_srgb_db"].as_f64().unwrap() > 5.0,
        "{mean}"
    );
    let page = String::from_utf8(place.bytes("run/report.html")).unwrap();
    assert!(page.contains("simulate") && page.contains("Light: dim"));
    // A page beside a scene is linked to, from wherever the report is.
    assert!(!page.contains("href="));
    place.succeeds("export run/edit/dim.ply --format html --out run/edit/dim.html");
    place.succeeds("report run --out reports/room.html");
    let page = String::from_utf8(place.bytes("reports/room.html")).unwrap();
    let page = page.replace("&#x2f;", "/");
    assert!(page.contains("<a href=\"../run/edit/dim.html\">edit/dim</a>"));
}
