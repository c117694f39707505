//! Which views are measured: those that were rendered and that the reference has.

use super::{Case, NUM_VIEWS, name, radiance, view};
use crate::evaluation::Evaluation;
use eagpt_scene::dataset::{DatasetWriter, SplitRule, Subset};
use eagpt_scene::exr::Precision;
use eagpt_scene::files::digest;
use serde_json::json;
use std::path::{Path, PathBuf};

const RULES: [SplitRule; 4] = [
    SplitRule::Every8th,
    SplitRule::Listed,
    SplitRule::All,
    SplitRule::Paper,
];

/// A reference that holds the rendered views alone, 0 and 8.
fn reference_of_test_views(case: &Case) -> PathBuf {
    let root = case.dir.path().join("test-views");
    let mut writer = DatasetWriter::create(&root, Precision::Float).unwrap();
    for index in [0, 8] {
        writer.write_view(&view(index)).unwrap();
    }
    writer.finish(&Default::default()).unwrap();
    root
}

/// The record that `eagpt render` leaves beside renders of `cameras`.
fn write_record(case: &Case, cameras: &Path, rule: Option<&str>, subset: &str, num_views: usize) {
    let blake3 = digest::of_file(&cameras.join("transforms.json")).unwrap();
    let record = json!({
        "command": "render",
        "options": {"cameras": cameras},
        "inputs": [{"path": "scene.ply", "blake3": "0"}, {"path": "c", "blake3": blake3}],
        "split": {"rule": rule, "subset": subset, "num_views": num_views},
    });
    let path = case.options.renders.join("record.json");
    std::fs::write(path, record.to_string()).unwrap();
}

fn measured(case: &mut Case) -> Evaluation {
    case.run().unwrap()
}

fn warns(found: &Evaluation, part: &str) -> bool {
    found.warnings.iter().any(|text| text.contains(part))
}

#[test]
fn a_reference_of_the_test_views_is_not_divided_again() {
    let mut case = Case::new();
    let full = case.options.dataset.clone();
    case.options.dataset = reference_of_test_views(&case);
    // Of renders of another program, and of our own.
    for record in [false, true] {
        if record {
            write_record(&case, &full, Some("every-8th"), "test", 2);
        }
        for split in RULES.map(Some).into_iter().chain([None]) {
            case.options.split = split;
            let found = measured(&mut case);
            assert_eq!((found.views.len(), found.num_rendered), (2, 2), "{split:?}");
            assert!(!warns(&found, "training views"), "{:?}", found.warnings);
        }
    }
    // Asked for by name: the rule divides what was rendered, by its record.
    case.options.subset = Some(Subset::Test);
    let found = measured(&mut case);
    assert_eq!(
        (found.views.len(), found.split),
        (2, Some(SplitRule::Every8th))
    );
    // The dataset has changed since: the rule divides the reference, and says so.
    let transforms = full.join("transforms.json");
    let text = std::fs::read_to_string(&transforms).unwrap() + " ";
    std::fs::write(transforms, text).unwrap();
    let found = measured(&mut case);
    assert_eq!(found.views.len(), 1);
    assert!(warns(&found, "is not there as it was"));
    assert!(warns(&found, "1 of 2 rendered views are not measured"));
}

#[test]
fn fewer_views_than_were_rendered_are_a_warning() {
    let mut case = Case::new();
    for index in 1..4 {
        case.render_rgb("", index, &radiance(index));
    }
    std::fs::create_dir_all(case.options.renders.join("more")).unwrap();
    let from = case.path("", 1);
    std::fs::copy(from, case.options.renders.join("more/x.exr")).unwrap();
    let found = measured(&mut case);
    assert_eq!((found.views.len(), found.num_rendered), (5, 6));
    assert!(warns(&found, "1 of 6 rendered views are not in"));
    assert!(warns(&found, "more/x"));
    // AOVs are no views.
    assert!(
        !found.warnings[0].contains("albedo"),
        "{:?}",
        found.warnings
    );

    let full = case.options.dataset.clone();
    write_record(&case, &full, None, "all", NUM_VIEWS);
    let found = measured(&mut case);
    assert!(warns(
        &found,
        "6 of the 9 views that its record.json counts"
    ));
    assert!(warns(
        &found,
        "3 of 5 measured views are training views by every-8th"
    ));
    case.options.subset = Some(Subset::Test);
    let found = measured(&mut case);
    let names: Vec<&str> = found.views.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, [name(0), name(8)]);
    assert!(warns(&found, "3 of 6 rendered views are not measured"));
}

#[test]
fn renders_of_other_views_are_refused() {
    let mut case = Case::new();
    let root = case.dir.path().join("others");
    let mut writer = DatasetWriter::create(&root, Precision::Float).unwrap();
    let mut other = view(1);
    other.name = "other".to_owned();
    writer.write_view(&other).unwrap();
    writer.finish(&Default::default()).unwrap();
    case.options.dataset = root;
    case.assert_refused(&["no view in common", "2 EXR files", "`other`"]);
}
