//! Commands about the machine and the program itself.

use crate::support::Workplace;
use serde_json::Value;

#[test]
fn the_doctor_finds_the_engine_well() {
    let place = Workplace::new();
    let told = place.succeeds("doctor --json");
    let findings: Vec<Value> = told
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let state = |topic: &str| {
        let found = findings.iter().find(|one| one["topic"] == topic);
        found.unwrap_or_else(|| panic!("nothing about {topic} in {told}"))["state"].clone()
    };
    for topic in ["program", "processor", "self-test"] {
        assert_eq!(state(topic), "good", "{told}");
    }
    // Findings that may be missing say what they would give.
    for one in &findings {
        assert_ne!(one["state"], "bad", "{one}");
        assert_eq!(
            one["state"] == "missing",
            one["would_give"].is_string(),
            "{one}"
        );
    }
    let lines = place.succeeds("doctor");
    assert!(lines.contains("ok  self-test"), "{lines}");
}

#[test]
fn shells_and_manuals_know_every_command() {
    let place = Workplace::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = place.succeeds(&format!("completions {shell}"));
        assert!(script.contains("preset"), "{shell}: {script}");
    }
    place.succeeds("man pages");
    for page in ["eagpt", "eagpt-train", "eagpt-colmap-import"] {
        let text = String::from_utf8(place.bytes(&format!("pages/{page}.1"))).unwrap();
        assert!(text.contains(".SH NAME"), "{page}: {text}");
    }
    let train = String::from_utf8(place.bytes("pages/eagpt-train.1")).unwrap();
    assert!(train.contains("\\-\\-preset"), "{train}");
    place.fails_cleanly("man pages", &["eagpt", "is there already"]);
    place.succeeds("man pages --force");
}
