//! Several lightings of the room: conditions, regions, and the table of modes.

use crate::support::Workplace;
use eagpt_scene::exr::{self, Precision};
use serde_json::{Value, json};

/// A room, `relit` with half of its light in the upper halves of the pictures and without masks,
/// and renderings in two modes.
fn place() -> Workplace {
    Workplace::shared("relit", make_place)
}

fn make_place() -> Workplace {
    let place = Workplace::trained();
    for (name, bytes) in place.contents("room") {
        if name.starts_with("Radiance-exr") || !name.contains('/') {
            let path = place.path("relit").join(&name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
    }
    for view in ["000", "008"] {
        let path = place.path(&format!("relit/Radiance-exr/{view}.exr"));
        let mut image = exr::read_rgb(&path).unwrap();
        let half = image.pixels().len() / 2;
        for pixel in &mut image.pixels_mut()[..half] {
            *pixel = pixel.map(|value| 0.5 * value);
        }
        exr::write_rgb(&path, &image, Precision::Float).unwrap();
    }
    for mode in ["0-bounce", "1-bounce"] {
        place.succeeds(&format!(
            "render run/scene.ply --cameras room --mode {mode} --spp 4 --aov emission --out {mode}"
        ));
    }
    place
}

#[test]
fn two_conditions_and_the_table_of_modes() {
    let place = place();
    let both = "--reference room --reference relit --before room";
    place.succeeds(&format!("eval 0-bounce 0-bounce {both} --out both"));
    let found = place.json("both/metrics.json");
    let [room, relit] = found["conditions"].as_array().unwrap().as_slice() else {
        panic!("not two conditions: {found}")
    };
    assert_eq!(
        (&room["name"], &relit["name"]),
        (&json!("room"), &json!("relit"))
    );
    let db = |value: &Value| value["mean"]["psnr_srgb_db"].as_f64().unwrap();
    assert!((db(&found) - (db(room) + db(relit)) / 2.0).abs() < 1e-9);
    assert!(db(relit) < db(room));
    assert_eq!(relit["render"]["mode"], "0-bounce");
    assert_eq!(relit["render"]["spp"], Value::Null);
    assert_eq!(relit["render"]["denoiser"], Value::Null);
    assert!(relit["render"]["seconds_per_frame"].as_f64().unwrap() > 0.0);
    // The upper half has lost half its light: the lower one is lit. Before the room there is
    // nothing but itself.
    assert!(room["regions"].get("lit").is_none(), "{room}");
    let share = |region: &str| relit["regions"][region]["share"].as_f64().unwrap_or(0.0);
    assert!(
        share("lit") > 0.3 && share("shadow") > 0.3,
        "{}",
        relit["regions"]
    );
    assert!((share("lit") + share("shadow") + share("emitter") - 1.0).abs() < 1e-9);
    for name in [
        "both/relit/flip/008.png",
        "both/room/metrics.json",
        "both/table.tex",
    ] {
        assert!(place.path(name).is_file(), "{name}");
    }
    let record = place.json("both/record.json");
    assert_eq!(record["options"]["conditions"][1]["name"], "relit");

    // One condition alone says the same as among others.
    place.succeeds("eval 1-bounce --reference relit --before room --name other --out one");
    let one = place.json("one/metrics.json");
    assert_eq!(one["name"], "other");
    place.succeeds("eval 1-bounce --reference relit --before room --out relit-1");
    assert_eq!(place.json("relit-1/metrics.json")["mean"], one["mean"]);
    assert_eq!(one["render"]["spp"], 4);

    let shown = place.succeeds(
        "eval table relit-1 baked=one both --metrics psnr_srgb_db,flip_hdr_aligned --out table",
    );
    let table = place.json("table/table.json");
    assert_eq!(table["conditions"], json!(["relit", "other", "room"]));
    let rows: Vec<&Value> = table["rows"].as_array().unwrap().iter().collect();
    let names: Vec<&Value> = rows.iter().map(|row| &row["name"]).collect();
    assert_eq!(names, ["0-bounce", "1-bounce", "baked"]);
    assert_eq!(
        rows[0]["conditions"]["relit"]["mean"]["psnr_srgb_db"],
        db(relit)
    );
    assert_eq!(rows[1]["conditions"]["room"], Value::Null);
    assert!(shown.contains("relit: PSNR sRGB ↑"), "{shown}");
    assert_eq!(
        place.names("table"),
        [
            "record.json",
            "table.csv",
            "table.json",
            "table.md",
            "table.tex"
        ]
    );
    place.fails_cleanly("eval table both --out table", &["table", "--force"]);
    place.succeeds("eval table both --out table --force");
    place.fails_cleanly(
        "eval table both --out one --force",
        &["one/record.json", "`eval`"],
    );
}

#[test]
fn conditions_that_do_not_pair() {
    let place = place();
    let eval = "eval 0-bounce 1-bounce --out out";
    place.fails_cleanly(
        &format!("{eval} --reference room"),
        &["--reference", "1 times for 2 folders"],
    );
    place.fails_cleanly(
        "eval 0-bounce --out out --reference room --reference relit",
        &["--reference", "2 times for 1 folders"],
    );
    let eval = format!("{eval} --reference room --reference relit");
    place.fails_cleanly(&format!("{eval} --name a"), &["--name", "1 times for 2"]);
    place.fails_cleanly(
        &format!("{eval} --split all --split test --split test"),
        &["--split", "3 times for 2"],
    );
    place.fails_cleanly(&format!("{eval} --name a --name a"), &["name", "a"]);
    place.fails_cleanly(&format!("{eval} --name a --name ../b"), &["name", "../b"]);
    place.fails_cleanly(&format!("{eval} --before nowhere"), &["nowhere"]);
    place.fails_cleanly(
        "eval 0-bounce 1-bounce --reference room --reference room --out out",
        &["name: room"],
    );
    place.fails_cleanly("eval table 0-bounce --out out", &["0-bounce/metrics.json"]);
    place.write("0-bounce/record.json", "{");
    place.fails_cleanly(
        "eval 0-bounce --reference room --out out",
        &["0-bounce/record.json", "JSON"],
    );
    std::fs::remove_file(place.path("0-bounce/record.json")).unwrap();
    place.succeeds("eval 0-bounce --reference room --out out");
    assert_eq!(
        place.json("out/metrics.json")["render"]["mode"],
        Value::Null
    );
    place.fails_cleanly(
        "eval table out --out table",
        &["out/metrics.json", "render.mode", "ROW=DIR"],
    );
    place.fails_cleanly(
        "eval table a=out --metrics psnr --out table",
        &["metrics", "psnr_srgb_db"],
    );
}
