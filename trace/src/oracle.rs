//! The model once more, in double precision and by brute force: every Gaussian is tried on every
//! ray. Slow on purpose and sharing no code with the engines, it is what their results and
//! derivatives are tested against.

use crate::features::{NUM_LANES, lane};
use crate::model::{MAX_RADIUS, MIN_ALPHA, MIN_COSINE, MIN_TRANSMITTANCE, MIN_WEIGHT};
use eagpt_scene::Gaussian;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// A Gaussian in double precision. The rotation need not be normalised: [`trace`] normalises, so
/// that derivatives with respect to its four components are those of the normalised quaternion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OracleGaussian {
    /// Centre.
    pub position: DVec3,
    /// In-plane scales.
    pub scale: DVec2,
    /// Rotation, any length above 0.
    pub rotation: DQuat,
    /// Peak opacity.
    pub opacity: f64,
    /// Radiance.
    pub radiance: DVec3,
    /// Emission.
    pub emission: f64,
    /// Albedo.
    pub albedo: DVec3,
}

impl From<&Gaussian> for OracleGaussian {
    fn from(g: &Gaussian) -> Self {
        Self {
            position: g.position.as_dvec3(),
            scale: g.scale.as_dvec2(),
            rotation: g.rotation.as_dquat(),
            opacity: f64::from(g.opacity),
            radiance: g.radiance.as_dvec3(),
            emission: f64::from(g.emission),
            albedo: g.albedo.as_dvec3(),
        }
    }
}

/// One hit of the oracle.
#[derive(Debug, Clone, Copy)]
pub struct OracleHit {
    /// Index of the Gaussian.
    pub index: usize,
    /// Distance along the ray.
    pub t: f64,
    /// Opacity.
    pub alpha: f64,
    /// Squared in-plane distance over the squared radius of the cut: 1 at the edge.
    pub edge: f64,
    normal: DVec3,
}

/// Whether single precision may see hits differently: one lies on the rim of its Gaussian, or two
/// are about to swap places.
pub fn is_ambiguous(hits: &[OracleHit]) -> bool {
    hits.iter().any(|hit| (hit.edge - 1.0).abs() < 1e-3)
        || hits.windows(2).any(|pair| (pair[1].t - pair[0].t) < 1e-5)
}

/// All hits of a ray in order, before any is skipped.
pub fn hits(gaussians: &[OracleGaussian], origin: DVec3, direction: DVec3) -> Vec<OracleHit> {
    let mut found: Vec<OracleHit> = gaussians
        .iter()
        .enumerate()
        .filter_map(|(index, g)| {
            let frame = DMat3::from_quat(g.rotation.normalize());
            let (t_u, t_v, normal) = (frame.x_axis, frame.y_axis, frame.z_axis);
            let cosine = direction.dot(normal);
            let t = (g.position - origin).dot(normal) / cosine;
            if cosine.abs() <= f64::from(MIN_COSINE) || t <= 0.0 {
                return None;
            }
            let offset = origin + direction * t - g.position;
            let (u, v) = (offset.dot(t_u) / g.scale.x, offset.dot(t_v) / g.scale.y);
            let cut2 = f64::from(MAX_RADIUS)
                .powi(2)
                .min(2.0 * (g.opacity / f64::from(MIN_ALPHA)).ln());
            let r2 = u * u + v * v;
            let normal = if cosine > 0.0 { -normal } else { normal };
            (r2 <= cut2).then(|| OracleHit {
                index,
                t,
                alpha: g.opacity * (-0.5 * r2).exp(),
                edge: r2 / cut2,
                normal,
            })
        })
        .collect();
    found.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.index.cmp(&b.index)));
    found
}

/// Composited features of one ray, in the lanes of [`crate::features::lane`].
pub fn trace(gaussians: &[OracleGaussian], origin: DVec3, direction: DVec3) -> [f64; NUM_LANES] {
    let mut features = [0.0; NUM_LANES];
    let mut transmittance = 1.0_f64;
    let mut first = None;
    for hit in hits(gaussians, origin, direction) {
        let weight = transmittance * hit.alpha;
        if weight < f64::from(MIN_WEIGHT) {
            continue;
        }
        let first = *first.get_or_insert(hit.t);
        let g = &gaussians[hit.index];
        for c in 0..3 {
            features[lane::RADIANCE + c] += weight * g.radiance[c];
            features[lane::ALBEDO + c] += weight * g.albedo[c];
            features[lane::NORMAL + c] += weight * hit.normal[c];
        }
        features[lane::EMISSION] += weight * g.emission;
        features[lane::ALPHA] += weight;
        features[lane::DISTANCE] += weight * hit.t;
        features[lane::SPREAD] += weight * (hit.t - first).powi(2);
        features[lane::SIZE] += weight * (g.scale.x * g.scale.y).sqrt();
        features[lane::FIRST] = first;
        transmittance *= 1.0 - hit.alpha;
        if transmittance < f64::from(MIN_TRANSMITTANCE) {
            break;
        }
    }
    features
}
