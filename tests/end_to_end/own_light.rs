//! The check of a scene's own light that ends `eagpt train`.

use crate::support::Workplace;
use serde_json::Value;

/// The figures are those of `bake`, `render` and `eval` but for the half floats of EXR files (3e-5
/// dB).
#[test]
fn a_scene_in_its_own_light_is_what_bake_render_and_eval_make_of_it() {
    let place = Workplace::trained();
    let record = place.json("run/record.json");
    let found = &record["measured"]["own_light"];
    let seed = &record["seed"];
    place.succeeds(&format!(
        "bake run/scene.ply --cameras room --seed {seed} --out baked.ply"
    ));
    place.succeeds("render baked.ply --cameras room --mode 0-bounce --split train --out shown");
    place.succeeds("eval shown --reference room --split train --out eval");
    let metrics = place.json("eval/metrics.json");
    let number = |of: &Value| of.as_f64().unwrap();
    assert_eq!(
        (&metrics["num_views"], number(&found["num_views"])),
        (&10.into(), 10.0)
    );
    let [db, wanted_db] = [found, &metrics["mean"]].map(|of| number(&of["psnr_srgb_db"]));
    assert!((db - wanted_db).abs() < 1e-3, "{db} dB, {wanted_db} dB");
    let [factor, wanted] = [found, &metrics].map(|of| number(&of["exposure_scale"]));
    assert!((factor - wanted).abs() < 1e-4, "{factor}, {wanted}");
    let of_channels = found["exposure_scale_rgb"].as_array().unwrap();
    let [least, most] =
        [f64::min, f64::max].map(|choose| of_channels.iter().map(number).reduce(choose).unwrap());
    assert!(least <= factor && factor <= most);
}

#[test]
fn the_last_line_tells_it_where_albedos_are_trained() {
    let place = Workplace::trained();
    let short = "--preset draft --iterations 5 --albedo-iterations 2";
    let said = |arguments: &str| {
        let output = place.run(arguments);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let albedo = said(&format!(
        "train room --start run/scene.ply --out again --stage albedo {short}"
    ));
    let last = albedo.lines().last().unwrap();
    assert!(
        last.starts_with("own light: ") && last.ends_with(" over 10 training views"),
        "{albedo}"
    );
    let radiance = said(&format!("train room --out other --stage radiance {short}"));
    assert!(!radiance.contains("own light"), "{radiance}");
    let record = place.json("other/record.json");
    assert_eq!(record["measured"], serde_json::json!({}));
}
