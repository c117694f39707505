//! `eagpt ingest`: brackets in, images of linear light and a report out.

use crate::support::Workplace;
use eagpt_scene::exr;
use eagpt_synth::dng::{self, DngInfo, Mosaic, RGGB};

const SIZE: (u32, u32) = (96, 64);

/// A bracket of three shots of a grey ramp at each position, `c/p<position>_<index>.dng`.
pub(crate) fn capture(place: &Workplace, positions: u32) {
    std::fs::create_dir_all(place.path("c")).unwrap();
    for position in 0..positions {
        for index in 0..3 {
            let exposure_s = 0.01 * 4.0_f64.powi(index);
            let samples = (0..SIZE.0 * SIZE.1).map(|i| {
                // Different photographs differ.
                let light = f64::from(i % SIZE.0 + 4 * position + 1) * exposure_s / 30.0;
                (512.0 + 15_871.0 * light.min(1.0)) as u16
            });
            let mosaic = Mosaic {
                width: SIZE.0,
                height: SIZE.1,
                samples: samples.collect(),
            };
            let info = DngInfo {
                make: "Virtual".to_owned(),
                model: "Rig".to_owned(),
                cfa: RGGB,
                black: [512; 4],
                white: 16_383,
                as_shot_neutral: [1.0; 3],
                camera_from_xyz: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                exposure_s: Some(exposure_s),
                iso: 100,
                f_number: 8.0,
                focal_length_mm: 16.0,
                taken_ms: 1_700_000_000_000 + 1000 * (3 * u64::from(position) + index as u64),
            };
            let path = place.path(&format!("c/p{position}_{index}.dng"));
            dng::write(&path, &mosaic, &info).unwrap();
        }
    }
}

#[test]
fn a_capture_becomes_images_a_record_and_a_report() {
    let place = Workplace::new();
    capture(&place, 2);
    place.succeeds("ingest c --out out --long-side 48");
    let made = place.names("out");
    let expected = [
        "Preview/p0.png",
        "Preview/p1.png",
        "Radiance-exr/p0.exr",
        "Radiance-exr/p1.exr",
        "Unreliable/p0.png",
        "Unreliable/p1.png",
        "capture.json",
        "record.json",
        "report.html",
        "report.json",
        "shard-1-of-1.record.json",
    ];
    assert_eq!(made, expected);
    let image = exr::read_rgb(&place.path("out/Radiance-exr/p0.exr")).unwrap();
    assert_eq!(image.size(), (48, 32));
    // A ramp: 90 is three times as bright as 30, and neutral light stays neutral.
    let [left, right] = [14, 44].map(|x| image.get(x, 16));
    assert!(
        (right[1] / left[1] - 89.5 / 29.5).abs() < 0.05,
        "{left:?} {right:?}"
    );
    assert!((right[0] / right[1] - 1.0).abs() < 0.02, "{right:?}");
    let record = place.json("out/record.json");
    assert_eq!(record["command"], "ingest");
    assert_eq!(record["inputs"].as_array().unwrap().len(), 6);
    assert_eq!(record["options"]["long_side"], 48);
    assert_eq!(place.json("out/capture.json")["camera"], "Virtual Rig");
    let page = String::from_utf8(place.bytes("out/report.html")).unwrap();
    assert!(page.contains("data:image/jpeg;base64,") && !page.contains("<script"));
}

#[test]
fn the_same_command_goes_on_and_force_starts_over() {
    let place = Workplace::trained();
    capture(&place, 2);
    place.succeeds("ingest c --out out --scale 0.01");
    let before = place.contents("out");
    capture(&place, 3);
    let text = place.succeeds("ingest c --out out --scale 0.01 --json");
    assert!(text.contains("\"num_kept\":2"), "{text}");
    let after = place.contents("out");
    assert_eq!(before["Radiance-exr/p0.exr"], after["Radiance-exr/p0.exr"]);
    assert!(after.contains_key("Radiance-exr/p2.exr"));
    place.fails_cleanly(
        "ingest c --out out --scale 0.02",
        &["out: p0: was made with other options", "--force"],
    );
    std::fs::remove_file(place.path("c/p2_0.dng")).unwrap();
    std::fs::remove_file(place.path("c/p2_1.dng")).unwrap();
    std::fs::remove_file(place.path("c/p2_2.dng")).unwrap();
    place.succeeds("ingest c --out out --scale 0.02 --force");
    assert!(
        !place
            .names("out")
            .contains(&"Radiance-exr/p2.exr".to_owned())
    );
    // Results of other commands are not touched.
    place.fails_cleanly("ingest c --out run --force", &["`train`"]);
}

