//! Previews for viewers of splats.

use super::super::*;
use crate::gaussians::{Gaussian, Gaussians};
use crate::gloss::Gloss;
use crate::harmonics::Harmonics;
use crate::testing::assert_error;
use glam::{Quat, Vec2, Vec3};

#[test]
fn previews_hold_raw_parameters() {
    let gaussian = Gaussian {
        position: Vec3::new(1.0, 2.0, 3.0),
        scale: Vec2::new(1.0, std::f32::consts::E),
        // A quarter turn about x takes the normal from +z to −y.
        rotation: Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
        opacity: 0.75,
        // Linear 0.214041 is sRGB 0.5, hence coefficient 0; light above display white is clipped to
        // 0.5 / 0.2820948.
        radiance: Vec3::new(0.214_041_14, 50.0, 0.0),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 1.0,
        albedo: Vec3::ONE,
    };
    let gaussians = Gaussians::from_iter([
        gaussian,
        Gaussian {
            opacity: 1.0,
            ..gaussian
        },
    ]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let white = 1.772_453_9;
    let dir = tempfile::tempdir().unwrap();
    for (preview, thickness) in [(Preview::TwoD, None), (Preview::ThreeD, Some(-13.815_511))] {
        let path = dir.path().join("preview.ply");
        write_preview(&path, &gaussians, preview).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = bytes
            .windows(11)
            .position(|w| w == b"end_header\n")
            .unwrap()
            + 11;
        let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
        assert!(!header.contains("comment"), "{header}");
        let names: Vec<&str> = header
            .lines()
            .filter_map(|l| l.strip_prefix("property float "))
            .collect();
        let scale_2 = if thickness.is_some() { " scale_2" } else { "" };
        let wanted_names = format!(
            "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1{scale_2} rot_0 rot_1 rot_2 rot_3"
        );
        assert_eq!(names.join(" "), wanted_names);
        let values: Vec<f32> = bytes[end..]
            .as_chunks()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        assert_eq!(values.len(), 2 * names.len());
        assert!(values.iter().all(|v| v.is_finite()), "{values:?}");
        let mut wanted = vec![
            1.0,
            2.0,
            3.0,
            0.0,
            -1.0,
            0.0,
            0.0,
            white,
            -white,
            3.0_f32.ln(),
            0.0,
            1.0,
        ];
        wanted.extend(thickness);
        wanted.extend([half, half, 0.0, 0.0]);
        for ((value, wanted), name) in values.iter().zip(&wanted).zip(&names) {
            assert!(
                (value - wanted).abs() < 2e-6,
                "{name}: {value} for {wanted}"
            );
        }
    }
    let mut flat = gaussians;
    flat.scales[1].x = 0.0;
    let path = dir.path().join("flat.ply");
    let wanted = ["flat.ply: vertex[1].scale_0: -inf is not finite"];
    assert_error(write_preview(&path, &flat, Preview::TwoD), &wanted);
}
