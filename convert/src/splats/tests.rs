use super::*;
use eagpt_scene::harmonics::functions;
use eagpt_scene::ply::{Preview, write_preview};
use eagpt_scene::random_cloud;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;
use std::path::PathBuf;
use tempfile::TempDir;

fn temporary(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}

/// A file of 3D Gaussian Splatting in text, of rows of its properties in the usual order.
fn ply(rest: usize, with_third: bool, rows: &[Vec<f32>]) -> Vec<u8> {
    let mut names: Vec<String> = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"]
        .map(str::to_owned)
        .into();
    names.extend((0..rest).map(|i| format!("f_rest_{i}")));
    names.extend(["opacity", "scale_0", "scale_1"].map(str::to_owned));
    if with_third {
        names.push("scale_2".to_owned());
    }
    names.extend([0, 1, 2, 3].map(|i| format!("rot_{i}")));
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", rows.len());
    for name in &names {
        text += &format!("property float {name}\n");
    }
    text += "end_header\n";
    for row in rows {
        assert_eq!(row.len(), names.len());
        let values: Vec<String> = row.iter().map(f32::to_string).collect();
        text += &(values.join(" ") + "\n");
    }
    text.into_bytes()
}

fn import(bytes: &[u8], options: &SplatOptions) -> Result<(Gaussians, SplatReport)> {
    let (_dir, path) = temporary("in.ply", bytes);
    import_splats(&path, options)
}

#[test]
fn what_was_exported_comes_back() {
    let mut cloud = random_cloud(200, 3);
    cloud.harmonics.clear();
    for radiance in &mut cloud.radiances {
        *radiance = radiance.min(Vec3::ONE);
    }
    for preview in [Preview::TwoD, Preview::ThreeD] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("preview.ply");
        write_preview(&path, &cloud, preview).unwrap();
        let (back, report) = import_splats(&path, &SplatOptions::default()).unwrap();
        let expected = match preview {
            Preview::TwoD => ("2dgs", None),
            Preview::ThreeD => ("3dgs", Some(0)),
        };
        assert_eq!((report.format, report.num_far_from_flat), expected);
        assert_eq!((report.num_gaussians, report.num_left_out), (200, 0));
        assert!(report.residual < 1e-6, "{report:?}");
        assert!(back.harmonics.is_empty());
        for (a, b) in cloud.iter().zip(back.iter()) {
            assert_eq!(a.position, b.position);
            assert!((a.scale - b.scale).abs().max_element() < 1e-5 * a.scale.max_element());
            assert!(a.rotation.dot(b.rotation).abs() > 1.0 - 1e-6);
            assert!((a.opacity - b.opacity).abs() < 1e-5);
            assert!((a.radiance - b.radiance).abs().max_element() < 1e-4);
            assert_eq!((b.emission, b.albedo), (0.0, ALBEDO));
        }
    }
}

#[test]
fn ellipsoids_become_discs_of_their_longest_axes() {
    // Shortest along x; then along y, far from flat; then a needle without length.
    let row = |s: [f32; 3]| {
        let s = s.map(f32::ln);
        vec![
            1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, s[0], s[1], s[2], 1.0, 0.0, 0.0, 0.0,
        ]
    };
    let rows = [
        row([0.01, 0.3, 0.2]),
        row([0.3, 0.15, 0.2]),
        row([0.3, 0.0, 0.0]),
    ];
    let (found, report) = import(&ply(0, true, &rows), &SplatOptions::default()).unwrap();
    assert_eq!(report.num_left_out, 1);
    assert_eq!(report.num_far_from_flat, Some(1));
    assert_eq!(report.warnings.len(), 2);
    let axes = |i: usize| {
        let g = found.get(i);
        let frame = glam::Mat3::from_quat(g.rotation);
        [
            (frame.x_axis, g.scale.x),
            (frame.y_axis, g.scale.y),
            (frame.z_axis, 0.0),
        ]
    };
    for (i, expected) in [
        [(Vec3::Y, 0.3), (Vec3::Z, 0.2), (Vec3::X, 0.0)],
        [(Vec3::Z, 0.2), (Vec3::X, 0.3), (Vec3::Y, 0.0)],
    ]
    .into_iter()
    .enumerate()
    {
        for ((axis, scale), (wanted, length)) in axes(i).into_iter().zip(expected) {
            assert!((axis - wanted).length() < 1e-6, "{i} {axis} {wanted}");
            assert!((scale - length).abs() < 1e-6);
        }
    }
    assert!((found.opacities[0] - 0.5).abs() < 1e-6);
    // 0.5 in display colour.
    assert!((found.radiances[0].x - 0.214_041).abs() < 1e-5);
    let linear = SplatOptions {
        color: SplatColor::Linear,
        ..SplatOptions::default()
    };
    let (found, _) = import(&ply(0, true, &rows[..1]), &linear).unwrap();
    assert_eq!(found.radiances[0], Vec3::splat(0.5));
}

