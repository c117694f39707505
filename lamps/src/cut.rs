//! Lamps of which no picture shows all: views have pieces of them that end at the pictures' edges,
//! and what training knows of these is too little for them to be in one place.

use crate::evidence::Evidence;
use crate::fit;
use crate::fit::shape_search::Fit;
use crate::group::Group;
use crate::shape::Flat;
use glam::{Vec2, Vec3};

/// Cosine between the normals of two pieces, at least.
const PARALLEL: f32 = 0.95;
/// Distance of two pieces, along their normal and in their plane, in the narrow side of the larger
/// one, at most.
const NEAR: f32 = 0.25;
/// Residual of the whole, at most.
const MAX_RESIDUAL: f32 = 0.06;

/// The lamp that two flat ones are pieces of, if the edges of pictures cut both and one panel
/// explains the pixels of both; `up` is the unit vector upwards.
pub(crate) fn joined(
    evidence: &Evidence,
    [(a, fit_a), (b, fit_b)]: [(&Group, &Fit); 2],
    up: Vec3,
) -> Option<(Group, Fit)> {
    let [flat_a, flat_b] = [fit_a.shape.flat()?, fit_b.shape.flat()?];
    let are_pieces = !a.is_unlike(b) && is_cut(evidence, a) && is_cut(evidence, b);
    if !are_pieces || !(touch(flat_a, flat_b) || touch(flat_b, flat_a)) {
        return None;
    }
    let whole = Group::together([a.clone(), b.clone()].into_iter());
    let fit = fit::fit(evidence, &whole, up)?;
    let is_panel = fit.shape.flat().is_some() && fit.residual <= MAX_RESIDUAL;
    is_panel.then_some((whole, fit))
}

/// Whether the edge of the picture cuts a lamp in every view that shows it.
fn is_cut(evidence: &Evidence, group: &Group) -> bool {
    let at_edge = |member: &(u32, u32)| {
        let (sight, pixel) = evidence.pixel(member);
        sight.at_edge(pixel)
    };
    group
        .by_view()
        .all(|(_, members)| members.iter().any(at_edge))
}

/// Whether a corner of `b`, or its middle, is in the plane of `a` and at most beside it.
fn touch(a: &Flat, b: &Flat) -> bool {
    let half = 0.5 * Vec2::from(a.size);
    let narrow = |flat: &Flat| flat.size[0].min(flat.size[1]);
    let near = NEAR * narrow(a).max(narrow(b));
    let is_near = |[x, y]: [f32; 2]| {
        let corner = b.centre + b.rotation * Vec3::new(x * b.size[0], y * b.size[1], 0.0);
        let local = a.rotation.conjugate() * (corner - a.centre);
        let outside = (local.truncate().abs() - half).max_element();
        local.z.abs() <= near && outside <= near
    };
    let places = [[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5], [0.0; 2]];
    a.normal().dot(b.normal()) >= PARALLEL && places.into_iter().any(is_near)
}
