//! The Snakemake workflow makes what one process makes.

use crate::support::Workplace;
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Names the program `snakemake`, where it is not found by that name.
const SNAKEMAKE: &str = "EAGPT_SNAKEMAKE";

/// A capture of a virtual room, from its brackets to the report.
const PROJECT: &str = r#"
out = "run"
simulate = "small-room"
conditions = ["day", "evening"]
other_lights = ["evening"]
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
like = "run/capture/truth/day"
[masks]
threshold = 8
[train]
preset = "draft"
iterations = 40
albedo_iterations = 5
[render]
modes = ["0-bounce", "path"]
aov = ["albedo"]
spp = 2
[[relight]]
name = "ball"
script = "ball.toml"
reference = "run/capture/truth/evening"
[bake]
method = "views"
spp = 2
iterations = 5
"#;

const BALL: &str =
    "[[step]]\ninsert = { ball = { centre = [0, 0, 1], radius = 0.3, radiance = 5 } }\n";

/// The program, or `None` after telling that there is none. Past the harness: tests that pass are
/// shown without their output.
fn snakemake() -> Option<PathBuf> {
    let named = std::env::var_os(SNAKEMAKE).map(PathBuf::from);
    let path = named.unwrap_or_else(|| "snakemake".into());
    let mut version = Command::new(&path);
    version.arg("--version").stdout(Stdio::null());
    if version.status().is_ok_and(|status| status.success()) {
        return Some(path);
    }
    let notice = format!(
        "skipped: the_workflow_makes_what_one_process_makes: no {} ({SNAKEMAKE} names it)\n",
        path.display()
    );
    std::io::stderr().write_all(notice.as_bytes()).unwrap();
    None
}

/// A file of JSON without what is another in every run: times and the name of the folder.
fn lasting(place: &Workplace, file: &str) -> Value {
    fn forget(value: &mut Value) {
        match value {
            Value::Object(object) => {
                object.retain(|key, _| key != "seconds_per_frame");
                object.values_mut().for_each(forget);
            }
            Value::Array(values) => values.iter_mut().for_each(forget),
            _ => {}
        }
    }
    let text = String::from_utf8(place.bytes(file)).unwrap();
    let text = text.replace("parts/run/", "run/");
    let mut value = serde_json::from_str(&text).unwrap();
    forget(&mut value);
    value
}

#[test]
fn the_workflow_makes_what_one_process_makes() {
    let Some(snakemake) = snakemake() else { return };
    let place = Workplace::new();
    place.write("p.toml", PROJECT);
    place.write("ball.toml", BALL);
    std::fs::create_dir(place.path("parts")).unwrap();
    place.write("parts/p.toml", PROJECT);
    place.write("parts/ball.toml", BALL);
    place.succeeds("run p.toml");

    let workflow = Path::new(env!("CARGO_MANIFEST_DIR")).join("workflow/Snakefile");
    let work = |more: &[&str]| {
        let output = Command::new(&snakemake)
            .arg("--snakefile")
            .arg(&workflow)
            .args(["--cores", "4", "--config", "project=parts/p.toml"])
            .arg(format!("eagpt={}", env!("CARGO_BIN_EXE_eagpt")))
            .args(more)
            .current_dir(place.path(""))
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let told = [&output.stderr, &output.stdout].map(|bytes| String::from_utf8_lossy(bytes));
        let told = told.join("\n");
        assert!(output.status.success(), "{told}");
        told
    };
    work(&[]);
    let files = place.names("run");
    let mut num_compared = 0;
    for file in files.iter().filter(|file| {
        let kept = [
            "metrics.json",
            "table/table.json",
            "scene.ply",
            ".exr",
            "ball.ply",
        ];
        kept.iter().any(|end| file.ends_with(end))
    }) {
        let [one, other] = ["run", "parts/run"].map(|dir| format!("{dir}/{file}"));
        if file.ends_with(".json") {
            assert_eq!(lasting(&place, &one), lasting(&place, &other), "{file}");
        } else {
            assert!(place.bytes(&one) == place.bytes(&other), "{file} differs");
        }
        num_compared += 1;
    }
    assert!(num_compared > 50, "{num_compared}");
    // It is a run like any other.
    let told = place.succeeds("run parts/p.toml --json");
    for step in told.lines().filter(|line| line.contains("run-step")) {
        assert!(step.contains("up-to-date"), "{step}");
    }
    assert!(work(&[]).contains("Nothing to be done"));
    // Steps with a changed option are done again, and those that follow from them.
    place.write(
        "parts/p.toml",
        PROJECT
            .replace("iterations = 5\n", "iterations = 6\n")
            .replace("albedo_iterations = 6", "albedo_iterations = 5"),
    );
    let again = work(&["--dry-run"]);
    assert!(
        again.contains("bake_ball") && !again.contains("rule ingest"),
        "{again}"
    );
}
