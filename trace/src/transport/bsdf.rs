//! The BSDF of a glossy surface: a GGX lobe over a diffuse one.
//!
//! The specular lobe is that of Walter et al. (2007) with the height-correlated masking of Smith
//! (Heitz 2014) and Schlick's Fresnel term; α is the square of the roughness. Facets whose F0 is
//! below 0.02 lose their reflection at grazing angles as well, so that a surface without F0 has no
//! lobe at all (Lagarde and de Rousiers 2014, section 3.2.1).
//!
//! Light that the lobe does not reflect, 1 − E(μ), is scattered diffusely (Kelemen and
//! Szirmay-Kalos 2001): `f = f_s + P · (1 − E(μᵢ)) (1 − E(μₒ)) / (π (1 − Ē))`, with E the albedo of
//! the lobe for light from cosine μ and Ē its mean over the hemisphere. It is reciprocal, and
//! reflects E(μ) + P (1 − E(μ)): never more than arrives, and all of it for P = 1. What facets send
//! to each other is part of what the lobe does not reflect.

use crate::transport::sampling::cosine_direction;
use eagpt_scene::Gloss;
use eagpt_scene::color::luminance;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::sync::OnceLock;

/// Least α: a mirror that blurs by a tenth of a degree, whose numbers stay finite.
pub(crate) const MIN_ALPHA: f32 = 1e-3;
/// F0 below which the reflection at grazing angles fades.
pub(crate) const FULL_GRAZING_SPECULAR: f32 = 0.02;
/// Cosines are taken no smaller.
pub(crate) const MIN_COSINE: f32 = 1e-4;

/// GGX's α of a roughness.
pub fn alpha_of(roughness: f32) -> f32 {
    (roughness * roughness).max(MIN_ALPHA)
}

/// Reflection of facets at grazing angles.
fn grazing(specular: Vec3) -> f32 {
    (specular.max_element() / FULL_GRAZING_SPECULAR).min(1.0)
}

/// A surface's reflection of light towards one direction.
#[derive(Debug, Clone, Copy)]
pub struct Bsdf {
    normal: Vec3,
    tangent: Vec3,
    bitangent: Vec3,
    /// Towards the eye, in the frame (tangent, bitangent, normal).
    out: Vec3,
    alpha: f32,
    roughness: f32,
    lobe: LobeAlbedo,
    /// P (1 − E(μₒ)) / (1 − Ē).
    diffuse: Vec3,
    /// Chance that a direction is sampled from the specular lobe.
    specular_share: f32,
    /// Of light from everywhere, what goes to the eye.
    albedo: Vec3,
}

/// A sampled direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfSample {
    /// Unit direction above the surface.
    pub direction: Vec3,
    /// f · cos θ.
    pub value: Vec3,
    /// Density over solid angle with which both lobes together choose the direction.
    pub density: f32,
}

impl Bsdf {
    /// Reflection towards the unit direction `to_eye` by a surface of unit `normal`, diffuse
    /// `albedo` and `gloss`.
    pub fn new(normal: Vec3, to_eye: Vec3, albedo: Vec3, gloss: Gloss) -> Self {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let cosine = to_eye.dot(normal).max(MIN_COSINE);
        let out = Vec3::new(to_eye.dot(tangent), to_eye.dot(bitangent), cosine).normalize();
        let lobe = LobeAlbedo::of(gloss);
        let mirrored = lobe.at(out.z);
        let rest = Vec3::ONE - mirrored;
        let diffuse = albedo * rest / (Vec3::ONE - lobe.mean()).max(Vec3::splat(MIN_COSINE));
        let scattered = albedo * rest;
        let [s, d] = [mirrored, scattered].map(|part| luminance(part.to_array()));
        Self {
            normal,
            tangent,
            bitangent,
            out,
            alpha: alpha_of(gloss.roughness),
            roughness: gloss.roughness,
            lobe,
            diffuse,
            specular_share: if s > 0.0 { s / (s + d) } else { 0.0 },
            albedo: mirrored + scattered,
        }
    }

    /// Reflectance for light from everywhere: E(μₒ) + P (1 − E(μₒ)).
    pub fn albedo(&self) -> Vec3 {
        self.albedo
    }

    /// Of what goes to the eye, the part that the specular lobe reflects, 0 to 1.
    pub fn specular_share(&self) -> f32 {
        self.specular_share
    }

    /// Roughness of the specular lobe.
    pub fn roughness(&self) -> f32 {
        self.roughness
    }

    /// Unit direction from which a mirror would show light.
    pub fn mirror_direction(&self) -> Vec3 {
        self.world(Vec3::new(-self.out.x, -self.out.y, self.out.z))
    }

    fn world(&self, local: Vec3) -> Vec3 {
        (self.tangent * local.x + self.bitangent * local.y + self.normal * local.z).normalize()
    }

