use super::*;
use crate::testing::lit_cloud;
use eagpt_edit::Script;
use serde_json::{Value, json};

fn original() -> Original {
    lit_cloud(&["ceiling-1", "a \"lamp\""])
}

fn step(value: Value) -> Act {
    Act::Step(Box::new(serde_json::from_value(value).unwrap()))
}

fn set(name: &str, factor: [f32; 3]) -> Act {
    let name = name.to_owned();
    Act::SetLight(SetLight { name, factor })
}

#[test]
fn acts_are_steps_and_undo_brings_back_the_bits() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("edit.toml");
    let mut edit = Edit::open(&path, original()).unwrap();
    edit.act(set("ceiling-1", [0.1, 0.2, 1.0 / 3.0])).unwrap();
    let first = edit.state();
    assert_eq!(first.factors["ceiling-1"], [0.1, 0.2, 1.0 / 3.0]);
    assert_eq!(first.factors["rest"], [1.0; 3]);
    edit.act(set("a \"lamp\"", [0.0; 3])).unwrap();
    edit.act(set("ceiling-1", [2.0; 3])).unwrap();
    let third = edit.state();
    edit.act(Act::Undo).unwrap();
    edit.act(Act::Undo).unwrap();
    let back = edit.state();
    assert_eq!(
        (&back.script, &back.factors),
        (&first.script, &first.factors)
    );
    assert!(back.revision > third.revision && back.can_redo);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), first.script);
    edit.act(Act::Redo).unwrap();
    edit.act(Act::Redo).unwrap();
    assert_eq!(edit.state().script, third.script);
    assert!(edit.act(Act::Redo).is_err());

    // A server that was killed goes on from the file, to the same bits.
    let again = Edit::open(&path, original()).unwrap();
    assert_eq!(again.state().factors, third.factors);
    assert_eq!(again.script(), third.script);

    edit.act(Act::Undo).unwrap();
    edit.act(set("rest", [1.0; 3])).unwrap();
    assert!(
        !edit.state().can_redo,
        "another act ends what could be redone"
    );
}

#[test]
fn what_cannot_be_changes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("edit.toml");
    let mut edit = Edit::open(&path, original()).unwrap();
    for (act, problem) in [
        (
            set("wall-1", [1.0; 3]),
            "`wall-1` is no light: there are ceiling-1",
        ),
        (set("rest", [-1.0, 1.0, 1.0]), "not of 0 to"),
        (set("rest", [f32::NAN; 3]), "not of 0 to"),
        (set("rest", [1e7; 3]), "not of 0 to"),
        (Act::Undo, "nothing to undo"),
        (Act::Redo, "nothing to redo"),
    ] {
        let error = edit.act(act).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
    assert!(!path.exists() && edit.revision() == 0);
    // Scripts of others stay as they are.
    for (text, problem) in [
        ("[[step]]\nimport = { file = \"lamp.ply\" }\n", "line 2"),
        (
            "[[step]]\nselect = \"everything\"\nthen = [\"fly\"]\n",
            "fly",
        ),
        (
            "[[step]]\nset_light = { rest = [1, 1, 1] }\nthen = [\"remove\"]\n",
            "more than to set a light",
        ),
        (
            "[[step]]\nset_light = { rest = [1, 1, 1], \"ceiling-1\" = [0, 0, 0] }\n",
            "step[0]",
        ),
        (
            "[[step]]\nset_light = { door = [1, 1, 1] }\n",
            "`door` is no light",
        ),
        ("step", "line 1"),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = Edit::open(&path, original()).unwrap_err().to_string();
        assert!(
            error.contains("edit.toml") && error.contains(problem),
            "{error}"
        );
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }
}

