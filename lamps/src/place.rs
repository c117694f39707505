//! A lamp's discs, and the power that leaves them.

use crate::shape::{Flat, Shape};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::{Gaussian, Gaussians, Gloss};
use eagpt_trace::Ray;
use eagpt_trace::cpu::CpuScene;
use glam::Vec3;
use std::f32::consts::PI;

/// Most discs of a lamp, about.
const MAX_DISCS: f32 = 2000.0;
/// Least number of discs across its thinnest side.
const MIN_ACROSS: f32 = 4.0;
/// Distance of the back of a flat lamp from its front, in spacings: rays from the front have met
/// the lamp, those from behind the back.
const BACK_IN_SPACINGS: f32 = 0.1;
/// Albedo of a lamp, which photographs in its light do not show: about that of opal glass and of
/// lampshades.
const ALBEDO: f32 = 0.5;
/// That of windows, screens and signs, which are dark when they do not shine, behind glass that
/// reflects 8 %. Flat lamps on walls are taken for these.
const ALBEDO_OF_GLASS: f32 = 0.08;
/// Cosine between the normal of a flat lamp on a wall and the vertical, at most.
const SIDEWAYS: f32 = 0.5;
/// Rays that measure what discs show of a shape, along each axis of a square across it.
const GRID: u16 = 48;

/// Whether a flat lamp of a shape is on a wall, `up` being the unit vector upwards.
pub(crate) fn is_on_wall(shape: &Shape, up: Vec3) -> bool {
    let normal = shape.flat().map(Flat::normal);
    normal.is_some_and(|normal| normal.dot(up).abs() <= SIDEWAYS)
}

/// The discs of a lamp of `shape` and `radiance`, behind glass or not, with spacings of about
/// `pixel`, the width of a pixel of the views that see it best; those of a flat lamp's back, or of
/// the inside of an open tube, follow, which do not shine.
/// A viewer in front sees as much light of the discs as of the shape.
pub(crate) fn discs(shape: &Shape, radiance: Vec3, is_glass: bool, pixel: f32) -> Gaussians {
    let least = (shape.area() / MAX_DISCS).sqrt();
    let spacing = pixel
        .max(least)
        .min(shape.thinnest() / MIN_ACROSS)
        .max(least);
    let albedo = if is_glass { ALBEDO_OF_GLASS } else { ALBEDO };
    let surface = |radiance: Option<Vec3>, shape: &Shape| Surface {
        solid: solid(shape),
        material: Material {
            albedo: Vec3::splat(albedo),
            radiance,
            gloss: Gloss::NONE,
        },
        spacing: Some(spacing),
    };
    let front = surface(Some(radiance), shape).discs();
    let factor = shown(shape, &front);
    let mut all: Vec<Gaussian> = front
        .iter()
        .map(|disc| Gaussian {
            radiance: disc.radiance / factor,
            ..disc
        })
        .collect();
    let behind = BACK_IN_SPACINGS * spacing;
    if let Some(inside) = inside(shape, behind) {
        all.extend(surface(None, &inside).discs().iter());
    }
    if let Some(flat) = shape.flat() {
        let behind = flat.normal() * behind;
        let back = surface(None, shape).discs();
        all.extend(back.iter().map(|disc| Gaussian {
            position: disc.position - behind,
            ..disc
        }));
    }
    all.into_iter().collect()
}

/// The inside of an open tube, which rays meet that have passed its side from without: a tube that
/// is narrower by `behind`, scene units.
fn inside(shape: &Shape, behind: f32) -> Option<Shape> {
    let mut inside = *shape;
    match &mut inside {
        Shape::Tube {
            radius,
            is_open: true,
            ..
        } => *radius -= behind,
        _ => return None,
    }
    Some(inside)
}

fn solid(shape: &Shape) -> Solid {
    let rotation = shape.rotation();
    match *shape {
        Shape::Rectangle(flat) => Solid::Quad {
            centre: flat.centre,
            edges: [
                rotation * Vec3::X * flat.size[0],
                rotation * Vec3::Y * flat.size[1],
            ],
        },
        Shape::Ellipse(flat) => Solid::Ellipse {
            centre: flat.centre,
            axes: [
                rotation * Vec3::X * flat.size[0],
                rotation * Vec3::Y * flat.size[1],
            ],
        },
        Shape::Ball { centre, radius } => Solid::Ball { centre, radius },
        Shape::Tube {
            centre,
            radius,
            length,
            taper,
            is_open,
            ..
        } => Solid::Tube {
            centre,
            axis: rotation * Vec3::Z * length,
            radii: [1.0 - taper, 1.0 + taper].map(|share| radius * share),
            is_open,
        },
        Shape::Box {
            centre,
            rotation,
            size,
        } => Solid::Box {
            centre,
            size,
            rotation,
        },
    }
}

/// Light of the discs over that of the shape, seen from a few directions.
fn shown(shape: &Shape, discs: &Gaussians) -> f32 {
    let scene = CpuScene::new(discs);
    let rotation = shape.rotation();
    let half = 0.6 * shape.size().length();
    let own = discs.radiances.first().map_or(1.0, |r| r.element_sum());
    let (mut light, mut expected) = (0.0, 0.0);
    for i in 0..5_u8 {
        // Within 60 degrees of a flat shape's normal, and of a tube's waist.
        let angle = 1.3 * f32::from(i);
        let tilted = Vec3::new(angle.cos(), angle.sin(), 0.6 + 0.4 * f32::from(i % 3));
        let towards = rotation * tilted.normalize();
        let (right, up) = towards.any_orthonormal_pair();
        let place = |i: u16| (2.0 * (f32::from(i) + 0.5) / f32::from(GRID) - 1.0) * half;
        for y in 0..GRID {
            for x in 0..GRID {
                let at = right * place(x) + up * place(y);
                let origin = shape.centre() + at + towards * (4.0 * half);
                if shape.meet(origin, -towards).is_some() {
                    expected += own;
                }
                let ray = Ray::free(origin.to_array(), (-towards).to_array());
                light += scene.trace(&ray).radiance().element_sum();
            }
        }
    }
    if expected > 0.0 && light > 0.0 {
        light / expected
    } else {
        1.0
    }
}

/// Radiant flux that leaves a convex shape: radiance × scene units² × sr.
pub(crate) fn power(shape: &Shape, radiance: Vec3) -> Vec3 {
    radiance * (PI * shape.area())
}