/// Rows with harmonics of degree 2 that differ in every coefficient and channel.
fn coloured(size: f32) -> Vec<f32> {
    let mut row = vec![0.0, 0.0, 0.0, 0.9, 0.3, -0.4];
    row.extend((0..24).map(|i| size * ((i * 7 % 11) as f32 - 5.0) / 5.0));
    row.extend([2.0, -1.0, -2.0, -9.0, 0.5, 0.5, 0.5, 0.5]);
    row
}

/// Linear light of a row towards `direction`, from the definition: a sum in display colour.
fn expected(row: &[f32], direction: Vec3) -> [f32; 3] {
    [0, 1, 2].map(|channel| {
        let mut sum = 0.5 + SH_DEGREE_0 * row[3 + channel];
        for (k, value) in functions(direction).into_iter().enumerate() {
            sum += row[6 + 8 * channel + k] * value;
        }
        color::linear_from_srgb(sum.max(0.0))
    })
}

#[test]
fn harmonics_are_fitted_in_linear_light() {
    let row = coloured(0.1);
    let (found, report) = import(
        &ply(24, true, std::slice::from_ref(&row)),
        &SplatOptions::default(),
    )
    .unwrap();
    assert_eq!(report.degree, 2);
    // Measured: 0.9 % with harmonics, 19 % without.
    assert!(report.residual < 0.015, "{report:?}");
    assert!(report.residual_without_harmonics > 0.1, "{report:?}");
    let g = found.get(0);
    let mut squares = [0.0_f64; 2];
    for direction in [Vec3::X, Vec3::NEG_Y, Vec3::Z, Vec3::new(0.6, 0.0, -0.8)] {
        let wanted = Vec3::from(expected(&row, direction));
        let seen = g
            .harmonics
            .seen(g.radiance, g.position, g.position - direction);
        squares[0] += f64::from((seen - wanted).length_squared());
        squares[1] += f64::from(wanted.length_squared());
    }
    assert!((squares[0] / squares[1]).sqrt() < 0.03, "{squares:?}");

    // Light that is cut at 0 in many directions stays finite and no worse than without harmonics.
    let (found, report) =
        import(&ply(24, true, &[coloured(2.0)]), &SplatOptions::default()).unwrap();
    assert!(found.harmonics[0].0.iter().all(|value| value.is_finite()));
    assert!(
        report.residual < report.residual_without_harmonics,
        "{report:?}"
    );
}

