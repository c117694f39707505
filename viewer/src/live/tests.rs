use super::*;

fn lights() -> Vec<String> {
    vec![
        "ceiling-1".to_owned(),
        "a \"lamp\"".to_owned(),
        "rest".to_owned(),
    ]
}

fn set(name: &str, factor: [f32; 3]) -> Act {
    let name = name.to_owned();
    Act::SetLight(SetLight { name, factor })
}

#[test]
fn acts_are_steps_and_undo_brings_back_the_bits() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("edit.toml");
    let mut edit = Edit::open(&path, lights()).unwrap();
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
    let again = Edit::open(&path, lights()).unwrap();
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
    let mut edit = Edit::open(&path, lights()).unwrap();
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
        (
            "[[step]]\nselect = \"everything\"\nthen = [\"remove\"]\n",
            "line 2",
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
        let error = Edit::open(&path, lights()).unwrap_err().to_string();
        assert!(
            error.contains("edit.toml") && error.contains(problem),
            "{error}"
        );
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }
}
