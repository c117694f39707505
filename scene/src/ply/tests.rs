mod gaussians;
mod points;
mod preview;
mod refused;

use super::*;
use crate::gaussians::{Gaussian, Gaussians};
use crate::gloss::Gloss;
use crate::harmonics::Harmonics;
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
