//! Glossy surfaces made whole: Gaussians too faint to be compared, and the few whose views say
//! nothing, are of the surface that they are seen on.

use super::observe::Observations;
use super::planes::{Planes, SurfacePlane};
use eagpt_light::segments::Segments;
use eagpt_scene::Gaussians;
use eagpt_scene::lamps::emits;
use eagpt_trace::transport::matrix::Receiver;
use glam::{Mat3, Quat, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::num::NonZero;

/// Nearest Gaussians of known surfaces that say of which one another is.
const NEAREST: NonZero<usize> = NonZero::new(8).expect("positive");
/// Cosine between normals of what may be one surface, at least.
const LEAST_COSINE: f32 = 0.85;
/// Cosine of the largest turn that makes a disc of a plane face its way.
const MOST_TURN: f32 = 0.5;

/// A Gaussian of a glossy surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub(super) gaussian: u32,
    /// Number of the surface.
    pub(super) segment: u32,
    /// The plane that it lies in, if the surface is flat there.
    pub(super) plane: Option<SurfacePlane>,
}

/// Of the Gaussians, those of glossy surfaces. `known` says of each surface whether it is glossy;
/// `None` where its views are too few for that.
pub(super) fn parts(
    gaussians: &Gaussians,
    seen: &Observations,
    segments: &Segments,
    planes: &Planes,
    known: &[Option<bool>],
) -> Vec<Part> {
    let is_glossy = |segment: u32| known[segment as usize] == Some(true);
    let mut parts = Vec::new();
    let (mut told, mut places) = (Vec::new(), Vec::new());
    let mut open: Vec<Receiver> = seen.faint.clone();
    for (r, receiver) in seen.receivers.iter().enumerate() {
        let segment = segments.of[r];
        if is_glossy(segment) {
            parts.push(Part {
                gaussian: receiver.0,
                segment,
                plane: planes.of_receiver(r, segment),
            });
        }
        if known[segment as usize].is_some() {
            told.push(r);
            places.push(receiver.1.position.to_array());
        } else {
            open.push(*receiver);
        }
    }
    if told.is_empty() {
        return parts;
    }
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&places);
    let around = |(i, surface): &Receiver| -> Option<Part> {
        let mut votes: BTreeMap<u32, usize> = BTreeMap::new();
        let mut num = 0;
        let place = surface.position.to_array();
        for found in tree.nearest_n::<SquaredEuclidean>(&place, NEAREST) {
            let r = told[found.item as usize];
            if surface.normal.dot(planes.normals[r]) >= LEAST_COSINE {
                num += 1;
                if is_glossy(segments.of[r]) {
                    *votes.entry(segments.of[r]).or_default() += 1;
                }
            }
        }
        if 2 * votes.values().sum::<usize>() <= num {
            return None;
        }
        let (segment, _) = votes.into_iter().max_by_key(|(_, votes)| *votes)?;
        let plane = planes.of[segment as usize];
        let is_near = plane.is_none_or(|plane| plane.reaches(gaussians.positions[*i as usize]));
        is_near.then(|| Part {
            gaussian: *i,
            segment,
            plane: plane.filter(|plane| plane.has(surface.normal)),
        })
    };
    let found: Vec<Option<Part>> = open.par_iter().map(around).collect();
    parts.extend(found.into_iter().flatten());
    let emits = |part: &Part| emits(gaussians.emissions[part.gaussian as usize]);
    parts.retain(|part| !emits(part));
    parts
}

/// The rotation of a disc, turned so that its normal, or its back, is the unit `normal`; as it is
/// if that is far.
pub(super) fn turned(rotation: Quat, normal: Vec3) -> Quat {
    let own = Mat3::from_quat(rotation).z_axis;
    let wanted = normal * own.dot(normal).signum();
    if own.dot(wanted) < MOST_TURN {
        return rotation;
    }
    (Quat::from_rotation_arc(own, wanted) * rotation).normalize()
}
