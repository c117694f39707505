use super::*;
use std::path::Path;

fn evaluated(root: &Path, name: &str, psnr: f64) -> PathBuf {
    let folder = root.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let metrics = json!({
        "name": "original",
        "render": {"mode": "path", "seconds_per_frame": 2.0},
        "mean": {"psnr_srgb_db": psnr},
    });
    std::fs::write(folder.join("metrics.json"), metrics.to_string()).unwrap();
    folder
}

fn cell(row: &str, folders: Vec<PathBuf>, published: Option<f64>) -> RepeatCell {
    RepeatCell {
        row: row.to_owned(),
        condition: "original".to_owned(),
        folders,
        published: published
            .map(|value| ("psnr_srgb_db".to_owned(), value))
            .into_iter()
            .collect(),
    }
}

#[test]
fn seeds_become_mean_and_deviation_beside_published_values() {
    let root = tempfile::tempdir().unwrap();
    let [a, b, c] = [("a", 27.0), ("b", 29.0), ("c", 20.0)]
        .map(|(name, psnr)| evaluated(root.path(), name, psnr));
    let options = RepeatOptions {
        cells: vec![
            cell("path", vec![a, b], Some(28.65)),
            cell("bounces-3", vec![c], None),
        ],
        metrics: vec!["psnr_srgb_db".to_owned()],
    };
    let table = tabulate_repeats(&options, vec!["a note".to_owned()]).unwrap();
    // The deviation of 27 and 29 about 28: the root of (1 + 1) / 1.
    assert_eq!(
        table.markdown(),
        "| row | original: PSNR sRGB ↑ | original: paper | original: s/frame |\n|---|---:|---:|---:|\n\
         | path | 28.00 ± 1.41 | 28.65 | 2.000 ± 0.000 |\n| bounces-3 | 20.00 | -- | 2.000 |\n\n- a note\n"
    );
    let out = root.path().join("table");
    table.write(&out).unwrap();
    let csv = std::fs::read_to_string(out.join("table.csv")).unwrap();
    assert!(csv.contains("\npath,original,2,28,1.414"), "{csv}");
    assert!(csv.contains("\nbounces-3,original,1,20,,,"), "{csv}");
    let json: Value =
        serde_json::from_slice(&std::fs::read(out.join("table.json")).unwrap()).unwrap();
    assert_eq!(
        json["cells"][0]["values"]["psnr_srgb_db"]["values"],
        json!([27.0, 29.0])
    );
    assert_eq!(json["cells"][0]["published"]["psnr_srgb_db"], 28.65);
}

#[test]
fn cells_are_filled_once_and_from_their_condition() {
    let root = tempfile::tempdir().unwrap();
    let folder = evaluated(root.path(), "a", 27.0);
    let twice = cell("path", vec![folder.clone()], None);
    let other = RepeatCell {
        condition: "relit".to_owned(),
        ..twice.clone()
    };
    for (cells, part) in [
        (vec![twice.clone(), twice.clone()], "path"),
        (vec![other], "no condition is called `relit`"),
    ] {
        let metrics = vec!["psnr_srgb_db".to_owned()];
        let error = tabulate_repeats(&RepeatOptions { cells, metrics }, Vec::new());
        let message = error.unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
}
