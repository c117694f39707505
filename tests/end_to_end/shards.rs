//! Work in parts, `--shard I/N`: bit-identical to an undivided run.

use crate::support::Workplace;
use serde_json::Value;
use std::collections::BTreeMap;
use std::process::Child;

/// Everything but records, which hold times.
fn results(place: &Workplace, dir: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files = place.contents(dir);
    files.retain(|name, _| !name.ends_with("record.json"));
    files
}

#[track_caller]
fn assert_same(place: &Workplace, one: &str, other: &str) {
    let (one, other) = (results(place, one), results(place, other));
    assert!(
        one.keys().eq(other.keys()),
        "{:?}\n{:?}",
        one.keys(),
        other.keys()
    );
    for (name, bytes) in &one {
        assert!(*bytes == other[name], "{name} differs");
    }
}

/// A record without what is another in every run.
fn lasting(mut record: Value) -> Value {
    for key in ["arguments", "started", "peak_memory_mib"] {
        record[key] = Value::Null;
    }
    let seconds = record["seconds"].as_object().unwrap();
    record["seconds"] = seconds.keys().cloned().collect();
    record
}

fn finish(children: Vec<Child>) {
    for mut child in children {
        assert!(child.wait().unwrap().success());
    }
}

fn start(place: &Workplace, command: &str, parts: &[&str]) -> Vec<Child> {
    let parts = parts.iter();
    parts
        .map(|part| {
            let part = format!("{command} --shard {part} --quiet");
            place.command(&part).spawn().unwrap()
        })
        .collect()
}

#[test]
fn renderings_in_parts_are_those_of_one_process() {
    let place = Workplace::trained();
    let render = "render run/scene.ply --cameras room --split all --mode path --spp 4 \
                  --aov albedo --denoise filter --exposure auto";
    place.succeeds(&format!("{render} --out whole"));
    for part in ["3/3", "1/3"] {
        place.succeeds(&format!("{render} --out parts --shard {part}"));
        assert!(!place.path("parts/record.json").exists());
    }
    place.fails_cleanly(
        &format!("{render} --out parts"),
        &["parts: shard-2-of-3.record.json is missing", "--shard"],
    );
    place.fails_cleanly(
        &format!("{render} --out parts --shard 2/4"),
        &[
            "shard-1-of-3.record.json",
            "another division than --shard 2/4",
        ],
    );
    place.fails_cleanly(
        &format!("{render} --out parts --seed 1 --shard 2/3"),
        &["shard-1-of-3.record.json", "other options:", "--force"],
    );
    place.succeeds(&format!("{render} --out parts --shard 2/3"));
    // A result that somebody has changed is made again.
    let names = place.names("parts");
    let changed = names.iter().find(|name| name.ends_with(".exr")).unwrap();
    place.write(&format!("parts/{changed}"), "");
    place.succeeds(&format!("{render} --out parts"));
    assert_same(&place, "whole", "parts");
    assert!(
        !place
            .names("parts")
            .iter()
            .any(|name| name.contains("shard"))
    );
    let [whole, parts] = ["whole", "parts"].map(|dir| place.json(&format!("{dir}/record.json")));
    assert_eq!(lasting(whole), lasting(parts));

    // All at once, one of them killed and started again.
    #[cfg(debug_assertions)]
    place.is_killed_at(
        "rendering=2",
        &format!("{render} --out at-once --shard 2/3"),
    );
    finish(start(
        &place,
        &format!("{render} --out at-once"),
        &["1/3", "2/3", "3/3"],
    ));
    place.succeeds(&format!("{render} --out at-once"));
    assert_same(&place, "whole", "at-once");

    // Starting over leaves nothing of the parts.
    place.succeeds(&format!("{render} --out other --shard 1/2"));
    place.succeeds("render run/scene.ply --cameras room --mode 0-bounce --out other --force");
    place.succeeds("render run/scene.ply --cameras room --mode 0-bounce --out alone");
    assert_same(&place, "alone", "other");
}