/// Steps of all kinds: what pages are shown is what the program makes of the file, undo brings back
/// the bits, and a server that was killed goes on from them.
#[test]
fn other_steps_are_replayed_to_the_bit() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("edit.toml");
    let mut edit = Edit::open(&path, original()).unwrap();
    let acts = [
        step(
            json!({ "insert": { "ball": { "centre": [0.1, 0.2, 3], "radius": 0.3, "radiance": 4 } } }),
        ),
        set("rest", [0.5; 3]),
        step(json!({
            "select": { "cluster": { "seed": [0.1, 0.2, 3.3], "reach": 3 } },
            "then": [{ "duplicate": { "move": [0.7, 0, 0] } }],
        })),
        set("ceiling-1", [2.0, 0.25, 0.0]),
        step(json!({
            "select": { "sphere": { "centre": [0, 0, 0], "radius": 0.5 } },
            "trim": "shrink",
            "then": ["remove"],
        })),
    ];
    let replayed = |edit: &Edit| {
        let mut script = Script::read(&path).unwrap();
        let original = edit.original();
        script.set_lamps(original.lamps.clone()).unwrap();
        if script.needs_basis() {
            script.set_basis(original.basis.clone().unwrap()).unwrap();
        }
        let scene = Gaussians::clone(&original.gaussians);
        eagpt_edit::replay(&script, scene).unwrap().gaussians
    };
    let mut states = Vec::new();
    for act in acts.clone() {
        edit.act(act).unwrap();
        let scene = edit.edited().unwrap();
        assert_eq!(scene, replayed(&edit));
        states.push((edit.script(), scene));
    }
    // Lights are set first, of the geometry that they were baked with.
    let script = edit.script();
    assert!(
        script.rfind("set_light") < script.find("insert"),
        "{script}"
    );
    assert!(states[2].1.len() > states[1].1.len() && states[4].1.len() < states[3].1.len());

    let again = Edit::open(&path, original()).unwrap();
    assert_eq!((again.script(), again.edited().unwrap()), states[4]);
    assert_eq!(
        again.changed().map(|scene| scene.len()),
        Some(states[4].1.len())
    );

    for before in states[..4].iter().rev() {
        edit.act(Act::Undo).unwrap();
        assert_eq!(
            (&edit.script(), &edit.edited().unwrap()),
            (&before.0, &before.1)
        );
    }
    edit.act(Act::Undo).unwrap();
    assert!(edit.changed().is_none());
    assert_eq!(edit.edited().unwrap(), *edit.original().gaussians);
    for _ in 0..5 {
        edit.act(Act::Redo).unwrap();
    }
    assert_eq!((edit.script(), edit.edited().unwrap()), states[4]);
}

#[test]
fn steps_that_cannot_be_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("edit.toml");
    let mut edit = Edit::open(&path, original()).unwrap();
    let act = step(
        json!({ "insert": { "ball": { "centre": [0, 0, 3], "radius": 0.3, "albedo": 0.5 } } }),
    );
    edit.act(act).unwrap();
    let before = (edit.script(), edit.edited().unwrap(), edit.revision());
    for (value, problem) in [
        (json!({}), "one of select, insert"),
        (json!({ "select": "everything" }), "`then` is missing"),
        (
            json!({ "select": "everything", "then": ["remove"] }),
            "leaves no Gaussian",
        ),
        (
            json!({ "select": { "lamp": "door" }, "then": ["remove"] }),
            "`door` is no lamp",
        ),
        (
            json!({ "select": { "sphere": { "centre": [9, 9, 9], "radius": 1 } }, "then": ["remove"] }),
            "selects nothing",
        ),
        (
            json!({ "insert": { "ball": { "centre": [0, 0, 0], "radius": -1, "albedo": 1 } } }),
            "radius",
        ),
        (
            json!({ "insert": { "ball": { "centre": [0, 0, null], "radius": 1, "albedo": 1 } } }),
            "TOML",
        ),
        (
            json!({ "set_light": { "rest": [1, 1, 1] } }),
            "an act of its own",
        ),
        (
            json!({ "title": "a\u{7f}b", "select": "everything", "then": ["lights_off"] }),
            "TOML",
        ),
    ] {
        let error = edit.act(step(value)).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
    assert_eq!(
        (edit.script(), edit.edited().unwrap(), edit.revision()),
        before
    );
    assert_eq!(std::fs::read_to_string(&path).unwrap(), before.0);
}
