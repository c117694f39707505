use super::*;
use crate::testing::assert_error;

/// Opens a dataset of these frames in a folder of this name.
fn split_in(folder_name: &str, names: &[&str], rule: SplitRule) -> Result<Split> {
    let folder = folder_with(names);
    let root = folder.root().join(folder_name);
    std::fs::create_dir(&root).unwrap();
    for entry in [RADIANCE_DIR, TRANSFORMS_FILE] {
        std::fs::rename(folder.root().join(entry), root.join(entry)).unwrap();
    }
    Dataset::open(&root).unwrap().split(rule)
}

fn numbered(num: usize) -> Vec<String> {
    (0..num).map(|i| format!("{i:04}")).collect()
}

fn refs(names: &[String]) -> Vec<&str> {
    names.iter().map(String::as_str).collect()
}

#[test]
fn every_eighth_frame_tests() {
    let names = numbered(18);
    for rule in [SplitRule::Every8th, SplitRule::Paper] {
        let split = split_in("room", &refs(&names), rule).unwrap();
        assert_eq!(split.test, [0, 8, 16]);
        assert_eq!(
            split.train,
            [1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15, 17]
        );
        assert_eq!((split.rule, split.warnings.len()), (rule, 0));
    }
}

#[test]
fn all_frames_do_both_with_a_warning() {
    let names = numbered(3);
    let split = split_in("room", &refs(&names), SplitRule::All).unwrap();
    assert_eq!(
        (split.train.as_slice(), split.test.as_slice()),
        ([0, 1, 2].as_slice(), [0, 1, 2].as_slice())
    );
    assert_eq!(
        split.warnings,
        ["split all: 3 of 3 test views are also trained on"]
    );
    let split = split_in("SelfCaptured-office", &refs(&names), SplitRule::Paper).unwrap();
    assert_eq!((split.train.len(), split.test.len()), (3, 3));
    assert_eq!(
        split.warnings,
        ["split paper: 3 of 3 test views are also trained on"]
    );
}

#[test]
fn the_paper_trains_on_its_test_camera() {
    let names = [
        "10/10_DSC0001",
        "11/x",
        "12/x",
        "13/x",
        "26/a_DSC0001",
        "26/a_DSC0002",
        "23/x",
    ];
    let split = split_in("room", &names, SplitRule::Paper).unwrap();
    assert_eq!((split.train, split.test), (vec![3, 4, 5, 6], vec![4, 5]));
    assert_eq!(
        split.warnings,
        ["split paper: 2 of 2 test views are also trained on"]
    );
    let split = split_in("room", &["13/x", "23/x"], SplitRule::Paper).unwrap();
    assert_eq!((split.train, split.test), (vec![0, 1], vec![1]));
    assert_error(
        split_in("room", &["13/x", "14/x"], SplitRule::Paper),
        &["transforms.json: split paper: 2 training and 0 test views of 2 frames"],
    );
}

#[test]
fn the_paper_drops_the_first_frames_of_two_scenes() {
    let names = [
        "13/13_DSC0107",
        "13/13_DSC0108",
        "26/26_DSC0206",
        "26/26_DSC0207",
    ];
    let split = split_in("raf_furnishedroom", &names, SplitRule::Paper).unwrap();
    assert_eq!((split.train, split.test), (vec![1, 2, 3], vec![2, 3]));
    assert!(split.warnings[0].contains("1 of 4 frames are left out, numbered below 108"));
    let split = split_in("raf_emptyroom", &names, SplitRule::Paper).unwrap();
    assert_eq!((split.train, split.test), (vec![3], vec![3]));
    let split = split_in("kitchen", &names, SplitRule::Paper).unwrap();
    assert_eq!((split.train.len(), split.test), (4, vec![2, 3]));
}

#[test]
fn an_empty_subset_and_missing_lists_are_errors() {
    assert_error(
        split_in("room", &["a"], SplitRule::Every8th),
        &["room/transforms.json: split every-8th: 0 training and 1 test views of 1 frames"],
    );
    assert_error(
        split_in("room", &["a", "b"], SplitRule::Listed),
        &["room/transforms.json: train_filenames: missing; the split `listed` needs it"],
    );
}

#[test]
fn subsets_and_names() {
    let split = Split {
        rule: SplitRule::Listed,
        train: vec![5, 1, 3],
        test: vec![3, 0],
        warnings: Vec::new(),
    };
    assert_eq!(split.indices(Subset::Train), [5, 1, 3]);
    assert_eq!(split.indices(Subset::Test), [3, 0]);
    assert_eq!(split.indices(Subset::All), [0, 1, 3, 5]);
    for rule in [
        SplitRule::Every8th,
        SplitRule::Listed,
        SplitRule::All,
        SplitRule::Paper,
    ] {
        assert_eq!(
            serde_json::from_value::<SplitRule>(json!(rule.to_string())).unwrap(),
            rule
        );
        assert_eq!(serde_json::to_value(rule).unwrap(), rule.to_string());
    }
    for subset in [Subset::Train, Subset::Test, Subset::All] {
        assert_eq!(
            serde_json::from_value::<Subset>(json!(subset.to_string())).unwrap(),
            subset
        );
        assert_eq!(serde_json::to_value(subset).unwrap(), subset.to_string());
    }
    let refused = serde_json::from_value::<SplitRule>(json!("every8")).unwrap_err();
    let refused = refused.to_string();
    for part in ["every8", "every-8th", "listed", "all", "paper"] {
        assert!(refused.contains(part), "{refused}");
    }
}
