//! Measuring the program with itself.

use crate::support::Workplace;
use serde_json::Value;

/// Everything on a tiny room, as short as it gets.
const TINY: &str = "bench room --device cpu --seconds 0 --image 64x48 --thread-counts 1,2";

#[test]
fn every_stage_is_measured_and_compared() {
    let place = Workplace::new();
    let table = place.succeeds(&format!("{TINY} --gaussians 200,0.8k --out out/bench.json"));
    assert!(table.contains("by threads"), "{table}");
    let results = place.json("out/bench.json");
    let rows = results["rows"].as_array().unwrap();
    let figures =
        |stage: &str| -> Vec<&Value> { rows.iter().filter(|row| row["stage"] == stage).collect() };
    // Figures of a stage: those of a scene come for two numbers of Gaussians, all for two numbers
    // of threads.
    for (stage, num) in [
        ("structure", 2 * 4),
        ("camera-rays", 4 * 4),
        ("single-rays", 3 * 4),
        ("bounce-rays", 4 * 4),
        ("shadow-rays", 2 * 4),
        ("transport", 4),
        ("training", 3 * 4),
        ("gathering", 4),
        ("paths", 3 * 4),
        ("light-solve", 4),
        ("ply", 2 * 4),
        ("metrics", 5 * 2),
        ("exr", 2 * 2),
        ("merging", 2),
    ] {
        assert_eq!(figures(stage).len(), num, "{stage}");
    }
    for row in rows {
        let figure = |key: &str| row[key].as_f64().unwrap();
        assert!(
            0.0 < figure("min") && figure("min") <= figure("median"),
            "{row}"
        );
        assert!(figure("median") <= figure("max"), "{row}");
        assert_eq!(row["runs"], 3, "{row}");
    }
    let counts: Vec<u64> = figures("ply")
        .iter()
        .filter_map(|row| row["gaussians"].as_u64())
        .collect();
    assert_eq!(counts, [200, 200, 200, 200, 800, 800, 800, 800]);
    assert!(results["machine"]["cores"].is_u64());
    assert_eq!(place.json("out/bench.record.json")["command"], "bench");

    // Against itself, the same; a hundred times as fast as one that was slow.
    let mut slow = results.clone();
    for row in slow["rows"].as_array_mut().unwrap() {
        let factor = if row["unit"] == "s" { 1e6 } else { 1e-6 };
        for key in ["median", "min", "max"] {
            row[key] = (row[key].as_f64().unwrap() * factor).into();
        }
    }
    place.write("slow.json", slow.to_string());
    let compared = place.succeeds(&format!(
        "{TINY} --stage ply,structure --gaussians 800 --baseline slow.json"
    ));
    assert!(
        compared.contains("before") && compared.contains("ratio"),
        "{compared}"
    );
    assert_eq!(compared.matches("faster").count(), 8, "{compared}");
    let told = place.succeeds(&format!("{TINY} --stage exr --baseline slow.json --json"));
    let told: Value = serde_json::from_str(told.lines().next().unwrap()).unwrap();
    assert_eq!(told["rows"][0]["verdict"], "faster", "{told}");

    place.fails_cleanly(
        &format!("{TINY} --stage exr --out out/bench.json"),
        &["out/bench.json", "is there already"],
    );
    slow["machine"]["processor"] = "another".into();
    place.write("other.json", slow.to_string());
    let other = format!("{TINY} --stage exr --baseline other.json");
    place.fails_cleanly(&other, &["other.json: machine", "another", "--any-machine"]);
    place.succeeds(&format!("{other} --any-machine"));
}

#[test]
fn a_gpu_is_measured_by_the_same_cases() {
    let place = Workplace::new();
    if !crate::device::has_device(&place, "measuring by the program") {
        return;
    }
    let gpu = "bench room --device gpu:0 --seconds 0 --gaussians 200 --out gpu.json";
    place.succeeds(&format!(
        "{gpu} --stage structure,camera-rays,single-rays,bounce-rays,transport,training"
    ));
    let results = place.json("gpu.json");
    let device = results["options"]["device"].as_str().unwrap();
    assert!(device.starts_with("gpu: "), "{device}");
    let rows = results["rows"].as_array().unwrap();
    let named = |stage: &str, what: &str| {
        rows.iter()
            .filter(|row| row["stage"] == stage && row["what"] == what)
            .count()
    };
    for (stage, what) in [
        ("structure", "update and refit"),
        ("camera-rays", "forward and adjoint"),
        ("camera-rays", "contributions of Gaussians"),
        ("bounce-rays", "all hits, blended"),
        ("transport", "64 directions"),
        ("training", "stage 0 with harmonics"),
        ("training", "stage 1"),
    ] {
        assert_eq!(named(stage, what), 1, "{stage}: {what}");
    }
    assert!(rows.iter().all(|row| row["stage"] != "single-rays"));
    // Figures of a GPU are not those of the CPU.
    place.fails_cleanly(
        &format!("{TINY} --stage structure --baseline gpu.json"),
        &["gpu.json: machine", "device", "--any-machine"],
    );
}

#[test]
fn what_cannot_be_measured_is_said_before_anything_is() {
    let place = Workplace::new();
    place.fails_cleanly("bench nowhere", &["nowhere"]);
    place.fails_cleanly("bench room --scene none.ply", &["none.ply"]);
    place.fails_cleanly(
        "bench room --baseline room/transforms.json",
        &["transforms.json", "results"],
    );
    place.fails_cleanly(
        "bench room --out room/transforms.json --force",
        &["room/transforms", "no record of this program"],
    );
}
