//! Scripts that cannot be: each error is one line with file, line, key and value.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    dead_code,
    reason = "a test ends with its first surprise; helpers are shared with other tests"
)]

mod common;

use common::Folder;

/// Text before the step under test, so that it stands on line 3.
const HEAD: &str = "# A comment.\nup = \"z\"\n";

#[test]
fn every_complaint_names_line_key_and_value() {
    let folder = Folder::new();
    for (step, line, key, problem) in [
        ("[[step]\n", 3, "TOML", "]"),
        (
            "[stepp]\n",
            3,
            "stepp",
            "unknown field `stepp`, expected one of `up`, `selections`, `step`",
        ),
        (
            "selections.a.box = 1\n[[step]]",
            3,
            "selections.a.box",
            "integer",
        ),
        ("step = []", 3, "step", "is empty"),
        ("step = 3", 3, "step", "integer `3`, expected a sequence"),
        (
            "[[step]]\ncolour = 1",
            4,
            "step[0].colour",
            "unknown field `colour`",
        ),
        (
            "[[step]]\nthen = [\"remove\"]",
            3,
            "step[0]",
            "select, insert, import, set_light is missing",
        ),
        (
            "[[step]]\nselect = \"everything\"",
            3,
            "step[0]",
            "`then` is missing",
        ),
        (
            "[[step]]\nselect = \"everything\"\ninsert.ball = { centre = [0, 0, 0], radius = 1, albedo = 1 }\nthen = [\"remove\"]",
            5,
            "step[0].insert",
            "one too many",
        ),
        (
            "[[step]]\nselect = \"lamp\"\nthen = [\"remove\"]",
            4,
            "step[0].select",
            "`lamp`",
        ),
        (
            "[[step]]\nselect = {}\nthen = [\"remove\"]",
            4,
            "step[0].select",
            "empty",
        ),
        (
            "[[step]]\nselect = { spere = 1 }\nthen = [\"remove\"]",
            4,
            "step[0].select.spere",
            "sphere",
        ),
        (
            "[[step]]\nselect.sphere = { centre = [0, 0], radius = 1 }\nthen = [\"remove\"]",
            4,
            "step[0].select.sphere.centre",
            "2 values, not 3",
        ),
        (
            "[[step]]\nselect.sphere = { centre = [0, 0, 0], radius = -1 }\nthen = [\"remove\"]",
            4,
            "step[0].select.sphere.radius",
            "-1 is not above 0",
        ),
        (
            "[[step]]\nselect.sphere = { centre = [0, nan, 0], radius = 1 }\nthen = [\"remove\"]",
            4,
            "step[0].select.sphere.centre[1]",
            "NaN is not a finite number",
        ),
        (
            "[[step]]\nselect.sphere = { centre = [0, 0, 0], radius = 1e39 }\nthen = [\"remove\"]",
            4,
            "step[0].select.sphere.radius",
            "not a finite number",
        ),
        (
            "[[step]]\nselect.sphere.centre = [0, 0, 0]\nthen = [\"remove\"]",
            4,
            "step[0].select.sphere",
            "missing field `radius`",
        ),
        (
            "[[step]]\nselect.box = { min = [0, 0, 0], max = [1, 0, 1] }\nthen = [\"remove\"]",
            4,
            "step[0].select.box",
            "not below max [1, 0, 1]",
        ),
        (
            "[[step]]\nselect.box = { centre = [0, 0, 0], size = [1, 0, 1] }\nthen = [\"remove\"]",
            4,
            "step[0].select.box.size[1]",
            "0 is not above 0",
        ),
        (
            "[[step]]\nselect.half_space = { point = [0, 0, 0], normal = [0, 0, 0] }\nthen = [\"remove\"]",
            4,
            "step[0].select.half_space.normal",
            "without direction",
        ),
        (
            "[[step]]\nselect.half_space = { point = [0, 0, 0], normal = \"up\" }\nthen = [\"remove\"]",
            4,
            "step[0].select.half_space.normal",
            "`up`",
        ),
        (
            "[[step]]\nselect.cylinder = { from = [0, 0, 0], to = [0, 0, 0], radius = 1 }\nthen = [\"remove\"]",
            4,
            "step[0].select.cylinder",
            "same point",
        ),
        (
            "[[step]]\nselect.opacity.min = 1.5\nthen = [\"remove\"]",
            4,
            "step[0].select.opacity.min",
            "1.5 is outside 0 to 1",
        ),
        (
            "[[step]]\nselect.size = { min = 2, max = 1 }\nthen = [\"remove\"]",
            4,
            "step[0].select.size",
            "min 2 is above max 1",
        ),
        (
            "[[step]]\nselect.cluster = { seed = [0, 0, 0], radius = 1, reach = 1 }\nthen = [\"remove\"]",
            4,
            "step[0].select.cluster",
            "not both",
        ),
        (
            "[[step]]\nselect.any = []\nthen = [\"remove\"]",
            4,
            "step[0].select.any",
            "empty",
        ),
        (
            "[selections]\na.not = \"b\"\nb.not = \"a\"\n[[step]]\nselect = \"a\"\nthen = [\"remove\"]",
            4,
            "selections.a",
            "a → b → a",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [\"explode\"]",
            5,
            "step[0].then[0]",
            "`explode`",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [\n  \"keep_only\",\n  { set_albedo = 1.5 },\n]",
            7,
            "step[0].then[1].set_albedo",
            "1.5 is above 1",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ set_radiance = [1, -2, 3] }]",
            5,
            "step[0].then[0].set_radiance",
            "-2 is negative",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ tint_light = 0 }]",
            5,
            "step[0].then[0].tint_light",
            "black",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ swap_albedo = \"rgg\" }]",
            5,
            "step[0].then[0].swap_albedo",
            "`rgg`",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ move = [1, 0, 0], scale_light = 2 }]",
            5,
            "step[0].then[0]",
            "more than 1 element",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ scale = { factor = 0 } }]",
            5,
            "step[0].then[0].scale.factor",
            "0 is not above 0",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ duplicate = { move = [1, 0, 0], to = [1, 0, 0] } }]",
            5,
            "step[0].then[0].duplicate",
            "not both",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ rotate = { axis = \"z\", degrees = 9, about = \"top\" } }]",
            5,
            "step[0].then[0].rotate.about",
            "`top`",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [\"remove\", { move = [1, 0, 0] }]",
            5,
            "step[0].then[1]",
            "nothing left",
        ),
        (
            "[[step]]\nselect = \"everything\"\ntrim = \"drop\"\nthen = [\"remove\"]",
            5,
            "step[0].trim",
            "no boundary",
        ),
        (
            "[[step]]\nselect.sphere = { centre = [0, 0, 0], radius = 1 }\ntrim = \"cut\"\nthen = [\"remove\"]",
            5,
            "step[0].trim",
            "`cut`",
        ),
        (
            "[[step]]\nselect = \"everything\"\nallow_empty = 1\nthen = [\"remove\"]",
            5,
            "step[0].allow_empty",
            "integer `1`, expected a boolean",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [\"remove\"]\nas = \"gone\"",
            6,
            "step[0].as",
            "removed",
        ),
        (
            "[[step]]\ninsert.ball = { centre = [0, 0, 0], radius = 1 }",
            4,
            "step[0].insert.ball",
            "none of `albedo`, `radiance`, `specular`, `metal`",
        ),
        (
            "[[step]]\ninsert.ball = { centre = [0, 0, 0], radius = 1, albedo = 1, metal.color = 1 }",
            4,
            "step[0].insert.ball",
            "a `metal` has no `albedo`",
        ),
        (
            "[[step]]\ninsert.ball = { centre = [0, 0, 0], radius = 1, albedo = 1, roughness = 0.5 }",
            4,
            "step[0].insert.ball",
            "`roughness` is that of a `specular`",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ set_roughness = 2 }]",
            5,
            "step[0].then[0].set_roughness",
            "outside 0 to 1",
        ),
        (
            "[[step]]\ninsert.ball = { centre = [0, 0, 0], radius = 1, albedo = 1, spacing = 1e-6 }",
            4,
            "step[0].insert.ball",
            "more than 4000000",
        ),
        (
            "[[step]]\ninsert.quad = { centre = [0, 0, 0], u = [1e6, 0, 0], v = [0, 1e-6, 0], albedo = 1 }",
            4,
            "step[0].insert.quad",
            "more than 4000000",
        ),
        (
            "[[step]]\ninsert.quad = { centre = [0, 0, 0], u = [1, 0, 0], v = [2, 0, 0], albedo = 1 }",
            4,
            "step[0].insert.quad",
            "parallel",
        ),
        (
            "[[step]]\ninsert = { ball = {}, quad = {} }",
            4,
            "step[0].insert",
            "exactly 1 element",
        ),
        (
            "[[step]]\nimport.file = \"none.ply\"",
            4,
            "step[0].import.file",
            "none.ply: read",
        ),
        (
            "[[step]]\nimport.file = \"a.toml\"",
            4,
            "step[0].import.file",
            "a.toml",
        ),
        (
            "[[step]]\nimport.file = \"row.ply\"\nas = \"x\"\n[[step]]\nimport = { file = \"row.ply\", select = \"x\" }",
            7,
            "step[1].import.select",
            "other scene",
        ),
        (
            "[[step]]\nselect = \"x\"\nthen = [\"remove\"]\n[[step]]\nimport.file = \"row.ply\"\nas = \"x\"",
            4,
            "step[0].select",
            "no earlier step",
        ),
        (
            "[selections]\nx = { not = \"everything\" }\n[[step]]\nimport.file = \"row.ply\"\nas = \"x\"",
            7,
            "step[0].as",
            "`x` is taken",
        ),
        (
            "[[step]]\nselect.emission.min = 0.5\nthen = [\"keep_only\"]\n[[step]]\nselect.emission.max = 0.1\nthen = [\"remove\"]",
            7,
            "step[1].select",
            "selects nothing",
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [\"remove\"]",
            4,
            "step[0].select",
            "leaves no Gaussian",
        ),
    ] {
        let message = match folder.replay(&format!("{HEAD}{step}")) {
            Ok(_) => panic!("accepted: {step}"),
            Err(error) => error.to_string(),
        };
        let start = format!("a.toml: line {line}: {key}: ");
        assert!(
            message.contains(&start),
            "{step}\n{message}\nwanted {start}"
        );
        assert!(
            message.contains(problem),
            "{step}\n{message}\nwanted {problem}"
        );
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn a_script_that_is_no_text_or_not_there() {
    let folder = Folder::new();
    let unreadable = eagpt_edit::Script::read(std::path::Path::new("none.toml")).unwrap_err();
    assert!(unreadable.to_string().contains("none.toml"), "{unreadable}");
    let empty = folder.read("").unwrap_err().to_string();
    assert!(
        empty.contains("a.toml: line 1: (top level): missing field `step`"),
        "{empty}"
    );
}

#[test]
fn deep_nesting_is_an_error_like_any_other() {
    let folder = Folder::new();
    let dotted = "not.".repeat(50_000);
    let braces = format!("{}{}", "{ not = ".repeat(50_000), "}".repeat(50_000));
    for text in [
        format!("[[step]]\nselect.{dotted}emission.min = 0\nthen = [\"remove\"]"),
        format!("[[step]]\nselect = {braces}\nthen = [\"remove\"]"),
    ] {
        let error = folder.read(&text).unwrap_err().to_string();
        assert!(error.contains("a.toml: line "), "{error}");
    }
    let mut chain = String::from("[selections]\ns0 = \"everything\"\n");
    for i in 1..2000 {
        chain += &format!("s{i}.not = \"s{}\"\n", i - 1);
    }
    let error = folder.read(&format!(
        "{chain}[[step]]\nselect = \"s1999\"\nthen = [\"remove\"]"
    ));
    let error = error.unwrap_err().to_string();
    assert!(error.contains("more than 16 selections"), "{error}");
}
