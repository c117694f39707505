//! Blending of ordered hits (EAG-PT, equations of section 3.1): `V = Σ wᵢ vᵢ`, `wᵢ = Tᵢ₋₁ αᵢ`, `Tᵢ
//! = Π (1 − αⱼ)`. The adjoint of all rays of a camera is [`crate::cpu::CameraRecord::adjoint`].

use crate::attributes::{Attributes, Face};
use crate::features::{Features, NUM_LANES, lane};
use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use eagpt_scene::Gloss;
use glam::Vec3;

/// A hit as a search finds it, sortable by true distance, ties by index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in the upper 32 bits (positive floats order like their bits), index of the Gaussian
    /// in the lower.
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

/// Sorts hits front to back. Searches deliver them nearly sorted, which insertion likes; long lists
/// go to the standard sort.
pub(crate) fn sort_hits(hits: &mut [Hit]) {
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

/// Outcome of accumulating a hit in a [`Blender`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BlendStatus {
    /// Too light to matter.
    Skipped,
    /// Added.
    Blended,
    /// Added, and the ray ends here.
    Last,
}

/// Blends hits front to back into [`Features`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blender {
    features: Features,
    distance: f32,
    spread: f32,
    first: f32,
    transmittance: f32,
}

impl Default for Blender {
    fn default() -> Self {
        Self {
            features: Features::default(),
            distance: 0.0,
            spread: 0.0,
            first: 0.0,
            transmittance: 1.0,
        }
    }
}

impl Blender {
    /// Adds the next hit of a ray of unit `direction`.
    #[inline(always)]
    pub(crate) fn accumulate(
        &mut self,
        t: f32,
        alpha: f32,
        attributes: &Attributes,
        direction: [f32; 3],
    ) -> BlendStatus {
        let n = &attributes.0[lane::NORMAL..lane::NORMAL + 3];
        let along = n[0] * direction[0] + n[1] * direction[1] + n[2] * direction[2];
        let face = if along > 0.0 { Face::Back } else { Face::Front };
        self.accumulate_turned(t, alpha, &attributes.turned(face))
    }

    /// Adds the next hit, whose attributes have the normal turned towards the ray's origin.
    #[inline(always)]
    pub(crate) fn accumulate_turned(
        &mut self,
        t: f32,
        alpha: f32,
        attributes: &Attributes,
    ) -> BlendStatus {
        let weight = self.transmittance * alpha;
        if weight < MIN_WEIGHT {
            return BlendStatus::Skipped;
        }
        if self.transmittance == 1.0 {
            self.first = t;
        }
        for (sum, value) in self.features.0.iter_mut().zip(attributes.0) {
            *sum += weight * value;
        }
        // The lanes that depend on the ray stay out of the vector: attributes have zeros there.
        let behind_first = t - self.first;
        self.distance += weight * t;
        self.spread += weight * (behind_first * behind_first);
        self.transmittance *= 1.0 - alpha;
        if self.transmittance < MIN_TRANSMITTANCE {
            BlendStatus::Last
        } else {
            BlendStatus::Blended
        }
    }

    /// The features of all hits so far.
    #[inline(always)]
    pub(crate) fn finish(self) -> Features {
        // Added to the zeros that blending left there: lanes that were overwritten would make
        // compilers take the vector apart.
        let mut features = self.features;
        features.0[lane::DISTANCE] += self.distance;
        features.0[lane::SPREAD] += self.spread;
        features.0[lane::FIRST] += self.first;
        features
    }

    /// Share of light from behind that still passes.
    #[inline(always)]
    pub(crate) fn transmittance(&self) -> f32 {
        self.transmittance
    }
}

/// Blends the specular parts of hits: F0 by their weights, roughness by what they mirror.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct GlossBlend {
    specular: Vec3,
    /// Sums of F0's largest channel, and of that times the roughness.
    largest: f32,
    roughness: f32,
}

impl std::ops::Mul<f32> for GlossBlend {
    type Output = Self;

    fn mul(self, weight: f32) -> Self {
        Self {
            specular: self.specular * weight,
            largest: self.largest * weight,
            roughness: self.roughness * weight,
        }
    }
}

impl std::iter::Sum for GlossBlend {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), |sum, part| Self {
            specular: sum.specular + part.specular,
            largest: sum.largest + part.largest,
            roughness: sum.roughness + part.roughness,
        })
    }
}

impl GlossBlend {
    /// That of one hit of weight 1.
    pub(crate) fn of(gloss: &Gloss) -> Self {
        let largest = gloss.specular.max_element();
        Self {
            specular: gloss.specular,
            largest,
            roughness: largest * gloss.roughness,
        }
    }

    /// Adds a hit.
    #[inline(always)]
    pub(crate) fn add(&mut self, weight: f32, gloss: &Gloss) {
        self.specular += weight * gloss.specular;
        let largest = weight * gloss.specular.max_element();
        self.largest += largest;
        self.roughness += largest * gloss.roughness;
    }

    /// The specular part of all hits so far, whose weights add up to `alpha`.
    pub(crate) fn finish(self, alpha: f32) -> Gloss {
        if self.largest <= 0.0 || alpha <= 0.0 {
            return Gloss::NONE;
        }
        Gloss {
            specular: (self.specular / alpha).min(Vec3::ONE),
            roughness: (self.roughness / self.largest).min(1.0),
        }
    }
}

/// Features of a ray of unit `direction` whose one hit stands for all. Of the distances of the
/// others it says nothing: those of discs that overlap on a surface differ by about the size of a
/// disc where they are tilted, which becomes the spread.
pub(crate) fn features_of_one(t: f32, attributes: &Attributes, direction: [f32; 3]) -> Features {
    let mut blender = Blender::default();
    blender.accumulate(t, 1.0, attributes, direction);
    let mut features = blender.finish();
    let size = attributes.0[lane::SIZE];
    features.0[lane::SPREAD] = size * size;
    features
}

/// Parameters with respect to which a gradient is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GradientMask {
    /// All parameters.
    Everything,
    /// Radiance, emission and albedo only, others are zero: several times as fast on the CPU.
    LightAndMaterial,
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

/// Derivatives of the loss with respect to one Gaussian, in its own frame; see [`grad_lane`].
/// Sixteen numbers hold all parameters because only three angles of a rotation matter.
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

/// A number for a pixel, such as its error, given its place (row by row) and its features.
pub(crate) type PixelValue<'a> = &'a (dyn Fn(usize, &Features) -> f32 + Sync);

/// Contribution of a Gaussian to the pixels of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Contribution {
    /// Index in the scene.
    pub gaussian: u32,
    /// Sum of its weights: the pixels it fills.
    pub weight: f32,
    /// Sum of its weights times the pixels' values.
    pub weighted_value: f32,
    /// Its largest weight in a pixel, 0 to 1.
    pub largest_weight: f32,
    /// The first pixel where it has that, row by row.
    pub pixel: u32,
}

impl Contribution {
    /// Adds a hit with `weight` in `pixel`, whose value is `value`. The order of hits does not
    /// matter to the pixel.
    #[inline(always)]
    pub fn add(&mut self, weight: f32, pixel: u32, value: f32) {
        self.weight += weight;
        self.weighted_value += weight * value;
        let is_first = weight == self.largest_weight && pixel < self.pixel;
        if weight > self.largest_weight || is_first {
            (self.largest_weight, self.pixel) = (weight, pixel);
        }
    }
}