    /// f · cos θ for light from the unit `direction`, and the density with which [`Self::sample`]
    /// chooses that; zeros below the surface.
    pub fn evaluate(&self, direction: Vec3) -> (Vec3, f32) {
        let [x, y, z] = [self.tangent, self.bitangent, self.normal].map(|axis| direction.dot(axis));
        let incoming = Vec3::new(x, y, z);
        if incoming.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let cosine_density = incoming.z * FRAC_1_PI;
        let rest = Vec3::ONE - self.lobe.at(incoming.z);
        let mut value = self.diffuse * rest * cosine_density;
        let mut density = (1.0 - self.specular_share) * cosine_density;
        if self.specular_share > 0.0 {
            let half = (incoming + self.out).normalize();
            let facing = half.dot(self.out).clamp(0.0, 1.0);
            let [a, b] = [self.out, incoming].map(|w| smith(w, self.alpha));
            let facets = distribution(half, self.alpha) / (4.0 * self.out.z);
            value += self.fresnel(facing) * (facets / (1.0 + a + b));
            density += self.specular_share * facets / (1.0 + a);
        }
        (value, density)
    }

    /// A direction from three uniform numbers in [0, 1); `None` where a facet reflects below the
    /// surface, which counts as no light.
    pub fn sample(&self, [choice, a, b]: [f32; 3]) -> Option<BsdfSample> {
        let direction = if choice < self.specular_share {
            let half = visible_facet(self.out, self.alpha, a, b);
            let incoming = 2.0 * self.out.dot(half) * half - self.out;
            if incoming.z <= 0.0 {
                return None;
            }
            self.world(incoming)
        } else {
            cosine_direction(self.normal, a, b)
        };
        let (value, density) = self.evaluate(direction);
        (density > 0.0).then_some(BsdfSample {
            direction,
            value,
            density,
        })
    }

    /// Schlick's approximation for light that meets facets at the cosine `facing`.
    fn fresnel(&self, facing: f32) -> Vec3 {
        let edge = schlick(facing);
        self.lobe.specular * (1.0 - edge) + Vec3::splat(self.lobe.grazing * edge)
    }
}

fn schlick(facing: f32) -> f32 {
    (1.0 - facing).clamp(0.0, 1.0).powi(5)
}

/// Smith's Λ.
fn smith(w: Vec3, alpha: f32) -> f32 {
    let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z).max(f32::MIN_POSITIVE);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// GGX: density of facets of normal `half` over projected area.
fn distribution(half: Vec3, alpha: f32) -> f32 {
    // sin² + α² cos² keeps the digits that 1 + (α² − 1) cos² loses.
    let (sin2, a2) = (half.x * half.x + half.y * half.y, alpha * alpha);
    let root = sin2 + a2 * half.z * half.z;
    a2 / (PI * root * root).max(f32::MIN_POSITIVE)
}

/// Normal of a facet that is seen from `out`, by its visible area (Dupuy and Benyoub 2023).
fn visible_facet(out: Vec3, alpha: f32, a: f32, b: f32) -> Vec3 {
    let stretched = Vec3::new(out.x * alpha, out.y * alpha, out.z).normalize();
    let z = (1.0 - b) * (1.0 + stretched.z) - stretched.z;
    let flat = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * a).sin_cos();
    let cap = Vec3::new(flat * cos, flat * sin, z) + stretched;
    Vec3::new(cap.x * alpha, cap.y * alpha, cap.z.max(0.0)).normalize()
}

/// Entries of the table of lobe albedos along roughness and cosine.
pub(crate) const TABLE: usize = 32;
/// Pairs of the table, two in each.
#[cfg(feature = "gpu")]
pub(crate) const NUM_LOBE_ALBEDOS: usize = TABLE * (TABLE + 1) / 2;
/// Facets sampled for an entry.
const TABLE_SAMPLES: u32 = 512;

/// For F = 1 − edge and F = edge, the albedo of the lobe.
type Pair = [f32; 2];

struct Table {
    /// By roughness and cosine, `[TABLE, TABLE]`.
    at: Vec<[Pair; TABLE]>,
    /// By roughness, the mean over the hemisphere.
    mean: [Pair; TABLE],
}

impl Table {
    fn get() -> &'static Self {
        static MADE: OnceLock<Table> = OnceLock::new();
        MADE.get_or_init(Self::new)
    }

    fn new() -> Self {
        let mut table = Self {
            at: vec![[[0.0; 2]; TABLE]; TABLE],
            mean: [[0.0; 2]; TABLE],
        };
        let cosine = |k: usize| cosine_of_entry(k).max(MIN_COSINE);
        for (r, row) in table.at.iter_mut().enumerate() {
            let alpha = alpha_of(r as f32 / (TABLE - 1) as f32);
            for (k, entry) in row.iter_mut().enumerate() {
                *entry = lobe_albedo(cosine(k), alpha);
            }
            // ∫ 2 μ E(μ) dμ of a piecewise linear E, exactly.
            for part in 0..2 {
                table.mean[r][part] = (1..TABLE)
                    .map(|k| {
                        let (a, b) = (cosine_of_entry(k - 1), cosine_of_entry(k));
                        let (low, high) = (row[k - 1][part], row[k][part]);
                        (b - a) / 3.0 * (low * (2.0 * a + b) + high * (a + 2.0 * b))
                    })
                    .sum();
            }
        }
        table
    }
}

