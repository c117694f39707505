//! Planes of surfaces: where most of a surface faces one way, its discs are made to, as discs that
//! differ in tilt break up every mirror image. They stay where they are: in one plane their order,
//! and with it what is hidden below, would be lost.

use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_light::segments::Segments;
use eagpt_scene::Gaussians;
use eagpt_scene::median::weighted_median;
use eagpt_scene::plane::Plane;
use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;

/// Cosine between the normal of a plane and what is part of it, at least: 20 degrees.
const LEAST_COSINE: f32 = 0.94;
/// Least part of a surface, by area, that faces the way of its plane.
const LEAST_PART: f32 = 0.6;
/// Rounds in which what faces elsewhere is left out of the mean normal.
const FITS: usize = 4;
/// Distances from a plane beyond this many times their median are no noise.
const REACH: f32 = 3.0;
/// Most that points of a plane are off it, in the mean, and most that its discs are, in parts of
/// the radius of the surface: what is rougher is not flat.
const MOST_UNEVEN: f32 = 0.1;
const MOST_REACH: f32 = 0.25;
/// Rounds of smoothing of normals.
const ROUNDS: usize = 3;

/// The plane of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SurfacePlane {
    pub(super) plane: Plane,
    /// Discs of the surface are this far from it, at most.
    pub(super) reach: f32,
}

impl SurfacePlane {
    /// The unit normal.
    pub(super) fn normal(&self) -> Vec3 {
        self.plane.normal
    }

    /// Whether it reaches as far as a point.
    pub(super) fn reaches(&self, point: Vec3) -> bool {
        self.plane.height(point).abs() <= self.reach
    }

    /// Whether a surface of this unit normal is part of it.
    pub(super) fn has(&self, normal: Vec3) -> bool {
        normal.dot(self.normal()) >= LEAST_COSINE
    }
}

/// Planes and normals of surfaces.
pub(super) struct Planes {
    /// Of each surface; `None` where it is curved.
    pub(super) of: Vec<Option<SurfacePlane>>,
    /// Whether receivers are part of the plane of their surface, `[receivers]`.
    lies: Vec<bool>,
    /// Unit normals of receivers without most of their noise: of what is part of a plane that of
    /// the plane, of others a mean of neighbours, `[receivers]`.
    pub(super) normals: Vec<Vec3>,
}

impl Planes {
    /// The planes of surfaces without receivers.
    #[cfg(test)]
    pub(super) fn flat(of: Vec<Option<SurfacePlane>>) -> Self {
        Self {
            of,
            lies: Vec::new(),
            normals: Vec::new(),
        }
    }

    /// Fits planes to the surfaces of `receivers`.
    pub(super) fn new(
        receivers: &[Receiver],
        segments: &Segments,
        smoothing: &Smoothing,
        gaussians: &Gaussians,
    ) -> Self {
        let of_gaussian = |(i, _): &Receiver| {
            let i = *i as usize;
            let scale = gaussians.scales[i];
            (
                gaussians.positions[i],
                scale.x * scale.y * gaussians.opacities[i],
            )
        };
        let (centres, areas): (Vec<Vec3>, Vec<f32>) = receivers.iter().map(of_gaussian).unzip();
        let of: Vec<Option<SurfacePlane>> = segments
            .members()
            .iter()
            .map(|members| plane(receivers, members, &centres, &areas))
            .collect();
        let mut normals = smooth(receivers, smoothing, &areas);
        let mut lies = vec![false; receivers.len()];
        for (r, (_, surface)) in receivers.iter().enumerate() {
            let plane = of[segments.of[r] as usize].filter(|plane| plane.has(surface.normal));
            if let Some(plane) = plane {
                lies[r] = true;
                normals[r] = plane.normal();
            }
        }
        Self { of, lies, normals }
    }

    /// The plane that receiver `r` of a surface is part of, if it is.
    pub(super) fn of_receiver(&self, r: usize, segment: u32) -> Option<SurfacePlane> {
        self.of[segment as usize].filter(|_| self.lies[r])
    }
}

/// The plane of those of the `receivers` that are `members` of a surface.
fn plane(
    receivers: &[Receiver],
    members: &[usize],
    centres: &[Vec3],
    areas: &[f32],
) -> Option<SurfacePlane> {
    let own = |r: usize| receivers[r].1.normal;
    let sum = |among: &mut dyn Iterator<Item = usize>| -> Option<Vec3> {
        let sum: Vec3 = among.map(|r| own(r) * areas[r]).sum();
        sum.try_normalize()
    };
    let mut normal = sum(&mut members.iter().copied())?;
    for _ in 0..FITS {
        let near = |r: &usize| own(*r).dot(normal) >= LEAST_COSINE;
        normal = sum(&mut members.iter().copied().filter(near))?;
    }
    let near = members.iter().copied();
    let near: Vec<usize> = near
        .filter(|&r| own(r).dot(normal) >= LEAST_COSINE)
        .collect();
    let area = |among: &[usize]| among.iter().map(|&r| areas[r]).sum::<f32>();
    if area(&near) < LEAST_PART * area(members) {
        return None;
    }
    let median =
        |value: &dyn Fn(usize) -> f32| weighted_median(near.iter().map(|&r| (value(r), areas[r])));
    let plane = Plane {
        normal,
        offset: median(&|r| normal.dot(receivers[r].1.position)),
    };
    let spread = median(&|r| plane.height(centres[r]).abs());
    let thickness = median(&|r| receivers[r].1.offset);
    let middle = near.iter().map(|&r| receivers[r].1.position * areas[r]);
    let middle = middle.sum::<Vec3>() / area(&near);
    let radius = median(&|r| receivers[r].1.position.distance(middle));
    let uneven = median(&|r| plane.height(receivers[r].1.position).abs());
    (uneven <= MOST_UNEVEN * radius).then(|| SurfacePlane {
        plane,
        reach: (REACH * spread).max(thickness).min(MOST_REACH * radius),
    })
}

/// Means of the normals of neighbours.
fn smooth(receivers: &[Receiver], smoothing: &Smoothing, areas: &[f32]) -> Vec<Vec3> {
    let own: Vec<Vec3> = receivers.iter().map(|(_, s)| s.normal).collect();
    let mut smooth = own.clone();
    for _ in 0..ROUNDS {
        let before = smooth.clone();
        for (i, normal) in smooth.iter_mut().enumerate() {
            let mut sum = before[i] * areas[i];
            for &(j, _) in smoothing.neighbours(i) {
                sum += before[j as usize] * areas[j as usize];
            }
            *normal = sum.try_normalize().unwrap_or(own[i]);
        }
    }
    smooth
}
