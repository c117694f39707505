//! `eagpt demo`: the chain from brackets to the report.

use crate::support::Workplace;

#[test]
fn the_quick_demo_runs_from_brackets_to_the_report() {
    let place = Workplace::empty();
    place.succeeds("demo --quick --out demo");
    let report = std::fs::read_to_string(place.path("demo/run/report.html")).unwrap();
    for text in ["Emission masks", "baked", "evening.html\""] {
        assert!(report.contains(text), "{text}");
    }
    assert!(place.path("demo/run/bake/evening.html").is_file());
    let edited = place.json("demo/run/edit/evening.record.json");
    let steps = edited["options"]["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 2);
    // The edited scene in the light that it was trained in is far from the evening; with its own
    // light it is near.
    let psnr = |row: &str| {
        let metrics = place.json(&format!("demo/run/eval/evening/{row}/metrics.json"));
        metrics["mean"]["psnr_srgb_db"].as_f64().unwrap()
    };
    let (edited, baked) = (psnr("0-bounce"), psnr("baked"));
    assert!(baked > edited + 4.0 && baked > 17.0, "{edited} {baked}");

    // It goes on from what is there, and does not take the project of other options.
    let again = place.succeeds("run demo/demo.toml --dry-run");
    assert!(again.contains("\n0 of "), "{again}");
    place.fails(
        "demo --quick --seed 7 --out demo",
        &["demo/demo.toml", "is not what these options write"],
    );
}
