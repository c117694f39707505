mod points;
mod preview;

use super::*;
use crate::gaussians::{Gaussian, Gaussians};
use crate::gloss::Gloss;
use crate::harmonics::Harmonics;
use crate::testing::assert_error;
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use glam::{Quat, Vec2, Vec3};
use std::path::Path;

/// The canonical order of the 17 properties, as other programs write it.
const NAMES: &str = "x y z scales_0 scales_1 quaternions_0 quaternions_1 quaternions_2 quaternions_3 opacities \
                     radiances_0 radiances_1 radiances_2 emissives albedos_0 albedos_1 albedos_2";

fn sample(num: usize) -> Gaussians {
    (0..num)
        .map(|i| {
            let t = i as f32;
            Gaussian {
                position: Vec3::new(t, -0.1 * t, 1e-7 * t),
                scale: Vec2::new(0.01 + t, 1e-6),
                rotation: Quat::from_xyzw((t + 1.0).sin(), t.cos(), 0.3, 0.7 - t).normalize(),
                opacity: (0.37 * t).fract(),
                radiance: Vec3::new(0.0, t * 100.0, 1.0 / (t + 3.0)),
                harmonics: Harmonics::NONE,
                gloss: Gloss::NONE,
                emission: (0.7 * t).fract(),
                albedo: Vec3::new(0.0, 1.0, (0.1 * t).fract()),
            }
        })
        .collect()
}

fn canonical_row(g: &Gaussian) -> [f32; 17] {
    let (p, s, q, r, a) = (g.position, g.scale, g.rotation, g.radiance, g.albedo);
    [
        p.x, p.y, p.z, s.x, s.y, q.w, q.x, q.y, q.z, g.opacity, r.x, r.y, r.z, g.emission, a.x,
        a.y, a.z,
    ]
}

/// A file with one vertex in ascii whose values are as given.
fn ascii(values: [f32; 17]) -> Vec<u8> {
    let mut text = "ply\nformat ascii 1.0\nelement vertex 1\n".to_owned();
    for name in NAMES.split(' ') {
        text += &format!("property float {name}\n");
    }
    text += "end_header\n";
    for value in values {
        text += &format!("{value} ");
    }
    text.into_bytes()
}

fn parse(bytes: &[u8]) -> crate::Result<Gaussians> {
    super::gaussians::parse(Path::new("a.ply"), bytes)
}

fn written(gaussians: &Gaussians) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.ply");
    write_gaussians(&path, gaussians).unwrap();
    std::fs::read(&path).unwrap()
}

#[test]
fn a_written_gaussian_has_the_bytes_of_the_format() {
    let gaussian = Gaussian {
        position: Vec3::new(1.0, 2.0, 3.0),
        scale: Vec2::new(0.5, 0.25),
        rotation: Quat::from_xyzw(0.5, -0.5, 0.5, -0.5),
        opacity: 0.75,
        radiance: Vec3::new(4.0, 5.0, 6.0),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 0.125,
        albedo: Vec3::new(0.0, 1.0, 0.5),
    };
    let mut wanted = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n".to_owned();
    for name in NAMES.split(' ') {
        wanted += &format!("property float {name}\n");
    }
    wanted += "end_header\n";
    let mut wanted = wanted.into_bytes();
    let row: [f32; 17] = [
        1.0, 2.0, 3.0, 0.5, 0.25, -0.5, 0.5, -0.5, 0.5, 0.75, 4.0, 5.0, 6.0, 0.125, 0.0, 1.0, 0.5,
    ];
    wanted.extend(row.iter().flat_map(|v| v.to_le_bytes()));
    let gaussians = Gaussians::from_iter([gaussian]);
    assert_eq!(written(&gaussians), wanted);
    assert_eq!(parse(&wanted).unwrap(), gaussians);
}

#[test]
fn reading_and_writing_again_changes_no_byte() {
    for num in [0, 1, 1000] {
        let bytes = written(&sample(num));
        let back = parse(&bytes).unwrap();
        assert_eq!(back.len(), num);
        assert!(written(&back) == bytes, "{num}");
    }
    // Far from unit length on the way out: normalised there, so that what is read is what was
    // written.
    let mut long = sample(3);
    long.rotations[1] = Quat::from_xyzw(0.0, 3.0, 4.0, 0.0);
    let bytes = written(&long);
    let back = parse(&bytes).unwrap();
    assert_eq!(back.rotations[1], Quat::from_xyzw(0.0, 0.6, 0.8, 0.0));
    assert!(written(&back) == bytes);
}