/// The table of lobe albedos as kernels have it: pairs by roughness and cosine, then their means by
/// roughness.
#[cfg(feature = "gpu")]
pub(crate) fn lobe_albedos() -> [[f32; 4]; NUM_LOBE_ALBEDOS] {
    let table = Table::get();
    let pairs: Vec<Pair> = table
        .at
        .iter()
        .flatten()
        .chain(&table.mean)
        .copied()
        .collect();
    std::array::from_fn(|i| {
        let ([a, b], [c, d]) = (pairs[2 * i], pairs[2 * i + 1]);
        [a, b, c, d]
    })
}

/// Cosines of the table are squares: its albedos change fastest at grazing angles.
fn cosine_of_entry(k: usize) -> f32 {
    (k as f32 / (TABLE - 1) as f32).powi(2)
}

fn lobe_albedo(cosine: f32, alpha: f32) -> Pair {
    let out = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let own = smith(out, alpha);
    let mut sum = [0.0_f64; 2];
    for i in 0..TABLE_SAMPLES {
        // Points of Hammersley.
        let a = (i as f32 + 0.5) / TABLE_SAMPLES as f32;
        let b = i.reverse_bits() as f32 / 2.0_f32.powi(32);
        let half = visible_facet(out, alpha, a, b);
        let facing = out.dot(half);
        let incoming = 2.0 * facing * half - out;
        if incoming.z > 0.0 {
            let seen = (1.0 + own) / (1.0 + own + smith(incoming, alpha));
            let edge = schlick(facing);
            sum[0] += f64::from(seen * (1.0 - edge));
            sum[1] += f64::from(seen * edge);
        }
    }
    sum.map(|sum| (sum / f64::from(TABLE_SAMPLES)) as f32)
}

/// Albedos of a specular lobe.
#[derive(Debug, Clone, Copy)]
struct LobeAlbedo {
    specular: Vec3,
    grazing: f32,
    /// Rows of the table around the roughness, and the share of the second.
    row: usize,
    share: f32,
}

impl LobeAlbedo {
    fn of(gloss: Gloss) -> Self {
        let place = gloss.roughness.clamp(0.0, 1.0) * (TABLE - 1) as f32;
        let row = (place as usize).min(TABLE - 2);
        Self {
            specular: gloss.specular,
            grazing: grazing(gloss.specular),
            row,
            share: place - row as f32,
        }
    }

    fn of_pair(&self, pair: Pair) -> Vec3 {
        let sum = self.specular * pair[0] + Vec3::splat(self.grazing * pair[1]);
        sum.min(Vec3::ONE)
    }

    /// E(μ).
    fn at(&self, cosine: f32) -> Vec3 {
        if self.grazing == 0.0 {
            return Vec3::ZERO;
        }
        self.of_pair(self.pair_at(cosine))
    }

    fn pair_at(&self, cosine: f32) -> Pair {
        let place = cosine.clamp(0.0, 1.0).sqrt() * (TABLE - 1) as f32;
        let k = (place as usize).min(TABLE - 2);
        let (low, high) = (cosine_of_entry(k), cosine_of_entry(k + 1));
        let along = ((cosine - low) / (high - low)).clamp(0.0, 1.0);
        let table = Table::get();
        let of_row = |row: usize| mix(table.at[row][k], table.at[row][k + 1], along);
        mix(of_row(self.row), of_row(self.row + 1), self.share)
    }

    /// Ē.
    fn mean(&self) -> Vec3 {
        if self.grazing == 0.0 {
            return Vec3::ZERO;
        }
        let table = Table::get();
        self.of_pair(mix(
            table.mean[self.row],
            table.mean[self.row + 1],
            self.share,
        ))
    }
}

fn mix(a: Pair, b: Pair, share: f32) -> Pair {
    [0, 1].map(|k| a[k] + share * (b[k] - a[k]))
}

/// The albedo of a lobe of this perceptual roughness for light from `cosine`, as `[a, b]` of
/// `F₀ a + b`, for F₀ of at least 0.02.
pub fn albedo_parts(roughness: f32, cosine: f32) -> [f32; 2] {
    let gloss = Gloss {
        specular: Vec3::ONE,
        roughness,
    };
    LobeAlbedo::of(gloss).pair_at(cosine)
}

/// Albedo of the diffuse surface that reflects as much of light from everywhere: Ē + P (1 − Ē).
pub fn equivalent_albedo(albedo: Vec3, gloss: Gloss) -> Vec3 {
    let mean = LobeAlbedo::of(gloss).mean();
    mean + albedo * (Vec3::ONE - mean)
}

/// Albedos of diffuse surfaces that reflect as much of light from everywhere as those of a scene,
/// `[n]`; the albedos themselves where nothing is glossy.
pub fn equivalent_albedos(scene: &eagpt_scene::Gaussians) -> Vec<Vec3> {
    let indices = 0..scene.len();
    indices
        .map(|i| equivalent_albedo(scene.albedos[i], scene.gloss_of(i)))
        .collect()
}
