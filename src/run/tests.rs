//! Projects of every kind of step.

use super::{Plan, Project};
use crate::command::JobCommand;
use clap::FromArgMatches;
use std::path::Path;

/// Every section, with values of every type.
const CAPTURE: &str = r#"
simulate = "my-room.toml"
conditions = ["day", "evening"]
seed = 3
[synth]
size = "48x32"
unfiltered = true
[ingest]
vignetting = "-0.22,0.05,-0.01"
white_balance = "2,1,1.5"
exposures = [0.5, 0.25]
lens = "OPENCV 1,2,3,4,0.5,0,0,0"
scale = 0.001115625
max_pause = 30.0
[colmap]
matcher = "sequential"
[poses]
up = "0,0,1"
floor_at = ["1,2,3", "-4,5,6"]
known_distance = "a.jpg,point:17,1.25"
align = "manual"
[masks]
threshold = 8
rule = "luminance"
[normals]
maps = "my normals"
axes = "x,-y,-z"
[train]
preset = "paper"
set = ["radiance.rates.position=5e-5", "init.per_point=2"]
split = "every-8th"
[render]
aov = ["albedo", "normal"]
spp = 4
denoise = "auto"
exposure = "auto"
[render.path]
bounces = 3
emission_threshold = 0.7
spp = 5
[[relight]]
name = "dim"
script = "dim.toml"
reference = "out/dim"
split = "all"
[bake]
method = "views"
device = "gpu:4090"
[eval]
num_exposures = 4
"#;

fn plan(text: &str) -> anyhow::Result<Plan> {
    let dir = tempfile::tempdir()?;
    std::fs::write(
        dir.path().join("dim.toml"),
        "[[step]]\nselect = { emission = { min = 0.1 } }\nthen = [{ scale_light = 0.5 }]\n",
    )?;
    let path = dir.path().join("p.toml");
    let project = Project::parse(&path, text.as_bytes().to_vec(), Some(Path::new("out")))?;
    Plan::of(&project)
}

#[test]
fn every_command_is_printed_as_clap_reads_it() {
    let plan = plan(CAPTURE).unwrap();
    let mut kinds: Vec<String> = Vec::new();
    for step in &plan.steps {
        let words = step.words().unwrap();
        let program = JobCommand::program().no_binary_name(true);
        let matches = program.try_get_matches_from(&words).unwrap();
        let read = JobCommand::from_arg_matches(&matches).unwrap();
        assert_eq!(
            format!("{read:?}"),
            format!("{:?}", step.command),
            "{words:?}"
        );
        assert_eq!(read.words().unwrap(), words);
        kinds.push(words[0].clone());
    }
    kinds.dedup();
    let wanted = [
        "synth", "ingest", "colmap", "masks", "normals", "train", "render", "eval", "edit",
        "render", "bake", "render", "eval", "report",
    ];
    assert_eq!(kinds, wanted);
    let shown = |name: &str| {
        let step = plan.steps.iter().find(|step| step.name == name).unwrap();
        step.shown().unwrap()
    };
    assert_eq!(
        shown("render/dim/path"),
        "eagpt render out/edit/dim.ply --cameras out/dataset/day --mode path --spp 5 --bounces 3 \
         --emission-threshold 0.7 --seed 3 --aov albedo,normal --denoise auto \
         --out out/render/dim/path --exposure auto"
    );
    assert!(shown("render/dim/0-bounce").contains("--spp 4 "));
    assert!(!shown("render/dim/0-bounce").contains("denoise"));
    assert!(shown("ingest").contains("--lens 'OPENCV 1,2,3,4,0.5,0,0,0'"));
    assert!(shown("eval/dim/path").contains("--split all"));
}

#[test]
fn values_that_do_not_fit_are_named() {
    for (from, to, message) in [
        (
            "spp = 4",
            "spp = 0",
            "line 34: render.spp: invalid value '0'",
        ),
        (
            "unfiltered = true",
            "unfiltered = 1",
            "line 7: synth.unfiltered: 1 is neither",
        ),
        (
            "align = \"manual\"",
            "align = \"like\"",
            "poses: the following required",
        ),
        (
            "maps = \"my normals\"",
            "suffix = \"_n\"",
            "normals: the following required",
        ),
        (
            "spp = 5",
            "spp = [5, \"a\"]",
            "line 40: render.path.spp: [5,\"a\"]: takes one value",
        ),
        (
            "threshold = 8",
            "from_scene = \"a\"\nthreshold = 8",
            "cannot be used with",
        ),
        (
            "preset = \"paper\"",
            "masks = \"m\"",
            "train.masks: the section [masks] makes them",
        ),
        (
            "name = \"dim\"",
            "name = \"original\"",
            "relight[0].name: `original` is no name",
        ),
        ("simulate", "dataset", "synth: is for a capture"),
        (
            "seed = 3",
            "other_lights = [\"day\"]",
            "line 4: other_lights[0]: `day` is none of the conditions after the first: evening",
        ),
        (
            "seed = 3",
            "other_lights = [\"evening\", \"evening\"]",
            "line 4: other_lights[1]: another light is called `evening`",
        ),
        (
            "seed = 3",
            "scene = \"s.ply\"",
            "masks: is for a scene to be trained",
        ),
    ] {
        let text = CAPTURE.replacen(from, to, 1);
        let error = plan(&text).unwrap_err().to_string();
        assert!(error.contains(message), "{to}: {error}");
    }
}

/// A capture of whose three lights two are trained on.
#[test]
fn lights_are_trained_together_and_scripts_find_all_lamps_on() {
    let text = CAPTURE.replacen(
        "conditions = [\"day\", \"evening\"]",
        "conditions = [\"day\", \"evening\", \"lamps\"]\nother_lights = [\"lamps\"]",
        1,
    );
    let plan = plan(&text).unwrap();
    let step = |name: &str| plan.steps.iter().find(|step| step.name == name).unwrap();
    let train = step("train").shown().unwrap();
    assert!(
        train.starts_with("eagpt train out/dataset/day out/dataset/lamps --out out/train "),
        "{train}"
    );
    assert!(
        train.contains(" --masks out/masks --normals out/normals"),
        "{train}"
    );
    for section in ["masks", "normals"] {
        for light in ["day", "lamps"] {
            let shown = step(&format!("{section}/{light}")).shown().unwrap();
            let wanted = format!("eagpt {section} out/dataset/{light} ");
            let to = format!("--out out/{section}/{light}");
            assert!(shown.starts_with(&wanted) && shown.contains(&to), "{shown}");
        }
    }
    let waits: Vec<&str> = (step("train").after.iter())
        .map(|index| plan.steps[*index].name.as_str())
        .collect();
    let wanted = [
        "poses",
        "masks/day",
        "masks/lamps",
        "normals/day",
        "normals/lamps",
    ];
    assert_eq!(waits, wanted);
    let edit = step("edit/dim");
    let shown = edit.shown().unwrap();
    assert!(
        shown.starts_with("eagpt edit out/train/all-lamps/scene.ply "),
        "{shown}"
    );
    assert_eq!(plan.steps[edit.after[0]].name, "train");
    let shown = step("render/original/path").shown().unwrap();
    assert!(shown.contains(" out/train/scene.ply "), "{shown}");
}
