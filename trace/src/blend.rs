//! Blending of ordered hits and its adjoint (EAG-PT, equations of section 3.1).
//!
//! `V = Σ wᵢ vᵢ`, `wᵢ = Tᵢ₋₁ αᵢ`, `Tᵢ = Π (1 − αⱼ)`. The adjoint runs back to front with the value `Cᵢ` of everything from
//! hit i on, `Cᵢ = αᵢ cᵢ + (1 − αᵢ) Cᵢ₊₁` where `cᵢ = ⟨dL/dV, vᵢ⟩`; then `dL/dαᵢ = Tᵢ₋₁ (cᵢ − Cᵢ₊₁)`. No division by `1 − α`: opaque
//! hits need no special case.

use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::sums::{NUM_LANES, Sums, lane};
use crate::surfel::{Payload, SeenSurfel};

/// A hit as a search finds it, sortable by true distance, ties by index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in the upper 32 bits (positive floats order like their bits), index of the Gaussian in the lower.
    key: u64,
    /// Opacity α of the hit.
    pub alpha: f32,
}

impl Hit {
    /// A hit at distance `t > 0` on Gaussian (or slot) `index`.
    #[inline(always)]
    pub fn new(t: f32, index: u32, alpha: f32) -> Self {
        Self {
            key: u64::from(t.to_bits()) << 32 | u64::from(index),
            alpha,
        }
    }

    /// Distance along the ray.
    #[inline(always)]
    pub fn t(&self) -> f32 {
        f32::from_bits((self.key >> 32) as u32)
    }

    /// Index of the Gaussian.
    #[inline(always)]
    pub fn index(&self) -> u32 {
        self.key as u32
    }

    /// Whether this hit is blended before `other`.
    #[inline(always)]
    pub fn is_before(&self, other: &Self) -> bool {
        self.key < other.key
    }
}

/// Sorts hits front to back. Searches deliver them nearly sorted, which insertion likes; long lists go to the
/// standard sort.
pub fn sort_hits(hits: &mut [Hit]) {
    const INSERTION_LIMIT: usize = 48;
    if hits.len() > INSERTION_LIMIT {
        hits.sort_unstable_by_key(|hit| hit.key);
        return;
    }
    for i in 1..hits.len() {
        let hit = hits[i];
        let mut j = i;
        while j > 0 && hits[j - 1].key > hit.key {
            hits[j] = hits[j - 1];
            j -= 1;
        }
        hits[j] = hit;
    }
}

/// What became of a hit offered to a [`Blender`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offered {
    /// Too light to matter.
    Skipped,
    /// Added.
    Blended,
    /// Added, and the ray ends here.
    Last,
}

/// Blends hits front to back into [`Sums`].
#[derive(Debug, Clone, Copy)]
pub struct Blender {
    sums: Sums,
    transmittance: f32,
}

impl Default for Blender {
    fn default() -> Self {
        Self {
            sums: Sums::default(),
            transmittance: 1.0,
        }
    }
}

/// The payload of a hit with the lanes that depend on the ray filled in: the normal turned towards the origin, the distance.
#[inline(always)]
fn hit_values(payload: &Payload, direction: [f32; 3], t: f32) -> [f32; NUM_LANES] {
    let mut values = payload.0;
    let normal = &mut values[lane::NORMAL..lane::NORMAL + 3];
    let facing = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2];
    if facing > 0.0 {
        normal.iter_mut().for_each(|n| *n = -*n);
    }
    values[lane::DISTANCE] = t;
    values
}

impl Blender {
    /// Adds the next hit of a ray of unit `direction`.
    #[inline(always)]
    pub fn offer(&mut self, t: f32, alpha: f32, payload: &Payload, direction: [f32; 3]) -> Offered {
        let weight = self.transmittance * alpha;
        if weight < MIN_WEIGHT {
            return Offered::Skipped;
        }
        if self.transmittance == 1.0 {
            self.sums.0[lane::FIRST] = t;
        }
        let mut values = hit_values(payload, direction, t);
        let behind_first = t - self.sums.0[lane::FIRST];
        values[lane::SPREAD] = behind_first * behind_first;
        for (sum, value) in self.sums.0.iter_mut().zip(values) {
            *sum += weight * value;
        }
        self.transmittance *= 1.0 - alpha;
        if self.transmittance < MIN_TRANSMITTANCE {
            Offered::Last
        } else {
            Offered::Blended
        }
    }

    /// The sums of all hits so far.
    #[inline(always)]
    pub fn finish(self) -> Sums {
        self.sums
    }

    /// Share of light from behind that still passes.
    #[inline(always)]
    pub fn transmittance(&self) -> f32 {
        self.transmittance
    }
}

/// Lanes of a [`LocalGradient`].
pub mod grad_lane {
    /// Position, in the Gaussian's frame (t_u, t_v, n): three lanes.
    pub const POSITION: usize = 0;
    /// Scales: two lanes.
    pub const SCALE: usize = 3;
    /// Rotation by a small angle about t_u, t_v, n: three lanes, per radian.
    pub const ROTATION: usize = 5;
    /// Opacity.
    pub const OPACITY: usize = 8;
    /// Radiance: three lanes.
    pub const RADIANCE: usize = 9;
    /// Emission.
    pub const EMISSION: usize = 12;
    /// Albedo: three lanes.
    pub const ALBEDO: usize = 13;
}

