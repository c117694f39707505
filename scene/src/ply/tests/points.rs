//! Point clouds.

use super::super::*;
use crate::testing::assert_error;
use eagpt_testkit::damage::for_each_truncation;
use eagpt_testkit::test_data;
use glam::Vec3;
use std::path::Path;

fn parse_points(text: &str) -> crate::Result<PointCloud> {
    super::super::points::parse(Path::new("a.ply"), text.as_bytes())
}

#[test]
fn points_round_trip() {
    let cloud = PointCloud {
        positions: vec![Vec3::new(1.0, -2.5, 1e-7), Vec3::new(0.1, 0.2, 0.3)],
        colors_srgb8: vec![[0, 128, 255], [1, 2, 3]],
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("points.ply");
    write_points(&path, &cloud).unwrap();
    assert_eq!(read_points(&path).unwrap(), cloud);
    let bytes = std::fs::read(&path).unwrap();
    // 12 bytes of position and 3 of colour for each point.
    let end = bytes
        .windows(11)
        .position(|w| w == b"end_header\n")
        .unwrap()
        + 11;
    assert_eq!(bytes.len() - end, 30);
    for_each_truncation(&bytes, 300, |prefix| {
        assert_error(
            super::super::points::parse(&path, prefix),
            &["points.ply: "],
        );
    });

    let mut uneven = cloud.clone();
    uneven.colors_srgb8.pop();
    assert_error(write_points(&path, &uneven), &["2 positions but 1 colours"]);
    let mut wild = cloud;
    wild.positions[1].y = f32::NAN;
    assert_error(
        write_points(&path, &wild),
        &["points.ply: vertex[1]: ", "is not finite"],
    );
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
}

#[test]
fn point_colours_of_every_type_are_read() {
    let file = |kind: &str, colour: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty {kind} blue\nproperty {kind} green\n\
             property {kind} red\nproperty float nx\nproperty double x\nproperty double y\nproperty double z\n\
             end_header\n{colour} 0.5 1 2 3\n"
        )
    };
    for (kind, colour) in [
        ("uchar", "255 51 0"),
        ("int", "255 51 0"),
        ("ushort", "65535 13107 0"),
        ("float", "1 0.2 0"),
        ("double", "1.0 2e-1 0"),
    ] {
        let cloud = parse_points(&file(kind, colour)).unwrap();
        assert_eq!(cloud.colors_srgb8, [[0, 51, 255]], "{kind}");
        assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0)]);
    }
    let wanted = ["a.ply: vertex[0].green: 51.0 is outside 0 to 1"];
    assert_error(parse_points(&file("float", "1 51 0")), &wanted);
    let wanted = ["a.ply: vertex[0].blue: `lots` is no number"];
    assert_error(parse_points(&file("uchar", "lots 51 0")), &wanted);
    let wanted = ["a.ply: vertex[0].z: 1e99 is not finite"];
    assert_error(
        parse_points(&file("uchar", "0 0 0").replace("1 2 3", "1 2 1e99")),
        &wanted,
    );
}

#[test]
fn points_of_another_program_are_read() {
    let Some(root) = test_data("points_of_another_program_are_read", "kitchen") else {
        return;
    };
    let cloud = read_points(&root.join("points3d.ply")).unwrap();
    assert_eq!(cloud.len(), 58_800);
    // A kitchen with z up, in metres.
    let height = |p: &Vec3| p.z;
    let low = cloud.positions.iter().map(height).fold(f32::MAX, f32::min);
    let high = cloud.positions.iter().map(height).fold(f32::MIN, f32::max);
    assert!(low > -1.0 && high < 5.0 && high - low > 1.5, "{low} {high}");
}
