//! Surfaces made of overlapping discs: balls, tubes, quads, ellipses and boxes that need no
//! training.
//!
//! Discs of standard deviation 0.75 spacings and opacity 0.99 let less than one part in a hundred
//! through anywhere. Towards the edges of flat surfaces, and the ends of tubes, discs become thinner:
//! soft borders as wide as a spacing would be what views show of a bright window's edge.

mod rows;

use crate::gaussians::{Gaussian, Gaussians};
use crate::gloss::Gloss;
use crate::harmonics::Harmonics;
use crate::rotation;
use glam::{Mat3, Quat, Vec2, Vec3};
use rows::{BALL_EXCESS, Ring, Row, rows};
use std::f32::consts::PI;

pub use rows::INSET_IN_SPACINGS;

/// Standard deviation of a disc in spacings.
pub const SCALE_IN_SPACINGS: f32 = 0.75;
/// Opacity of a disc.
const OPACITY: f32 = 0.99;
/// Discs of a surface whose spacing is not given.
const DEFAULT_NUM_DISCS: f32 = 2500.0;
/// Most discs of one surface: a spacing in the wrong unit must not fill the memory.
pub const MAX_DISCS: usize = 4_000_000;
/// Least number of discs on a ball.
const MIN_BALL_DISCS: usize = 200;

/// A surface to cover with discs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Its shape.
    pub solid: Solid,
    /// Its material.
    pub material: Material,
    /// Distance of neighbouring discs away from edges, scene units, positive; `None` for as many
    /// as 2,500 discs would be without narrow ones.
    pub spacing: Option<f32>,
}

/// The shape of a [`Surface`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solid {
    /// The surface of a ball.
    Ball {
        /// Middle, scene units.
        centre: Vec3,
        /// Radius, scene units, positive.
        radius: f32,
    },
    /// A parallelogram.
    Quad {
        /// Middle, scene units.
        centre: Vec3,
        /// Its edges, scene units, not parallel; the normal is `u × v`.
        edges: [Vec3; 2],
    },
    /// An ellipse.
    Ellipse {
        /// Middle, scene units.
        centre: Vec3,
        /// Its whole axes, scene units, at right angles; the normal is `u × v`.
        axes: [Vec3; 2],
    },
    /// The surface of a cylinder, or of a cone without its tip, with flat ends or open ones.
    Tube {
        /// Middle, scene units.
        centre: Vec3,
        /// Axis from end to end, scene units, not zero.
        axis: Vec3,
        /// Radii of the first and the last end, scene units, positive.
        radii: [f32; 2],
        /// Whether its ends are open: its side alone is the surface.
        is_open: bool,
    },
    /// The surface of a box.
    Box {
        /// Middle, scene units.
        centre: Vec3,
        /// Edge lengths, scene units, positive.
        size: Vec3,
        /// World from the box's own axes.
        rotation: Quat,
    },
}

/// Material of a [`Surface`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Diffuse albedo, linear Rec.709, 0 to 1.
    pub albedo: Vec3,
    /// Emitted radiance, linear Rec.709; `None` if it does not emit.
    pub radiance: Option<Vec3>,
    /// Its specular part.
    pub gloss: Gloss,
}

impl Surface {
    /// Number of discs, without making them; in double precision, for it may be absurd.
    pub fn num_discs(&self) -> f64 {
        let spacing = self.spacing();
        let quad = |edges| {
            let [across, up] = rows(edges, spacing);
            across.num as f64 * up.num as f64
        };
        match self.solid {
            Solid::Ball { .. } => self.num_ball_discs() as f64,
            Solid::Quad { edges, .. } | Solid::Ellipse { axes: edges, .. } => quad(edges),
            // More than there are.
            Solid::Tube { axis, radii, .. } => {
                let radius = radii[0].max(radii[1]);
                let slant = axis.length().hypot(radii[0] - radii[1]);
                let around = Ring::new(radius, spacing).num as f64;
                let ends = quad([Vec3::X, Vec3::Y].map(|edge| edge * 2.0 * radius));
                around * Row::new(slant, spacing).num as f64 + 2.0 * ends
            }
            Solid::Box { size, .. } => faces(size).map(|(edges, _)| quad(edges)).iter().sum(),
        }
    }

