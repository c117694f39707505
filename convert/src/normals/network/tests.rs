use super::*;
use eagpt_testkit::room::{self, RoomOptions};
use std::io::Write;

fn model(name: &str) -> NetworkOptions {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    NetworkOptions::new(folder.join(name))
}

#[test]
fn ranges_are_checked_by_name() {
    let fine = model("identity.onnx");
    fine.validate().unwrap();
    let wrong = [
        (
            "size",
            NetworkOptions {
                size: Some([0, 4]),
                ..fine.clone()
            },
        ),
        (
            "multiple",
            NetworkOptions {
                multiple: 0,
                ..fine.clone()
            },
        ),
        (
            "mean",
            NetworkOptions {
                mean: [f32::NAN; 3],
                ..fine.clone()
            },
        ),
        (
            "deviation",
            NetworkOptions {
                deviation: [1.0, 0.0, 1.0],
                ..fine
            },
        ),
    ];
    for (name, options) in wrong {
        let message = options.validate().unwrap_err().to_string();
        assert!(
            message.starts_with(&format!("option {name}: ")),
            "{message}"
        );
    }
}

/// `data/models.py` wrote the models: the output equals the input in every layout.
#[test]
fn pictures_go_in_and_maps_come_out() {
    if std::env::var_os(LIBRARY_VARIABLE).is_none() {
        // Straight to the stream: what `eprintln!` writes is hidden unless the test fails.
        writeln!(
            std::io::stderr(),
            "skipped: networks: {LIBRARY_VARIABLE} is not set"
        )
        .unwrap();
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let options = RoomOptions {
        num_views: 1,
        width: 25,
        height: 15,
        num_samples: 4,
        num_points: 20,
        seed: 1,
    };
    room::write(dir.path(), &options, |_| ()).unwrap();
    let dataset = Dataset::open(dir.path()).unwrap();
    let radiance = dataset.load_view(0).unwrap().radiance;
    // Rounded to a multiple of 8; that of the model; that requested.
    let cases = [
        ("identity.onnx", None, (24, 16)),
        ("channels-last.onnx", None, (24, 16)),
        ("identity.onnx", Some([10, 6]), (10, 6)),
    ];
    for (name, size, expected) in cases {
        let options = NetworkOptions {
            size,
            multiple: 8,
            mean: [0.5; 3],
            deviation: [0.5, 0.25, 1.0],
            ..model(name)
        };
        let out = dir.path().join("maps");
        run_network(&dataset, &options, &out, &mut |_| ()).unwrap();
        let map = exr::read_rgb(&out.join("000.exr")).unwrap();
        let seen = picture(&radiance, expected);
        let expected = seen.map(|[r, g, b]| [(r - 0.5) / 0.5, (g - 0.5) / 0.25, b - 0.5]);
        assert_eq!(map, expected, "{name}");
    }
    let damaged = dir.path().join("damaged.onnx");
    std::fs::write(&damaged, b"no model").unwrap();
    let error = run_network(
        &dataset,
        &NetworkOptions::new(damaged),
        dir.path(),
        &mut |_| (),
    );
    assert!(error.unwrap_err().to_string().contains("damaged.onnx: "));
}