#[test]
fn a_similarity_moves_light_and_all() {
    let row = coloured(0.1);
    let (plain, _) = import(
        &ply(24, true, std::slice::from_ref(&row)),
        &SplatOptions::default(),
    )
    .unwrap();
    // Twice the size, a quarter turn about z, and a step.
    let rows = [
        [0.0, -2.0, 0.0, 1.0],
        [2.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 2.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let options = SplatOptions {
        scene_from_file: Some(rows),
        ..SplatOptions::default()
    };
    let (moved, _) = import(&ply(24, true, std::slice::from_ref(&row)), &options).unwrap();
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let (a, b) = (plain.get(0), moved.get(0));
    assert!((b.position - Vec3::X).length() < 1e-6);
    assert!((b.scale - 2.0 * a.scale).length() < 1e-6);
    assert!(b.rotation.dot(turn * a.rotation).abs() > 1.0 - 1e-6);
    for direction in [Vec3::X, Vec3::new(0.0, 0.6, 0.8)] {
        let before = a
            .harmonics
            .seen(a.radiance, a.position, a.position - direction);
        let after = b
            .harmonics
            .seen(b.radiance, b.position, b.position - turn * direction);
        assert!((before - after).length() < 1e-4);
    }
    let mut sheared = rows;
    sheared[0][0] = 1.0;
    let options = SplatOptions {
        scene_from_file: Some(sheared),
        ..SplatOptions::default()
    };
    let message = import(&ply(24, true, &[row]), &options)
        .unwrap_err()
        .to_string();
    assert!(message.contains("no rotation with one scale"), "{message}");
}

/// Files that `tests/splats/spz.py` wrote from a PLY by the description of the format, against the
/// PLY.
#[test]
fn spz_of_an_independent_writer() {
    let read = |name: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/splats")
            .join(name);
        import_splats(&path, &SplatOptions::default()).unwrap()
    };
    let (ply, of_ply) = read("three.ply");
    assert_eq!((of_ply.format, of_ply.degree, ply.len()), ("3dgs", 2, 3));
    for name in ["three.v2.spz", "three.v3.spz"] {
        let (spz, report) = read(name);
        assert_eq!((report.format, report.degree, spz.len()), ("spz", 2, 3));
        for (a, b) in ply.iter().zip(spz.iter()) {
            // Steps of 1/4096, 1/16 in logarithms, 8 and 9 bits, 1/255, 0.15 / 255.
            assert!((a.position - b.position).abs().max_element() < 1.3e-4);
            let ratio = a.scale / b.scale;
            assert!((ratio - 1.0).abs().max_element() < 0.04, "{ratio}");
            assert!(a.rotation.dot(b.rotation).abs() > 0.9998, "{name}");
            assert!((a.opacity - b.opacity).abs() < 0.0021);
            let eye = a.position + Vec3::new(0.3, -1.0, 0.5);
            let [of_a, of_b] = [a, b].map(|g| g.harmonics.seen(g.radiance, g.position, eye));
            assert!((of_a - of_b).abs().max_element() < 0.02, "{of_a} {of_b}");
        }
    }
}

#[test]
fn damaged_and_other_files_are_named() {
    let refused = |bytes: &[u8], parts: &[&str]| {
        let message = import(bytes, &SplatOptions::default())
            .unwrap_err()
            .to_string();
        for part in parts {
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    };
    let gzip = |bytes: &[u8]| {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    };
    let header = |version: u32, num: u32, degree: u8| {
        let words = [0x5053_474e, version, num].map(u32::to_le_bytes).concat();
        [words, vec![degree, 12, 0, 0]].concat()
    };
    refused(&gzip(b"something else"), &["header", "14 of 16 bytes"]);
    refused(&gzip(&[7; 16]), &["magic", "0x07070707"]);
    refused(&gzip(&header(4, 1, 0)), &["version", "4", "1 to 3"]);
    refused(&gzip(&header(2, 1, 9)), &["degree 9"]);
    refused(&gzip(&header(2, 5, 0)), &["positions", "0 of 45 bytes"]);
    refused(&gzip(&header(3, u32::MAX, 3)), &["positions", "truncated"]);
    refused(&gzip(&header(3, 0, 0)), &["none can be used"]);
    let whole = gzip(&header(2, 5, 0));
    refused(&whole[..whole.len() - 9], &["in.ply", "deflate"]);
    refused(b"ply\n", &["header"]);
    refused(&ply(7, true, &[]), &["f_rest", "7 properties"]);
    let row = |x: f32, q: f32| vec![x, 0., 0., 0., 0., 0., 0., -1., -1., -1., q, 0., 0., 0.];
    refused(&ply(0, true, &[row(f32::NAN, 1.0)]), &["vertex[0]", "NaN"]);
    refused(&ply(0, true, &[row(0.0, 0.0)]), &["none can be used"]);
    let packed =
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty uint packed_position\nend_header\n";
    refused(packed.as_bytes(), &["packed_position", "SuperSplat"]);
}