#[test]
fn frames_of_a_path_in_parts_keep_their_own_noise() {
    let place = Workplace::trained();
    let render = "render run/scene.ply --cameras room --mode path --spp 1 --antialias 1 \
                  --camera-path turntable --frames 5 --size 24x16 --exr";
    place.succeeds(&format!("{render} --out whole"));
    finish(start(
        &place,
        &format!("{render} --out parts"),
        &["2/2", "1/2"],
    ));
    place.succeeds(&format!("{render} --out parts"));
    assert_same(&place, "whole", "parts");
}

#[test]
fn stacks_are_merged_in_parts() {
    let place = Workplace::new();
    crate::ingest::capture(&place, 5);
    place.succeeds("ingest c --out whole --long-side 48");
    finish(start(
        &place,
        "ingest c --out parts --long-side 48",
        &["3/3", "1/3"],
    ));
    assert!(!place.path("parts/capture.json").exists());
    assert!(!place.path("parts/Radiance-exr/p1.exr").exists());
    place.succeeds("ingest c --out parts --long-side 48 --shard 2/3");
    let told = place.succeeds("ingest c --out parts --long-side 48 --json");
    assert!(told.contains("\"num_kept\":5"), "{told}");
    assert_same(&place, "whole", "parts");
    let [whole, parts] = ["whole", "parts"].map(|dir| place.json(&format!("{dir}/record.json")));
    assert_eq!(lasting(whole), lasting(parts));
}

/// As a workflow engine does it: the steps as they are listed, each a process of its own, in parts
/// where it has some.
#[test]
fn steps_that_run_alone_make_a_run() {
    let place = Workplace::new();
    let project = r#"
out = "run"
dataset = "room"
[masks]
[train]
preset = "draft"
iterations = 40
albedo_iterations = 10
[render]
modes = ["0-bounce", "path"]
aov = ["albedo"]
spp = 2
[[relight]]
name = "dim"
script = "dim.toml"
reference = "room"
[bake]
method = "views"
spp = 2
iterations = 5
"#;
    place.write("p.toml", project);
    let dim = "[[step]]\nselect = { emission = { min = 0.1 } }\nthen = [{ scale_light = 0.5 }]\n";
    place.write("dim.toml", dim);
    place.fails_cleanly(
        "run p.toml --only train --shard 1/2",
        &["train has no parts"],
    );
    place.fails_cleanly(
        "run p.toml --only paint",
        &["--only paint: no step", "train"],
    );
    place.fails_cleanly("run p.toml --only train", &["step train needs masks"]);
    let told = place.succeeds("run p.toml --list --json");
    assert!(!place.path("run").exists());
    let steps: Vec<Value> = told
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let divided = |place: &Workplace| {
        for step in &steps {
            let step_name = step["step"].as_str().unwrap();
            if step["divides"] == true {
                let part = format!("run p.toml --only {step_name}");
                finish(start(place, &part, &["2/2", "1/2"]));
            }
            place.succeeds(&format!("run p.toml --only {step_name}"));
        }
    };
    let up_to_date = |place: &Workplace| {
        let told = place.succeeds("run p.toml --json");
        for step in told.lines().filter(|line| line.contains("run-step")) {
            assert!(step.contains("up-to-date"), "{step}");
        }
    };
    divided(&place);
    up_to_date(&place);
    place.succeeds("run p.toml --out whole");
    assert_same(&place, "whole/render", "run/render");
    assert_eq!(
        place.bytes("whole/bake/dim.ply"),
        place.bytes("run/bake/dim.ply")
    );
    // After a change, parts remove earlier results once.
    place.write(
        "p.toml",
        project.replace("aov = [\"albedo\"]\nspp = 2", "spp = 3"),
    );
    divided(&place);
    up_to_date(&place);
    place.succeeds("run p.toml --out whole");
    assert_same(&place, "whole/render", "run/render");
}
