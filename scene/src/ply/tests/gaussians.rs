//! Gaussians: what is written, and files of any program that hold the same.

use super::super::*;
use super::{NAMES, ascii, canonical_row, parse, sample, written};
use crate::gaussians::{Gaussian, Gaussians};
use crate::gloss::Gloss;
use crate::harmonics::Harmonics;
use crate::testing::assert_error;
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use glam::{Quat, Vec2, Vec3};

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
