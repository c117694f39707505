//! Gaussians of known shape, and cameras to look at them.

pub use eagpt_scene::random_cloud;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussian, Gaussians, Gloss, Harmonics, rotation};
use glam::{DAffine3, DMat3, DVec3, Quat, Vec2, Vec3};

/// The same Gaussians with light that differs with the direction, up to fivefold.
pub fn directional(mut gaussians: Gaussians, seed: u64) -> Gaussians {
    let key = RandomKey::new(seed, Purpose::Initialise, 1);
    gaussians.harmonics = (0..gaussians.len() as u32)
        .map(|i| {
            let mut stream = key.stream(i, 0);
            let mut harmonics = Harmonics::NONE;
            for four in harmonics.0.as_chunks_mut::<4>().0 {
                *four = stream.next_uniforms().map(|u| u - 0.5);
            }
            harmonics
        })
        .collect();
    gaussians
}

/// A camera at `origin` looking at `target`, z up, 60° across.
pub fn look_at(origin: DVec3, target: DVec3, width: u32, height: u32) -> Camera {
    let forward = (target - origin).normalize();
    let up = if forward.z.abs() > 0.99 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let right = forward.cross(up).normalize();
    let focal = 0.5 * f64::from(width) / 30.0_f64.to_radians().tan();
    Camera {
        width,
        height,
        fx: focal,
        fy: focal * 1.03,
        cx: 0.5 * f64::from(width) + 1.7,
        cy: 0.5 * f64::from(height) - 0.9,
        world_from_camera: DAffine3 {
            matrix3: DMat3::from_cols(right, forward.cross(right), forward),
            translation: origin,
        },
    }
}

/// A sphere of `num` overlapping opaque discs around the origin, made by `make(unit direction) ->
/// Gaussian` with position, scale and rotation overwritten.
pub fn sphere(num: usize, radius: f32, make: impl Fn(Vec3) -> Gaussian) -> Gaussians {
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    // One disc's share of the area. Discs this wide overlap so much that less than 1e-4 of the
    // light passes.
    let spacing = (4.0 * std::f32::consts::PI / num as f32).sqrt();
    (0..num)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f32 / num as f32;
            let (sin, cos) = (golden * i as f32).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            let direction = Vec3::new(flat * cos, flat * sin, z);
            Gaussian {
                position: direction * radius,
                scale: Vec2::splat(1.2 * spacing * radius),
                rotation: rotation::from_z_to(direction),
                ..make(direction)
            }
        })
        .collect()
}

/// An opaque Gaussian with the given light and material, to be placed by [`sphere`] and others.
pub fn material(radiance: Vec3, emission: f32, albedo: Vec3) -> Gaussian {
    Gaussian {
        position: Vec3::ZERO,
        scale: Vec2::ONE,
        rotation: Quat::IDENTITY,
        opacity: 0.95,
        radiance,
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission,
        albedo,
    }
}

/// A rectangle of opaque discs around `center`, spanned by the half edges `a` and `b`, `spacing`
/// apart.
pub fn rectangle(
    center: Vec3,
    a: Vec3,
    b: Vec3,
    spacing: f32,
    material: Gaussian,
) -> Vec<Gaussian> {
    let count = |edge: Vec3| (2.0 * edge.length() / spacing).round().max(1.0) as i32;
    let (columns, rows) = (count(a), count(b));
    let rotation = Quat::from_mat3(&glam::Mat3::from_cols(
        a.normalize(),
        b.normalize(),
        a.normalize().cross(b.normalize()),
    ));
    (0..columns * rows)
        .map(|i| {
            let place = |k: i32, num: i32| (2 * k + 1) as f32 / num as f32 - 1.0;
            let position = center + a * place(i % columns, columns) + b * place(i / columns, rows);
            Gaussian {
                position,
                scale: Vec2::splat(1.2 * spacing),
                rotation,
                ..material
            }
        })
        .collect()
}

/// The six walls of a cube of half edge `half` around the origin.
pub fn cube(half: f32, spacing: f32, material: impl Fn(Vec3) -> Gaussian) -> Vec<Gaussian> {
    [
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
    ]
    .into_iter()
    .flat_map(|side| {
        let (a, b) = side.any_orthonormal_pair();
        rectangle(side * half, a * half, b * half, spacing, material(side))
    })
    .collect()
}