#[test]
fn any_order_any_type_any_encoding_and_strange_neighbours() {
    let gaussians = sample(50);
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for with_lists in [false, true] {
            let bytes = foreign_file(&gaussians, encoding, with_lists);
            assert_eq!(parse(&bytes).unwrap(), gaussians, "{encoding} {with_lists}");
            // The end is not needed: the faces, and of the last vertex a property that is not read.
            let num_needed = bytes.len() - 60;
            for_each_truncation(&bytes[..num_needed], 60, |prefix| {
                assert_error(parse(prefix), &["a.ply: "]);
            });
            for_each_damage(&bytes, 0..200, |damaged| drop(parse(damaged)));
        }
    }
}

/// A file as no program writes it but any may: reversed order, every second property double, other
/// properties, with or without lists, an element before and one after, carriage returns, comments.
fn foreign_file(gaussians: &Gaussians, encoding: &str, with_lists: bool) -> Vec<u8> {
    let ascii = encoding == "ascii";
    let big = encoding == "binary_big_endian";
    let mut bytes = Vec::new();
    let mut header = format!(
        "ply\r\nformat {encoding} 1.0\r\ncomment end_header of another\r\nobj_info x\r\n\
         element camera 2\r\nproperty uchar id\r\nproperty int16 row\r\n"
    );
    if with_lists {
        header += "property list uchar ushort track\r\n";
    }
    header += &format!(
        "element vertex {}\r\nproperty char flag\r\n",
        gaussians.len()
    );
    if with_lists {
        header += "property list int float neighbours\r\n";
    }
    let names: Vec<&str> = NAMES.split(' ').rev().collect();
    for (i, name) in names.iter().enumerate() {
        header += &format!(
            "property {} {name}\r\n",
            if i % 2 == 0 { "float64" } else { "float" }
        );
    }
    header += "property uint extra\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n";
    bytes.extend(header.into_bytes());

    let mut put = |kind: &str, value: f64| {
        let mut raw = match kind {
            _ if ascii => format!("{value}\n").into_bytes(),
            "u8" => vec![value as u8],
            "i8" => (value as i8).to_le_bytes().to_vec(),
            "i16" => (value as i16).to_le_bytes().to_vec(),
            "u16" => (value as u16).to_le_bytes().to_vec(),
            "i32" => (value as i32).to_le_bytes().to_vec(),
            "u32" => (value as u32).to_le_bytes().to_vec(),
            "f32" => (value as f32).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        };
        if big {
            raw.reverse();
        }
        bytes.extend(raw);
    };
    for camera in 0..2 {
        put("u8", 200.0);
        put("i16", -300.0);
        if with_lists {
            put("u8", f64::from(camera));
            (0..camera).for_each(|_| put("u16", 60_000.0));
        }
    }
    for (index, gaussian) in gaussians.iter().enumerate() {
        put("i8", -1.0);
        if with_lists {
            put("i32", (index % 3) as f64);
            (0..index % 3).for_each(|_| put("f32", 0.5));
        }
        let row = canonical_row(&gaussian);
        for (i, value) in row.iter().rev().enumerate() {
            put(if i % 2 == 0 { "f64" } else { "f32" }, f64::from(*value));
        }
        put("u32", 4e9);
    }
    put("u8", 10.0);
    (0..10).for_each(|i| put("i32", f64::from(i)));
    bytes
}

#[test]
fn impossible_values_are_named() {
    let good = canonical_row(&sample(1).get(0));
    assert!(parse(&ascii(good)).is_ok());
    let cases = [
        (0, f32::NAN, "a.ply: vertex[0].x: NaN is not finite"),
        (
            12,
            f32::INFINITY,
            "vertex[0].radiances_2: inf is not finite",
        ),
        (4, 0.0, "vertex[0].scales_1: 0.0 is not above 0"),
        (3, -0.5, "vertex[0].scales_0: -0.5 is not above 0"),
        (9, 1.5, "vertex[0].opacities: 1.5 is outside 0 to 1"),
        (13, -0.001, "vertex[0].emissives: -0.001 is outside 0 to 1"),
        (16, 4.001, "vertex[0].albedos_2: 4.001 is outside 0 to 4"),
        (10, -1e-6, "vertex[0].radiances_0: -1e-6 is negative"),
    ];
    for (property, value, wanted) in cases {
        let mut row = good;
        row[property] = value;
        assert_error(parse(&ascii(row)), &[wanted]);
        // Properties that are not read are not written either.
        let mut gaussians = Gaussians::default();
        gaussians.push(row_to_gaussian(row));
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        assert_error(write_gaussians(&path, &gaussians), &[wanted]);
        assert!(!path.exists());
    }
    let mut row = good;
    row[5..9].fill(0.0);
    assert_error(parse(&ascii(row)), &["vertex[0].quaternions: length 0.0 "]);
}

