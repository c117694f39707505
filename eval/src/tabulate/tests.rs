use super::*;
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;

fn evaluation(name: &str, mode: Option<&str>, db: Option<f64>, seconds: Option<f64>) -> Value {
    json!({
        "name": name,
        "render": {"mode": mode, "spp": mode.map(|_| 64), "seconds_per_frame": seconds},
        "mean": {"psnr_srgb_db": db, "flip_hdr": 0.125, "exposure_scale": 0.5},
        "views": [],
    })
}

struct Case {
    dir: TempDir,
    options: TableOptions,
}

impl Case {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let options = TableOptions {
            folders: Vec::new(),
            metrics: DEFAULT_METRICS.map(str::to_owned).to_vec(),
        };
        Self { dir, options }
    }

    fn add(&mut self, folder: &str, row: Option<&str>, metrics: &Value) {
        let path = self.dir.path().join(folder);
        std::fs::create_dir_all(&path).unwrap();
        std::fs::write(path.join("metrics.json"), metrics.to_string()).unwrap();
        self.options.folders.push(TableFolder {
            folder: path,
            row: row.map(str::to_owned),
        });
    }

    fn output(&self, name: &str) -> String {
        std::fs::read_to_string(self.dir.path().join("out").join(name)).unwrap()
    }

    #[track_caller]
    fn assert_refused(&self, parts: &[&str]) {
        let message = tabulate(&self.options).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    }
}

#[test]
fn modes_down_and_conditions_across() {
    let mut case = Case::new();
    let path = json!({
        "mean": {},
        "conditions": [
            evaluation("original", Some("path"), Some(26.57), Some(180.0)),
            evaluation("relit", Some("path"), None, Some(190.0)),
        ],
    });
    case.add("a", None, &path);
    case.add(
        "b",
        Some("baked"),
        &evaluation("relit", Some("0-bounce"), Some(28.97), Some(0.02)),
    );
    case.add(
        "c",
        None,
        &evaluation("original", Some("0-bounce"), Some(37.57), None),
    );
    case.add(
        "d",
        Some("mine"),
        &evaluation("relit", None, Some(1.0), None),
    );
    let table = tabulate(&case.options).unwrap();
    table.write(&case.dir.path().join("out")).unwrap();
    assert_eq!(table.num_rows(), 4);

    let markdown = case.output("table.md");
    let lines: Vec<&str> = markdown.lines().collect();
    assert_eq!(
        lines[0],
        "| mode | original: PSNR sRGB ↑ | original: SSIM ↑ | original: HDR-FLIP ↓ \
         | original: Exposure scale → 1 | relit: PSNR sRGB ↑ | relit: SSIM ↑ | relit: HDR-FLIP ↓ \
         | relit: Exposure scale → 1 | s/frame |"
    );
    assert_eq!(
        lines[2],
        "| 0-bounce | 37.57 | -- | 0.1250 | 0.500 | -- | -- | -- | -- | -- |"
    );
    // Null decibels are those of equal images.
    assert_eq!(
        lines[3],
        "| path | 26.57 | -- | 0.1250 | 0.500 | inf | -- | 0.1250 | 0.500 | 185.00 |"
    );
    assert_eq!(
        lines[4],
        "| baked | -- | -- | -- | -- | 28.97 | -- | 0.1250 | 0.500 | 0.02 |"
    );
    assert!(lines[5].starts_with("| mine | "), "{markdown}");
    assert!(markdown.contains("path, relit: "), "{markdown}");
    assert!(markdown.contains("/a, 64 spp\n"), "{markdown}");
    assert!(
        case.output("table.tex")
            .contains("\\multicolumn{4}{c}{relit}")
    );

    let csv = case.output("table.csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(
        lines[0],
        "mode,condition,psnr_srgb_db,ssim_srgb,flip_hdr,exposure_scale,seconds_per_frame,spp,denoiser"
    );
    assert_eq!(lines[3], "path,relit,inf,,0.125,0.5,190,64,");
    assert_eq!(lines.len(), 1 + 5);

    let json: Value = serde_json::from_str(&case.output("table.json")).unwrap();
    assert_eq!(json["conditions"], json!(["original", "relit"]));
    assert_eq!(json["rows"][0]["conditions"]["relit"], Value::Null);
    let cell = &json["rows"][1]["conditions"]["relit"];
    assert_eq!(
        cell["mean"],
        json!({"psnr_srgb_db": null, "flip_hdr": 0.125, "exposure_scale": 0.5})
    );
    assert_eq!(cell["render"]["seconds_per_frame"], 190.0);
}

#[test]
fn what_has_no_place_is_refused() {
    let mut case = Case::new();
    let path = evaluation("relit", Some("path"), Some(1.0), None);
    case.add("a", None, &path);
    case.add("b", None, &path);
    case.assert_refused(&["/b: row path, condition relit", "/a has it", "ROW=DIR"]);
    case.options.folders.pop();
    case.add("c", None, &evaluation("relit", None, Some(1.0), None));
    case.assert_refused(&["c/metrics.json", "render.mode", "ROW=DIR"]);
    case.options.folders.pop();
    case.add(
        "d",
        None,
        &json!({"mean": {"psnr_srgb_db": 1.0}, "render": {"mode": "path"}}),
    );
    case.assert_refused(&["d/metrics.json", "name", "missing"]);
    case.options.folders.pop();
    case.add("e", None, &json!({"psnr": 1.0}));
    case.assert_refused(&["e/metrics.json", "JSON", "mean"]);
    case.options.folders.pop();
    case.options.folders[0].folder = Path::new("nowhere").into();
    case.assert_refused(&["nowhere/metrics.json"]);
    case.options.metrics.push("psnr".to_owned());
    case.assert_refused(&["option metrics: psnr", "psnr_srgb_db"]);
}
