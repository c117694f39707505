//! A room photographed by exact rays.

#![allow(dead_code, reason = "tests take what they need of it")]

pub(crate) mod found;

use eagpt_lamps::shape::Shape;
use eagpt_lamps::{Evidence, Found, Kinds, find};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::rotation;
use eagpt_scene::{Camera, Gaussian, Gaussians, Gloss, Harmonics, Image, View};
use eagpt_trace::Device;
use glam::{DVec3, Mat3, Quat, Vec2, Vec3};

/// Rays along each axis of a pixel of a photograph.
const RAYS: u32 = 8;
pub(crate) const RADIANCE: Vec3 = Vec3::new(40.0, 30.0, 20.0);
const WALL: Vec3 = Vec3::new(0.3, 0.25, 0.2);

/// A closed room of 4 × 4 × 2.5 from the floor at z = 0.
pub(crate) fn room() -> Gaussians {
    let size = Vec3::new(4.0, 4.0, 2.5);
    wide_discs(Vec3::new(0.0, 0.0, 1.25), size, Quat::IDENTITY, 0.12)
        .map(|disc| Gaussian {
            radiance: WALL,
            albedo: Vec3::splat(0.5),
            ..disc
        })
        .collect()
}

pub(crate) fn cameras() -> Vec<Camera> {
    (0..9_u8)
        .map(|i| {
            let angle = f64::from(i) * 2.2;
            let out = 1.1 + 0.06 * f64::from(i);
            let eye = DVec3::new(
                out * angle.cos(),
                out * angle.sin(),
                1.0 + 0.1 * f64::from(i % 4),
            );
            let target = DVec3::new(0.1, 0.1, 2.2);
            let pose = Camera::level_pose(eye, (target - eye).normalize());
            Camera::centred([120, 80], 1.3, pose)
        })
        .collect()
}

/// Lamps of these kinds that `photographs` show in `scene`.
pub(crate) fn find_in(
    scene: &Gaussians,
    kinds: Kinds,
    photographs: impl Iterator<Item = View>,
) -> Found {
    let tracer = Device::Cpu.scene(scene).unwrap();
    let mut evidence = Evidence::default();
    for view in photographs {
        evidence.add(&view, 0, &tracer.gbuffer(&view.camera).unwrap());
    }
    find(
        (&evidence, kinds),
        (scene, &*tracer),
        Vec3::Z,
        &mut |_, _| (),
    )
    .unwrap()
}

/// The room through `camera`, with a lamp that is behind what `hides` it.
pub(crate) fn photograph(name: usize, camera: Camera, lamp: &Shape, hides: &[Shape]) -> View {
    photograph_all(name, camera, &[(*lamp, RADIANCE)], hides)
}

/// The room through `camera`, with lamps of different radiance that are behind what `hides` them.
pub(crate) fn photograph_all(
    name: usize,
    camera: Camera,
    lamps: &[(Shape, Vec3)],
    hides: &[Shape],
) -> View {
    let frame = camera.ray_frame();
    let (mut radiance, mut mask) = (Vec::new(), Vec::new());
    for y in 0..camera.height {
        for x in 0..camera.width {
            let (mut light, mut num_met) = (Vec3::ZERO, 0);
            for k in 0..RAYS * RAYS {
                let at = |k: u32| (k as f32 + 0.5) / RAYS as f32;
                let (u, v) = (x as f32 + at(k % RAYS), y as f32 + at(k / RAYS));
                let direction = frame.direction(u, v);
                let meet = |shape: &Shape| shape.meet(frame.origin, direction);
                let met = lamps
                    .iter()
                    .filter_map(|(shape, own)| Some((meet(shape)?, *own)));
                match met.min_by(|a, b| a.0.total_cmp(&b.0)) {
                    Some((distance, own))
                        if !hides
                            .iter()
                            .any(|shape| meet(shape).is_some_and(|at| at < distance)) =>
                    {
                        light += own;
                        num_met += 1;
                    }
                    _ => light += WALL,
                }
            }
            let cover = num_met as f32 / (RAYS * RAYS) as f32;
            radiance.push((light / (RAYS * RAYS) as f32).to_array());
            mask.push([f32::from(u8::from(cover >= 0.5))]);
        }
    }
    let (width, height) = (camera.width, camera.height);
    let radiance = Image::from_pixels(width, height, radiance).unwrap();
    View {
        emission: Image::from_pixels(width, height, mask),
        ..View::new(format!("view-{name}"), camera, radiance)
    }
}