#[test]
fn light_that_differs_with_the_direction_takes_further_properties() {
    let mut gaussians = sample(5);
    let coefficient = |i: usize, k: usize| (i * 24 + k) as f32 / 50.0 - 1.0;
    gaussians.harmonics = (0..5)
        .map(|i| Harmonics(std::array::from_fn(|k| coefficient(i, k))))
        .collect();
    let bytes = written(&gaussians);
    assert_eq!(parse(&bytes).unwrap(), gaussians);
    // The properties that other programs know come first, and are what they are without.
    let header = String::from_utf8_lossy(&bytes);
    let (first, last) = (
        "albedos_2\nproperty float harmonics_0\n",
        "harmonics_23\nend_header\n",
    );
    assert!(header.contains(first) && header.contains(last));
    let (plain, row) = (written(&sample(5)), 4 * (17 + 24));
    assert_eq!(
        bytes[bytes.len() - 5 * row..][..4 * 17],
        plain[plain.len() - 5 * 4 * 17..][..4 * 17]
    );

    let some_missing = String::from_utf8_lossy(&ascii([0.5; 17]))
        .replace("albedos_2\n", "albedos_2\nproperty float harmonics_0\n");
    let missing = parse(format!("{some_missing} 0.5").as_bytes());
    assert_error(missing, &["a.ply: vertex.harmonics_1: missing property"]);
    gaussians.harmonics[3].0[7] = f32::NAN;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.ply");
    assert_error(
        write_gaussians(&path, &gaussians),
        &["a.ply: vertex[3].harmonics_7: NaN is not finite"],
    );
}

fn row_to_gaussian(row: [f32; 17]) -> Gaussian {
    Gaussian {
        position: Vec3::new(row[0], row[1], row[2]),
        scale: Vec2::new(row[3], row[4]),
        rotation: Quat::from_xyzw(row[6], row[7], row[8], row[5]),
        opacity: row[9],
        radiance: Vec3::new(row[10], row[11], row[12]),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: row[13],
        albedo: Vec3::new(row[14], row[15], row[16]),
    }
}

#[test]
fn rounding_errors_are_clamped_and_quaternions_normalised() {
    let mut row = canonical_row(&sample(1).get(0));
    (row[9], row[13], row[14]) = (1.000_05, -0.000_05, 1.0);
    row[5..9].copy_from_slice(&[0.0, 3.0, 0.0, 4.0]);
    let back = parse(&ascii(row)).unwrap().get(0);
    assert_eq!((back.opacity, back.emission), (1.0, 0.0));
    assert_eq!(back.rotation, Quat::from_xyzw(0.6, 0.0, 0.8, 0.0));
}

#[test]
fn headers_are_not_believed() {
    let file = |text: &str| text.as_bytes().to_vec();
    let cases = [
        ("plx\n", "a.ply: header: not a PLY file"),
        (
            "ply\nformat ascii 1.0\n",
            "a.ply: header: truncated: no end_header",
        ),
        ("ply\nend_header\n", "a.ply: header: no format line"),
        (
            "ply\nformat ascii 1.0\nend_header\n",
            "no element named vertex",
        ),
        (
            "ply\nformat middle_endian 1.0\n",
            "header line 2: unknown format: `format middle_endian 1.0`",
        ),
        (
            "ply\nelement vertex -3\n",
            "header line 2: the count is no number",
        ),
        (
            "ply\nelement vertex 99999999999999999999999\n",
            "header line 2: the count is no number",
        ),
        (
            "ply\nproperty float x\n",
            "header line 2: property before any element",
        ),
        (
            "ply\nelement vertex 1\nproperty quad x\n",
            "header line 3: unknown property type",
        ),
        (
            "ply\nelement vertex 1\nproperty int x\nproperty int x\n",
            "header line 4: property listed twice",
        ),
        ("ply\nhello\n", "header line 2: unknown keyword: `hello`"),
    ];
    for (text, wanted) in cases {
        assert_error(parse(&file(text)), &[wanted]);
    }
    // Counts that would take terabytes, in every encoding, before and in the wanted element.
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for count in ["1000000000000", "18446744073709551615"] {
            let text = format!(
                "ply\nformat {encoding} 1.0\nelement vertex {count}\nproperty float x\nend_header\n1"
            );
            assert_error(parse(&file(&text)), &["vertex: truncated: ", "rows need"]);
            let text = format!(
                "ply\nformat {encoding} 1.0\nelement a {count}\nproperty list uchar int x\n\
                 element vertex 1\nproperty float x\nend_header\n1"
            );
            assert_error(parse(&file(&text)), &["vertex: truncated: "]);
        }
    }
}

