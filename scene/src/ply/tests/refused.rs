//! Files and values that are refused, or put right.

use super::super::*;
use super::{ascii, canonical_row, parse, sample, written};
use crate::gaussians::{Gaussian, Gaussians};
use crate::gloss::Gloss;
use crate::harmonics::Harmonics;
use crate::testing::assert_error;
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use glam::{Quat, Vec2, Vec3};
use std::path::Path;

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
        if let Ok(cloud) = super::super::points::parse(Path::new("a.ply"), &bytes) {
            proptest::prop_assert_eq!(cloud.len(), count);
            proptest::prop_assert_eq!(cloud.colors_srgb8.len(), count);
        }
    }
}