/// Derivatives of the loss with respect to one Gaussian, in its own frame; see [`grad_lane`]. Sixteen numbers hold all
/// parameters because only three angles of a rotation matter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct LocalGradient(pub [f32; NUM_LANES]);

impl LocalGradient {
    /// Adds another gradient of the same Gaussian.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a += b;
        }
    }
}

/// One blended hit of a ray, as the adjoint needs it again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlendedHit {
    /// Where the owner of the ray keeps the Gaussian.
    pub slot: u32,
    /// Distance along the ray.
    pub t: f32,
    /// Opacity α.
    pub alpha: f32,
}

/// A Gaussian as the adjoint sees it.
pub struct AdjointSurfel<'a> {
    /// Geometry relative to the ray's origin.
    pub seen: &'a SeenSurfel,
    /// In-plane scales, scene units.
    pub scale: [f32; 2],
    /// Light and material.
    pub payload: &'a Payload,
}

/// Adjoint of [`Blender`] for one ray: given `d_sums` = dL/dV, hands the gradient of every blended hit to `accumulate`,
/// back to front. The spread, size and first-hit lanes are not differentiated. `transmittances` is scratch space.
#[inline(always)]
pub fn adjoint<'a>(
    hits: &[BlendedHit],
    direction: [f32; 3],
    d_sums: &Sums,
    surfel_of: impl Fn(u32) -> AdjointSurfel<'a>,
    transmittances: &mut Vec<f32>,
    mut accumulate: impl FnMut(u32, LocalGradient),
) {
    transmittances.clear();
    let mut transmittance = 1.0_f32;
    for hit in hits {
        transmittances.push(transmittance);
        transmittance *= 1.0 - hit.alpha;
    }
    let mut behind = 0.0_f32;
    for (hit, &before) in hits.iter().zip(transmittances.iter()).rev() {
        let surfel = surfel_of(hit.slot);
        let values = hit_values(surfel.payload, direction, hit.t);
        let mut value = 0.0;
        for k in 0..lane::SPREAD {
            value += d_sums.0[k] * values[k];
        }
        let d_alpha = before * (value - behind);
        behind = hit.alpha * value + (1.0 - hit.alpha) * behind;
        accumulate(
            hit.slot,
            hit_gradient(hit, &surfel, direction, d_sums, before * hit.alpha, d_alpha),
        );
    }
}

#[inline(always)]
fn hit_gradient(
    hit: &BlendedHit,
    surfel: &AdjointSurfel<'_>,
    direction: [f32; 3],
    d_sums: &Sums,
    weight: f32,
    d_alpha: f32,
) -> LocalGradient {
    let met = surfel.seen.meet(direction);
    let [scale_u, scale_v] = surfel.scale;
    // α = σ·exp(−(u² + v²)/2)
    let d_u = -d_alpha * hit.alpha * met.u;
    let d_v = -d_alpha * hit.alpha * met.v;
    // The plane moves the hit along the ray: t feeds D directly, u and v through the point.
    let dot = |a: [f32; 3]| a[0] * direction[0] + a[1] * direction[1] + a[2] * direction[2];
    let d_t = weight * d_sums.0[lane::DISTANCE]
        + d_u * dot(surfel.seen.axis_u)
        + d_v * dot(surfel.seen.axis_v);
    // t = (p − o)·n / (ω·n): dt/dp = n/(ω·n), dt/dn = (p − x)/(ω·n), and p − x = −(u s_u t_u + v s_v t_v).
    let d_plane = d_t / met.cosine;
    // N = Σ w n, turned; its derivative along t_u and t_v turns the normal.
    let turned = if met.cosine > 0.0 { -weight } else { weight };
    let d_normal = &d_sums.0[lane::NORMAL..lane::NORMAL + 3];
    let along =
        |axis: [f32; 3]| d_normal[0] * axis[0] + d_normal[1] * axis[1] + d_normal[2] * axis[2];
    let d_normal_u = turned * scale_u * along(surfel.seen.axis_u) - d_plane * met.u * scale_u;
    let d_normal_v = turned * scale_v * along(surfel.seen.axis_v) - d_plane * met.v * scale_v;
    let d_radiance = &d_sums.0[lane::RADIANCE..lane::RADIANCE + 3];
    let d_albedo = &d_sums.0[lane::ALBEDO..lane::ALBEDO + 3];
    LocalGradient([
        -d_u / scale_u,
        -d_v / scale_v,
        d_plane,
        -d_u * met.u / scale_u,
        -d_v * met.v / scale_v,
        // About t_u the normal moves along −t_v, about t_v along t_u, about n the two axes move along each other.
        -d_normal_v,
        d_normal_u,
        d_u * met.v * scale_v / scale_u - d_v * met.u * scale_u / scale_v,
        d_alpha * hit.alpha / surfel.seen.opacity,
        weight * d_radiance[0],
        weight * d_radiance[1],
        weight * d_radiance[2],
        weight * d_sums.0[lane::EMISSION],
        weight * d_albedo[0],
        weight * d_albedo[1],
        weight * d_albedo[2],
    ])
}
