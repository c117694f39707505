//! Balls and tubes about discs.

use super::fit::{crossing, fit, quantile};
use super::{Disc, EDGE, REACH, TubeSize, ends};
use eagpt_scene::discs::Solid;
use glam::{DVec2, DVec3};
use nalgebra::SVector;
use std::f64::consts::{PI, TAU};

/// As [`EDGE`], of the side of a tube and of what closes it: among the few discs of a shade those
/// of its pole or cord are more than one in fifty.
const EDGE_OF_TUBE: f64 = 0.05;
/// Cosine between the axis of a tube and the normals of its ends, at least.
const END_COSINE: f64 = 0.8;
/// Discs close a tube if they face its axis this near to an end, in lengths, and are this part of
/// its cross-section. They may widen it by so much.
const CAP_DEPTH: f64 = 0.25;
const MIN_CAP: f64 = 0.5;
const MAX_FLARE: f64 = 1.5;
/// Radius of the narrower end of a tube in that of the wider one, at least.
const MIN_END: f64 = 0.05;

/// The ball about discs; `None` where they lie on none.
pub(super) fn ball(discs: &[Disc]) -> Option<Solid> {
    let normals = discs.iter().map(|disc| {
        let [p, n] = [disc.centre, disc.normal].map(|v| SVector::from(v.to_array()));
        (p, n, disc.weight)
    });
    let start = DVec3::from_array(crossing(normals)?.into());
    let points = discs.iter().flat_map(Disc::points);
    let far = points
        .clone()
        .map(|(p, weight)| (p.distance(start), weight));
    let start = SVector::from([start.x, start.y, start.z, quantile(far, 0.5)]);
    let fitted = fit(start, &points, |p, point| {
        let from = point - DVec3::new(p[0], p[1], p[2]);
        let d = from.normalize_or_zero();
        (
            from.length() - p[3],
            SVector::from([-d.x, -d.y, -d.z, -1.0]),
        )
    })?;
    let [x, y, z, radius] = fitted.parameters.into();
    fitted.is_near(radius).then(|| Solid::Ball {
        centre: DVec3::new(x, y, z).as_vec3(),
        radius: radius as f32,
    })
}

/// The tube about discs, along a unit `axis`; `None` where they lie on none.
pub(super) fn tube(discs: &[Disc], axis: DVec3) -> Option<Solid> {
    let (x, y) = axis.any_orthonormal_pair();
    let across = |v: DVec3| DVec2::new(v.dot(x), v.dot(y));
    let is_side = |disc: &&Disc| disc.normal.dot(axis).abs() < END_COSINE;
    let side = || discs.iter().filter(is_side);
    if side().next().is_none() {
        return filled(discs, axis);
    }
    let [low, high] = ends(&side(), axis, EDGE_OF_TUBE);
    let middle = 0.5 * (low + high);
    let normals = side().map(|disc| {
        let normal = across(disc.normal).normalize_or_zero();
        let [p, n] = [across(disc.centre), normal].map(|v| SVector::from(v.to_array()));
        (p, n, disc.weight)
    });
    let start = DVec2::from_array(crossing(normals)?.into());
    let points = side().flat_map(Disc::points);
    let far = points
        .clone()
        .map(|(p, weight)| (across(p).distance(start), weight));
    let start = SVector::from([start.x, start.y, quantile(far, 0.5), 0.0]);
    let fitted = fit(start, &points, |p, point| {
        let from = across(point) - DVec2::new(p[0], p[1]);
        let d = from.normalize_or_zero();
        let height = point.dot(axis) - middle;
        let distance = from.length() - p[2] - p[3] * height;
        (distance, SVector::from([-d.x, -d.y, -1.0, -height]))
    })?;
    let [at_x, at_y, radius, slope] = fitted.parameters.into();
    if high <= low || !fitted.is_near(radius) {
        return None;
    }
    let foot = x * at_x + y * at_y;
    let rims = [low, high].map(|height| {
        let rim = Rim {
            height,
            radius: radius + slope * (height - middle),
        };
        let cap = discs.iter().filter(|disc| {
            let off = (disc.centre.dot(axis) - height).abs();
            !is_side(disc) && off < CAP_DEPTH * (high - low)
        });
        rim.of_cap(cap, foot, axis).unwrap_or(rim)
    });
    let [low, high] = rims.each_ref().map(|rim| rim.height);
    let least = MIN_END * rims[0].radius.max(rims[1].radius);
    Some(Solid::Tube {
        centre: (foot + axis * (0.5 * (low + high))).as_vec3(),
        axis: (axis * (high - low)).as_vec3(),
        radii: rims.map(|rim| rim.radius.max(least) as f32),
        is_open: false,
    })
}

/// The tube of a known size in the middle of discs, along a unit `axis`.
pub(super) fn placed(discs: &[Disc], axis: DVec3, size: TubeSize) -> Solid {
    let (x, y) = axis.any_orthonormal_pair();
    let middle = |along: DVec3| {
        let [low, high] = ends(&discs.iter(), along, EDGE_OF_TUBE);
        along * (0.5 * (low + high))
    };
    Solid::Tube {
        centre: (middle(x) + middle(y) + middle(axis)).as_vec3(),
        axis: axis.as_vec3() * size.height,
        radii: size.radii,
        is_open: false,
    }
}

/// The cylinder of discs that all face along its axis: they fill its cross-section, whose points
/// are two thirds of the radius from the middle, in the mean.
fn filled(discs: &[Disc], axis: DVec3) -> Option<Solid> {
    let weights: f64 = discs.iter().map(|disc| disc.weight).sum();
    let mean = discs.iter().map(|d| d.centre * d.weight).sum::<DVec3>() / weights;
    let foot = mean - axis * mean.dot(axis);
    let far = discs.iter().map(|disc| {
        let from = disc.centre - foot;
        (from - axis * from.dot(axis)).length() * disc.weight
    });
    let radius = (1.5 * far.sum::<f64>() / weights) as f32;
    let [low, high] = ends(&discs.iter(), axis, EDGE);
    (high > low && radius > 0.0).then(|| Solid::Tube {
        centre: (foot + axis * (0.5 * (low + high))).as_vec3(),
        axis: (axis * (high - low)).as_vec3(),
        radii: [radius; 2],
        is_open: false,
    })
}

/// An end of a tube.
#[derive(Clone, Copy)]
struct Rim {
    height: f64,
    radius: f64,
}

impl Rim {
    /// As the discs that close the tube show it, about an axis through `foot`, if they cover it.
    fn of_cap<'a>(
        self,
        cap: impl Iterator<Item = &'a Disc> + Clone,
        foot: DVec3,
        axis: DVec3,
    ) -> Option<Self> {
        let area = TAU * cap.clone().map(|disc| disc.weight).sum::<f64>();
        if area < MIN_CAP * PI * self.radius * self.radius {
            return None;
        }
        let reach = cap.clone().map(|disc| {
            let from = disc.centre - foot;
            let from = from - axis * from.dot(axis);
            let outwards = from.normalize_or_zero();
            let [u, v] = disc.axes.map(|axis| axis.dot(outwards));
            (from.length() + REACH * u.hypot(v), disc.weight)
        });
        let heights = cap.map(|disc| (disc.centre.dot(axis), disc.weight));
        let widest = quantile(reach, 1.0 - EDGE_OF_TUBE).min(MAX_FLARE * self.radius);
        Some(Self {
            height: quantile(heights, 0.5),
            radius: self.radius.max(widest),
        })
    }
}