#[test]
fn everything_wrong_is_a_line_each() {
    let place = Workplace::new();
    capture(&place, 3);
    std::fs::remove_file(place.path("c/p0_1.dng")).unwrap();
    place.write("c/p1_2.dng", "no photograph");
    let output = place.run("ingest c --out out --quiet");
    assert_eq!(output.status.code(), Some(1));
    let stderr = String::from_utf8(output.stderr).unwrap();
    let lines: Vec<&str> = stderr.lines().collect();
    assert_eq!(lines.len(), 3, "{stderr}");
    for (line, part) in lines.iter().zip([
        "p1_2.dng: RAW: ",
        "p0: misses 1 of 3 exposures: 1/25 s",
        "c: 2 problems",
    ]) {
        assert!(line.starts_with("error: ") && line.contains(part), "{line}");
    }
    assert!(!place.path("out/Radiance-exr").exists());
    place.succeeds("ingest c --out out --skip-bad");
    let record = place.json("out/record.json");
    assert_eq!(record["warnings"].as_array().unwrap().len(), 2);
    place.fails("ingest c --out c/out", &["outside of the capture"]);
    assert_eq!(
        place
            .run("ingest c --out d --white-balance warm")
            .status
            .code(),
        Some(2)
    );
    place.fails(
        "ingest c --out d --vignetting=-2,0,0",
        &["option vignetting"],
    );
}

/// A RW2 of 131072x131072 pixels in a few hundred bytes: the directory of a camera that decoders
/// know, and no samples.
fn huge_rw2() -> Vec<u8> {
    const LONG: u16 = 4;
    const SHORT: u16 = 3;
    const ASCII: u16 = 2;
    let text = |text: &str| text.bytes().chain([0]).collect::<Vec<u8>>();
    let number = |value: u32| value.to_le_bytes().to_vec();
    let entries = [
        (0x02, LONG, number(131_072)),
        (0x03, LONG, number(131_072)),
        (0x0a, SHORT, number(12)),
        (0x24, SHORT, number(500)),
        (0x25, SHORT, number(256)),
        (0x26, SHORT, number(400)),
        (0x2d, SHORT, number(4)),
        (0x10f, ASCII, text("Panasonic")),
        (0x110, ASCII, text("DMC-GX1")),
        (0x111, LONG, number(8)),
        (0x117, LONG, number(8)),
    ];
    let mut file = [b"IIU\0".as_slice(), &number(8)].concat();
    file.extend((entries.len() as u16).to_le_bytes());
    let (mut texts, texts_at) = (Vec::new(), 8 + 2 + 12 * entries.len() + 4);
    for (tag, kind, value) in entries {
        let (count, value) = if kind == ASCII {
            let at = texts_at + texts.len();
            texts.extend(&value);
            (value.len() as u32, number(at as u32))
        } else {
            (1, value)
        };
        file.extend([tag, kind].map(u16::to_le_bytes).concat());
        file.extend([number(count), value].concat());
    }
    [file, vec![0; 4], texts].concat()
}

/// A CRW whose directory is 60 times in itself: decoders follow that ten levels deep, which does
/// not end.
fn endless_crw() -> Vec<u8> {
    const HEADER: u32 = 26;
    const ENTRIES: u32 = 60;
    const ENTRY: u32 = 10;
    let length = 2 + ENTRIES * ENTRY + 12;
    let mut file = [b"II".as_slice(), &HEADER.to_le_bytes(), b"HEAPCCDR"].concat();
    file.resize(HEADER as usize, 0);
    file.extend((ENTRIES as u16).to_le_bytes());
    for _ in 0..ENTRIES {
        file.extend(0x2801_u16.to_le_bytes());
        file.extend([length, 0].map(u32::to_le_bytes).concat());
    }
    file.resize((HEADER + length) as usize, 0);
    file
}

#[test]
fn a_file_that_would_end_the_process_is_one_line() {
    let place = Workplace::new();
    capture(&place, 2);
    place.succeeds("ingest c --out good");
    let good = place.contents("good");
    let files = [
        (
            "zz.rw2",
            huge_rw2(),
            "decoding it takes 32.0 GiB of memory at once",
        ),
        (
            "zz.crw",
            endless_crw(),
            "decoding it did not end within 20 s",
        ),
    ];
    for (name, bytes, _) in &files {
        std::fs::write(place.path("c").join(name), bytes).unwrap();
    }
    let output = place.run("ingest c --out bad --quiet");
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert_eq!(stderr.lines().count(), 3, "{stderr}");
    for (name, _, part) in &files {
        let mut lines = stderr.lines();
        let line = lines.find(|line| line.starts_with(&format!("error: {name}: decoding: ")));
        assert!(line.is_some_and(|line| line.contains(part)), "{stderr}");
    }
    // Once: the endless file takes its 20 s of a processor in every run.
    std::fs::remove_file(place.path("c/zz.crw")).unwrap();
    place.succeeds("ingest c --out bad --skip-bad");
    for (file, bytes) in place.contents("bad") {
        if file.ends_with(".exr") || file.ends_with(".png") {
            assert!(good[&file] == bytes, "{file}");
        }
    }
}
