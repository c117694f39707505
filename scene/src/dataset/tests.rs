use super::*;

/// The shared test data, or `None` after saying that `test` is skipped.
fn shared_data(test: &str, folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("EAGPT_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(folder);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("skipped: {test}: no folder {}", path.display());
    None
}

#[test]
fn kitchen_opens_and_its_views_load() {
    let Some(root) = shared_data("kitchen_opens_and_its_views_load", "kitchen") else {
        return;
    };
    let dataset = Dataset::open(&root).unwrap();
    assert_eq!(dataset.len(), 96);
    let split = dataset.split(SplitRule::Every8th).unwrap();
    assert_eq!((split.train.len(), split.test.len()), (84, 12));
    assert_eq!(dataset.points().unwrap().unwrap().len(), 58_800);
    for index in [0, 95] {
        let view = dataset.load_view(index).unwrap();
        assert_eq!(view.radiance.size(), (270, 180));
        assert!(view.emission.is_some() && view.depth.is_some());
    }
}