    /// The discs, in a fixed order.
    pub fn discs(&self) -> Gaussians {
        let spacing = self.spacing();
        let mut discs = Vec::new();
        match self.solid {
            Solid::Ball { centre, radius } => self.cover_ball(centre, radius, &mut discs),
            Solid::Quad { centre, edges } => self.cover_quad(centre, edges, spacing, &mut discs),
            Solid::Ellipse { centre, axes } => {
                self.cover_ellipse(centre, axes, spacing, &mut discs);
            }
            Solid::Tube {
                centre,
                axis,
                radii,
                is_open,
            } => {
                self.cover_side(centre, axis, radii, &mut discs);
                if !is_open {
                    self.cover_ends(centre, axis, radii, &mut discs);
                }
            }
            Solid::Box {
                centre,
                size,
                rotation,
            } => {
                for (edges, to_face) in faces(size) {
                    let centre = centre + rotation * to_face;
                    let edges = edges.map(|edge| rotation * edge);
                    self.cover_quad(centre, edges, spacing, &mut discs);
                }
            }
        }
        discs.into_iter().collect()
    }

    fn spacing(&self) -> f32 {
        self.spacing
            .unwrap_or_else(|| (self.area() / DEFAULT_NUM_DISCS).sqrt())
    }

    fn num_ball_discs(&self) -> usize {
        let num = self.area() / self.spacing().powi(2);
        (num.round() as usize).max(MIN_BALL_DISCS)
    }

    fn area(&self) -> f32 {
        match self.solid {
            Solid::Ball { radius, .. } => 4.0 * PI * radius * radius,
            Solid::Quad { edges: [u, v], .. } => u.cross(v).length(),
            Solid::Ellipse { axes: [u, v], .. } => 0.25 * PI * u.cross(v).length(),
            Solid::Tube {
                axis,
                radii: [a, b],
                is_open,
                ..
            } => {
                let ends = if is_open { 0.0 } else { a * a + b * b };
                PI * ((a + b) * axis.length().hypot(a - b) + ends)
            }
            Solid::Box { size, .. } => 2.0 * size.dot(Vec3::new(size.y, size.z, size.x)),
        }
    }

    /// Points of a golden spiral have nearly equal distances: each stands for the same area.
    fn cover_ball(&self, centre: Vec3, radius: f32, discs: &mut Vec<Gaussian>) {
        let num = self.num_ball_discs();
        let spacing_in_radii2 = 4.0 * PI / num as f32;
        let radius = radius / (1.0 + BALL_EXCESS * spacing_in_radii2);
        let spacing = radius * spacing_in_radii2.sqrt();
        let golden_angle = PI * (3.0 - 5.0_f64.sqrt() as f32);
        for i in 0..num {
            let z = 1.0 - (2 * i + 1) as f32 / num as f32;
            let flat = (1.0 - z * z).sqrt();
            // In double precision: the angle grows to thousands of turns.
            let angle = (f64::from(golden_angle) * i as f64).rem_euclid(std::f64::consts::TAU);
            let (sin, cos) = (angle as f32).sin_cos();
            let normal = Vec3::new(flat * cos, flat * sin, z).normalize();
            let rotation = rotation::from_z_to(normal);
            let scale = Vec2::splat(SCALE_IN_SPACINGS * spacing);
            discs.push(self.disc(centre + normal * radius, scale, rotation));
        }
    }

    fn cover_quad(&self, centre: Vec3, [u, v]: [Vec3; 2], spacing: f32, out: &mut Vec<Gaussian>) {
        let rotation = turned(u.normalize(), u.cross(v).normalize());
        let [across, up] = rows([u, v], spacing);
        for (y, height) in up.discs() {
            for (x, width) in across.discs() {
                let scale = Vec2::new(width, height) * SCALE_IN_SPACINGS;
                out.push(self.disc(centre + u * x + v * y, scale, rotation));
            }
        }
    }