#[test]
fn a_missing_property_is_named_with_those_found() {
    let bytes = written(&sample(2));
    let text = String::from_utf8_lossy(&bytes).replace("emissives", "emission");
    // The rows hold no valid UTF-8, but the header is checked first.
    assert_error(
        parse(text.as_bytes()),
        &[
            "a.ply: vertex.emissives: missing property; found x y z scales_0",
            "emission",
        ],
    );
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("preview.ply");
    write_preview(&path, &sample(2), Preview::ThreeD).unwrap();
    assert_error(
        read_gaussians(&path),
        &[
            "preview.ply: vertex.radiances_0",
            "3D Gaussian Splatting",
            "`eagpt import`",
        ],
    );
    assert_error(
        read_gaussians(&dir.path().join("none.ply")),
        &["none.ply: no such file"],
    );
}

#[test]
fn truncated_and_damaged_files_are_errors_or_gaussians() {
    let bytes = written(&sample(20));
    for_each_truncation(&bytes, 400, |prefix| {
        assert_error(parse(prefix), &["a.ply: "]);
    });
    let mut num_refused = 0;
    for_each_damage(&bytes, 0..2000, |damaged| {
        num_refused += u32::from(parse(damaged).is_err());
    });
    assert!((200..2000).contains(&num_refused), "{num_refused}");
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(200))]

    /// Whatever follows a plausible header, reading ends in an error or in as many rows as
    /// promised.
    #[test]
    fn any_body_is_read_or_refused(
        count in 0_usize..6,
        encoding in 0_usize..3,
        body in proptest::collection::vec(0_u8..=255, 0..200),
    ) {
        let encoding = ["ascii", "binary_little_endian", "binary_big_endian"][encoding];
        let mut bytes = format!(
            "ply\nformat {encoding} 1.0\nelement vertex {count}\nproperty float x\nproperty double y\n\
             property float z\nproperty list uchar uchar more\nproperty uchar red\nproperty uchar green\n\
             property uchar blue\nend_header\n"
        ).into_bytes();
        bytes.extend(body);
        if let Ok(cloud) = super::points::parse(Path::new("a.ply"), &bytes) {
            proptest::prop_assert_eq!(cloud.len(), count);
            proptest::prop_assert_eq!(cloud.colors_srgb8.len(), count);
        }
    }
}

#[test]
fn gloss_is_optional_and_checked() {
    let mut gaussians = sample(5);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.ply");
    write_gaussians(&path, &gaussians).unwrap();
    let diffuse = std::fs::read(&path).unwrap();
    assert!(!String::from_utf8_lossy(&diffuse).contains("speculars_0"));
    let shiny = Gloss {
        specular: Vec3::new(0.9, 0.5, 0.04),
        roughness: 0.3,
    };
    gaussians.set(
        2,
        &Gaussian {
            gloss: shiny,
            ..gaussians.get(2)
        },
    );
    write_gaussians(&path, &gaussians).unwrap();
    let back = read_gaussians(&path).unwrap();
    assert_eq!(back, gaussians);
    assert_eq!((back.get(2).gloss, back.get(3).gloss), (shiny, Gloss::NONE));
    assert!(back.is_glossy());
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(
        bytes.len(),
        diffuse.len() + 5 * 16 + 4 * "property float speculars_0\n".len()
    );
    gaussians.gloss[4].roughness = 1.5;
    assert_error(
        write_gaussians(&path, &gaussians),
        &["a.ply: vertex[4].roughnesses: 1.5 is outside 0 to 1"],
    );
    let some_missing = String::from_utf8_lossy(&ascii([0.5; 17]))
        .replace("albedos_2\n", "albedos_2\nproperty float speculars_0\n");
    let missing = parse(format!("{some_missing} 0.5").as_bytes());
    assert_error(missing, &["a.ply: vertex.speculars_1: missing property"]);
}
