//! A lamp in place of a heap of Gaussians: the surface of one shape that fits them best.
//!
//! Gaussians that a training has left of a lamp shade look like it from where cameras stood. As an
//! emitter they are not one: they overlap, tilt, and leave gaps, and their light leaves at angles
//! that no photograph shows. The light of one closed surface is right from everywhere.

mod fit;
mod round;

use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::plane::FittedPlane;
use eagpt_scene::{Gaussian, Gloss};
use fit::quantile;
use glam::{DVec3, Vec3};
use round::{ball, placed, tube};
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// The shape of a lamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LampShape {
    /// A flat rectangle.
    Rectangle,
    /// A flat ellipse.
    Ellipse,
    /// A ball.
    Ball,
    /// A cylinder, or a cone without its tip, about an axis; the up axis, if it is `None`. Of a
    /// known size, it is put in the middle of the selection.
    Tube(Option<Vec3>, Option<TubeSize>),
}

/// Size of a tube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TubeSize {
    /// At both ends, in the direction of the axis.
    pub(crate) radii: [f32; 2],
    pub(crate) height: f32,
}

/// A lamp to be made of a selection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NewLamp {
    pub(crate) shape: LampShape,
    /// Linear Rec.709, not negative.
    pub(crate) radiance: Vec3,
}

/// Fewer Gaussians are no surface.
const MIN_GAUSSIANS: usize = 6;
/// A disc covers so many standard deviations: alone it is half transparent at 1.2, in a row of an
/// opaque edge at 1.5.
const REACH: f64 = 1.3;
/// Quantile of the reach of all discs along an axis at which a shape ends, and the part of the
/// whole axis of an ellipse that lies between it and its opposite.
const EDGE: f64 = 0.02;
const ELLIPSE_PART: f32 = 0.93;
/// Turns of a rectangle that are tried, in a right angle.
const NUM_TURNS: u32 = 90;

impl NewLamp {
    /// The surface that stands for Gaussians, with their mean albedo.
    ///
    /// # Errors
    /// A description of the problem if they are too few, or nothing like the shape.
    pub(crate) fn surface(&self, of: &[Gaussian], up: Vec3) -> Result<Surface, String> {
        if of.len() < MIN_GAUSSIANS {
            let num = of.len();
            return Err(format!(
                "a lamp is made of {MIN_GAUSSIANS} Gaussians or more, not of {num}"
            ));
        }
        let discs: Vec<Disc> = of.iter().map(Disc::of).collect();
        let solid = match self.shape {
            LampShape::Rectangle => rectangle(&discs),
            LampShape::Ellipse => ellipse(&discs),
            LampShape::Ball => ball(&discs),
            LampShape::Tube(axis, size) => {
                let axis = axis.unwrap_or(up).as_dvec3();
                match size {
                    Some(size) => Some(placed(&discs, axis, size)),
                    None => tube(&discs, axis),
                }
            }
        };
        let solid = solid.ok_or("what is selected has not this shape")?;
        let weights: f64 = discs.iter().map(|disc| disc.weight).sum();
        let both = discs.iter().zip(of);
        let albedo: DVec3 = both
            .map(|(disc, g)| g.albedo.as_dvec3() * disc.weight)
            .sum();
        Ok(Surface {
            solid,
            material: Material {
                albedo: (albedo / weights).as_vec3().min(Vec3::ONE),
                radiance: Some(self.radiance),
                gloss: Gloss::NONE,
            },
            spacing: None,
        })
    }
}

/// A Gaussian of the selection.
struct Disc {
    centre: DVec3,
    /// Axes in its plane, one standard deviation long.
    axes: [DVec3; 2],
    normal: DVec3,
    /// Area that it covers, but for a factor.
    weight: f64,
}

impl Disc {
    fn of(g: &Gaussian) -> Self {
        let axes = [Vec3::X * g.scale.x, Vec3::Y * g.scale.y];
        Self {
            centre: g.position.as_dvec3(),
            axes: axes.map(|axis| (g.rotation * axis).as_dvec3()),
            normal: (g.rotation * Vec3::Z).as_dvec3(),
            weight: f64::from(g.scale.x * g.scale.y * g.opacity).max(f64::MIN_POSITIVE),
        }
    }

    /// Points with the mean and the covariance of the disc, and the weight of each: it reaches out
    /// of a round surface that it touches.
    fn points(&self) -> [(DVec3, f64); 4] {
        let [u, v] = self.axes.map(|axis| axis * SQRT_2);
        [u, -u, v, -v].map(|offset| (self.centre + offset, self.weight))
    }
}

/// Both ends of what discs cover along a direction.
fn ends<'a>(discs: &(impl Iterator<Item = &'a Disc> + Clone), along: DVec3, edge: f64) -> [f64; 2] {
    let reach = |side: f64| {
        discs.clone().map(move |disc| {
            let [u, v] = disc.axes.map(|axis| axis.dot(along));
            let reach = side * REACH * u.hypot(v);
            (disc.centre.dot(along) + reach, disc.weight)
        })
    };
    [
        quantile(reach(-1.0), edge),
        quantile(reach(1.0), 1.0 - edge),
    ]
}

/// Middle and whole axes of the smallest rectangle about flat discs.
fn flat(discs: &[Disc]) -> Option<(Vec3, [Vec3; 2])> {
    let points = discs.iter().flat_map(Disc::points);
    let normal = FittedPlane::through(points.map(|point| point.0.as_vec3())).normal?;
    let normal = normal.as_dvec3();
    let (x, y) = normal.any_orthonormal_pair();
    let rectangles = (0..NUM_TURNS).map(|turn| {
        let angle = f64::from(turn) / f64::from(NUM_TURNS) * FRAC_PI_2;
        let turned = x * angle.cos() + y * angle.sin();
        [turned, normal.cross(turned)].map(|along| (along, ends(&discs.iter(), along, EDGE)))
    });
    let area = |r: &[(DVec3, [f64; 2]); 2]| r.iter().map(|(_, [a, b])| b - a).product::<f64>();
    let smallest = rectangles.min_by(|a, b| area(a).total_cmp(&area(b)))?;
    let heights = discs.iter().map(|d| (d.centre.dot(normal), d.weight));
    let middle = smallest
        .iter()
        .map(|(along, [a, b])| *along * (0.5 * (a + b)));
    let centre = normal * quantile(heights, 0.5) + middle.sum::<DVec3>();
    let axes = smallest.map(|(along, [a, b])| (along * (b - a)).as_vec3());
    let is_flat = axes.iter().all(|axis| axis.length() > 0.0);
    is_flat.then(|| (centre.as_vec3(), axes))
}

fn rectangle(discs: &[Disc]) -> Option<Solid> {
    let (centre, edges) = flat(discs)?;
    Some(Solid::Quad { centre, edges })
}

fn ellipse(discs: &[Disc]) -> Option<Solid> {
    let (centre, axes) = flat(discs)?;
    Some(Solid::Ellipse {
        centre,
        axes: axes.map(|axis| axis / ELLIPSE_PART),
    })
}