    /// Rows along the first axis, each as long as the ellipse is there.
    fn cover_ellipse(
        &self,
        centre: Vec3,
        [u, v]: [Vec3; 2],
        spacing: f32,
        out: &mut Vec<Gaussian>,
    ) {
        let rotation = turned(u.normalize(), u.cross(v).normalize());
        for (y, height) in Row::new(v.length(), spacing).discs() {
            // Twice the place is in parts of the half axis.
            let share = (1.0 - 4.0 * y * y).max(0.0).sqrt();
            for (x, width) in Row::new(u.length() * share, spacing).discs() {
                let scale = Vec2::new(width, height) * SCALE_IN_SPACINGS;
                out.push(self.disc(centre + u * (share * x) + v * y, scale, rotation));
            }
        }
    }

    /// The side of a tube.
    fn cover_side(&self, centre: Vec3, axis: Vec3, radii: [f32; 2], out: &mut Vec<Gaussian>) {
        let spacing = self.spacing();
        let slope = (radii[1] - radii[0]) / axis.length();
        let along = Row::new(axis.length().hypot(radii[1] - radii[0]), spacing);
        let to_world = rotation::from_z_to(axis.normalize());
        for (j, (place, height)) in along.discs().enumerate() {
            let ring = Ring::new(radii[0] + (radii[1] - radii[0]) * (place + 0.5), spacing);
            for i in 0..ring.num {
                // Rows are shifted against each other by half a disc.
                let angle = (i as f32 + 0.5 * (j % 2) as f32) / ring.num as f32 * 2.0 * PI;
                let (sin, cos) = angle.sin_cos();
                let radial = to_world * Vec3::new(cos, sin, 0.0);
                let normal = (to_world * Vec3::new(cos, sin, -slope)).normalize();
                let x_axis = to_world * Vec3::new(-sin, cos, 0.0);
                let scale = Vec2::new(ring.spacing, height) * SCALE_IN_SPACINGS;
                let position = centre + axis * place + radial * ring.radius;
                out.push(self.disc(position, scale, turned(x_axis, normal)));
            }
        }
    }

    /// The ends of a tube.
    fn cover_ends(&self, centre: Vec3, axis: Vec3, radii: [f32; 2], out: &mut Vec<Gaussian>) {
        let to_world = rotation::from_z_to(axis.normalize());
        let [x, y] = [Vec3::X, Vec3::Y].map(|edge| to_world * edge * 2.0);
        let ends = [
            (0.5, [x * radii[1], y * radii[1]]),
            (-0.5, [y * radii[0], x * radii[0]]),
        ];
        for (place, axes) in ends {
            self.cover_ellipse(centre + axis * place, axes, self.spacing(), out);
        }
    }

    fn disc(&self, position: Vec3, scale: Vec2, rotation: Quat) -> Gaussian {
        Gaussian {
            position,
            scale,
            rotation,
            opacity: OPACITY,
            radiance: self.material.radiance.unwrap_or(Vec3::ZERO),
            harmonics: Harmonics::NONE,
            gloss: self.material.gloss,
            emission: f32::from(self.material.radiance.is_some()),
            albedo: self.material.albedo,
        }
    }
}

/// The rotation of a disc with its first axis and its normal, perpendicular unit vectors.
fn turned(x_axis: Vec3, normal: Vec3) -> Quat {
    let frame = Mat3::from_cols(x_axis, normal.cross(x_axis), normal);
    rotation::unit(Quat::from_mat3(&frame))
}

/// The faces of a box about the origin: edges with `u × v` outwards, and the middle.
fn faces(size: Vec3) -> [([Vec3; 2], Vec3); 6] {
    let [x, y, z] = [Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z];
    [
        ([y, z], x),
        ([z, y], -x),
        ([z, x], y),
        ([x, z], -y),
        ([x, y], z),
        ([y, x], -z),
    ]
    .map(|(edges, outwards)| (edges, outwards * 0.5))
}