/// A flat square, `edges` long, that shines or does not, where training left a lamp or what is
/// near.
pub(crate) fn patch(centre: Vec3, edges: [Vec3; 2], radiance: Option<Vec3>) -> Gaussians {
    let surface = Surface {
        solid: Solid::Quad { centre, edges },
        material: Material {
            albedo: Vec3::splat(0.5),
            radiance,
            gloss: Gloss::NONE,
        },
        spacing: Some(0.05),
    };
    surface.discs()
}

/// A lamp as training leaves it: discs on its surface that stick out of it.
pub(crate) fn heap(shape: &Shape, radiance: Vec3) -> Vec<Gaussian> {
    let (centre, size, rotation) = (shape.centre(), shape.size(), shape.rotation());
    let spacing = 0.3 * size.max_element().min(0.1);
    let Shape::Ball { radius, .. } = shape else {
        return wide_discs(centre, size.max(Vec3::splat(0.01)), rotation, spacing)
            .map(|disc| Gaussian {
                radiance,
                emission: 1.0,
                ..disc
            })
            .collect();
    };
    let surface = Surface {
        solid: Solid::Ball {
            centre,
            radius: 0.9 * radius,
        },
        material: Material {
            albedo: Vec3::ZERO,
            radiance: Some(radiance),
            gloss: Gloss::NONE,
        },
        spacing: Some(spacing),
    };
    surface.discs().iter().collect()
}

/// Dark discs on a box, as wide at its edges as elsewhere: training makes no narrow ones there.
fn wide_discs(
    centre: Vec3,
    size: Vec3,
    rotation: Quat,
    spacing: f32,
) -> impl Iterator<Item = Gaussian> {
    const INSET: f32 = 1.14;
    // Shares of an edge from its middle, and the spacing.
    let row = move |edge: Vec3| {
        let length = edge.length();
        let num = (length / spacing - 2.0 * INSET).round().max(1.0) + 1.0;
        let own = length / (num - 1.0 + 2.0 * INSET);
        let place = move |i: u16| (f32::from(i) - 0.5 * (num - 1.0)) * own / length;
        ((0..num as u16).map(place), own)
    };
    (0..6_usize).flat_map(move |face| {
        let [u, v, out] = [1, 2, 0].map(|axis| {
            let axis = Vec3::AXES[(face / 2 + axis) % 3];
            axis * size.dot(axis)
        });
        let (edges, out) = match face % 2 {
            0 => ([u, v], out),
            _ => ([v, u], -out),
        };
        let [u, v] = edges.map(|edge| rotation * edge);
        let middle = centre + rotation * (0.5 * out);
        let (x_axis, normal) = (u.normalize(), u.cross(v).normalize());
        let frame = Mat3::from_cols(x_axis, normal.cross(x_axis), normal);
        let ((across, width), (up, height)) = (row(u), row(v));
        up.flat_map(move |y| {
            (across.clone()).map(move |x| Gaussian {
                position: middle + u * x + v * y,
                scale: 0.75 * Vec2::new(width, height),
                rotation: rotation::unit(Quat::from_mat3(&frame)),
                opacity: 0.99,
                radiance: Vec3::ZERO,
                harmonics: Harmonics::NONE,
                gloss: Gloss::NONE,
                emission: 0.0,
                albedo: Vec3::ZERO,
            })
        })
    })
}
