//! Adjoint of the composited features of a camera.
//!
//! For a ray with hits i front to back and `G = dL/dV`, let `cᵢ = ⟨G, vᵢ⟩` and `Cᵢ = αᵢ cᵢ + (1 −
//! αᵢ) Cᵢ₊₁`, the value of everything from hit i on. Then `dL/dαᵢ = Tᵢ₋₁ (cᵢ − Cᵢ₊₁)`. With `α = σ
//! exp(−(u² + v²)/2)` a hit enters the gradient of its Gaussian by three numbers only: its weight
//! w, `a = αᵢ dL/dαᵢ = w (cᵢ − Cᵢ₊₁)`, and `h = w G_D t` for its distance. No division by `1 − α`:
//! opaque hits need no special case.
//!
//! A hit is moved by the Gaussian's in-plane axes and its plane. The distance `t = (p − o)·n /
//! (ω·n)` and the cosine are tied by `t (ω·n) = (p − o)·n`, and `u = (ω·t_u/s_u) t − u₀`; so all
//! derivatives of a hit are polynomials in u and v with coefficients that belong to the Gaussian as
//! seen from the origin. A tile sums the moments `Σ a uʲvᵏ`, `Σ h uʲvᵏ` and the light `Σ w G`
//! of each Gaussian, and makes a gradient of them once: no ray and no plane is met again.
//!
//! Gaussians get one row per tile, and rows are added in the order of the tiles: the result is the
//! same for any number of threads.

use super::harmonics::as_seen;
use super::record::{BlendedHit, CameraRecord, TileRecord, sum_rows};
use super::tile::pixels_of_tile;
use crate::attributes::{Attributes, Face};
use crate::blend::{GradientMask, LocalGradient, grad_lane};
use crate::features::{Features, NUM_LANES, lane};
use crate::surfel::{SeenSet, SeenSurfel, Surfel, SurfelSet};
use eagpt_scene::Camera;
use glam::Vec3;
use multiversion::multiversion;
use rayon::prelude::*;
use std::cell::RefCell;

/// Moments of the hits of a Gaussian in a tile: lanes of `Moments::shape`.
mod moment {
    /// `Σ a·{1, u, v, u², v², uv, u r², v r²}`, r² = u² + v².
    pub(super) const A: usize = 0;
    /// `Σ h·{1, u, v}`.
    pub(super) const H: usize = 8;
    /// The two factors of each lane's power, by number: 1, u, v, r². Lanes without a moment sum h.
    pub(super) const FACTORS: [[usize; super::NUM_LANES]; 2] = [
        [0, 1, 2, 1, 2, 1, 1, 2, 0, 1, 2, 0, 0, 0, 0, 0],
        [0, 0, 0, 1, 2, 2, 3, 3, 0, 0, 0, 0, 0, 0, 0, 0],
    ];
}

#[derive(Clone, Copy, Default)]
struct Moments {
    /// `Σ w G`.
    light: Features,
    /// See [`moment`].
    shape: Features,
}

/// A Gaussian of a tile.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Row {
    /// With the normal turned towards the rays' origin.
    attributes: Attributes,
    moments: Moments,
}

/// Memory a thread reuses from tile to tile.
#[derive(Default)]
struct AdjointScratch {
    rows: Vec<Row>,
    surfels: Vec<Surfel>,
}

thread_local! {
    static SCRATCH: RefCell<AdjointScratch> = RefCell::default();
}

impl CameraRecord {
    /// Gradient of the loss with respect to every Gaussian of `set` (the set that was traced),
    /// given `d_features` = dL/dV for every pixel that the rays make, row by row. Gaussians that no
    /// ray met get zeros. The spread, size and first-hit lanes are not differentiated.
    pub fn adjoint(
        &mut self,
        set: &SurfelSet,
        d_features: &[Features],
        mask: GradientMask,
    ) -> Vec<LocalGradient> {
        let Some(rays) = &self.rays else {
            return vec![LocalGradient::default(); set.len()];
        };
        let grid = &rays.grid();
        let loss = Loss {
            set: as_seen(set, &self.seen),
            d_features: &rays.adjoint_of_means(d_features),
            mask,
        };
        self.tiles
            .par_iter_mut()
            .enumerate()
            .for_each(|(tile, record)| {
                SCRATCH.with_borrow_mut(|scratch| {
                    adjoint_of_tile(&loss, grid, tile, record, scratch);
                });
            });
        sum_rows(set.len(), &self.tiles)
    }
}

/// The loss to be differentiated.
struct Loss<'a> {
    set: SeenSet<'a>,
    d_features: &'a [Features],
    mask: GradientMask,
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn adjoint_of_tile(
    loss: &Loss<'_>,
    camera: &Camera,
    tile: usize,
    record: &mut TileRecord,
    scratch: &mut AdjointScratch,
) {
    let AdjointScratch { rows, surfels } = scratch;
    let origin = camera.ray_frame().origin.to_array();
    rows.clear();
    // Copied before anything is computed: loads that wait for nothing wait together.
    rows.extend(record.gaussians.iter().map(|&g| Row {
        attributes: loss.set.attributes[g as usize],
        moments: Moments::default(),
    }));
    surfels.clear();
    surfels.extend(
        record
            .gaussians
            .iter()
            .map(|&g| loss.set.surfels[g as usize]),
    );
    for (row, surfel) in rows.iter_mut().zip(surfels.iter()) {
        let face = Face::of_plane(surfel.seen_from(origin).plane);
        row.attributes = row.attributes.turned(face);
    }
    // The record is longer than the caches: it is read as one stream, from its end.
    for (p, pixel) in pixels_of_tile(camera, tile).rev() {
        let (hits, d_features) = (record.hits_of(p), &loss.d_features[pixel]);
        match loss.mask {
            GradientMask::LightAndMaterial => {
                for hit in hits {
                    rows[record.row_of(hit)].moments.add_light(hit, d_features);
                }
            }
            GradientMask::Everything => add_ray(rows, record, hits, d_features),
        }
    }
    record.gradients.clear();
    let gradients = rows.iter().zip(surfels.iter());
    record
        .gradients
        .extend(gradients.map(|(row, surfel)| match loss.mask {
            GradientMask::LightAndMaterial => row.moments.light_gradient(),
            GradientMask::Everything => row.moments.gradient(&surfel.seen_from(origin)),
        }));
}

/// Adds the hits of a ray, back to front.
#[inline(always)]
fn add_ray(rows: &mut [Row], record: &TileRecord, hits: &[BlendedHit], d_features: &Features) {
    let d_distance = d_features.0[lane::DISTANCE];
    // The distance is not an attribute, and the lanes behind it are not differentiated.
    let mut d_attributes = d_features.0;
    d_attributes[lane::DISTANCE..].fill(0.0);
    let mut behind = 0.0_f32;
    for hit in hits.iter().rev() {
        let row = &mut rows[record.row_of(hit)];
        let value = dot(&d_attributes, &row.attributes.0) + d_distance * hit.t;
        let difference = value - behind;
        behind += hit.alpha * difference;
        row.moments.add_light(hit, d_features);
        let a = hit.weight * difference;
        let h = hit.weight * d_distance * hit.t;
        row.moments.add_shape(hit, a, h);
    }
}

/// Sum of products, pairwise: one order on every machine, and SIMD instructions where there are
/// some.
#[inline(always)]
fn dot(a: &[f32; NUM_LANES], b: &[f32; NUM_LANES]) -> f32 {
    let mut eight = [0.0_f32; 8];
    for k in 0..8 {
        eight[k] = a[k] * b[k] + a[k + 8] * b[k + 8];
    }
    let mut four = [0.0_f32; 4];
    for k in 0..4 {
        four[k] = eight[k] + eight[k + 4];
    }
    (four[0] + four[2]) + (four[1] + four[3])
}

impl Moments {
    #[inline(always)]
    fn add_light(&mut self, hit: &BlendedHit, d_features: &Features) {
        for (sum, d) in self.light.0.iter_mut().zip(d_features.0) {
            *sum += hit.weight * d;
        }
    }

    #[inline(always)]
    fn add_shape(&mut self, hit: &BlendedHit, a: f32, h: f32) {
        let (u, v) = (hit.u, hit.v);
        let r2 = u * u + v * v;
        // Each lane is a product of three factors.
        let values = [1.0, u, v, r2];
        for k in 0..NUM_LANES {
            let of = if k < moment::H { a } else { h };
            let power = values[moment::FACTORS[0][k]] * values[moment::FACTORS[1][k]];
            self.shape.0[k] += of * power;
        }
    }

    #[inline(always)]
    fn light_gradient(&self) -> LocalGradient {
        let mut gradient = LocalGradient::default();
        let lanes = &mut gradient.0;
        let light = &self.light.0;
        lanes[grad_lane::RADIANCE..][..3].copy_from_slice(&light[lane::RADIANCE..][..3]);
        lanes[grad_lane::EMISSION] = light[lane::EMISSION];
        lanes[grad_lane::ALBEDO..][..3].copy_from_slice(&light[lane::ALBEDO..][..3]);
        gradient
    }

    /// The gradient of a Gaussian.
    #[inline(always)]
    fn gradient(&self, seen: &SeenSurfel) -> LocalGradient {
        let mut gradient = self.light_gradient();
        let [a, au, av, auu, avv, auv, aur2, avr2] =
            std::array::from_fn(|k| self.shape.0[moment::A + k]);
        let [h, hu, hv] = std::array::from_fn(|k| self.shape.0[moment::H + k]);
        let (axis_u, axis_v) = (Vec3::from(seen.axis_u), Vec3::from(seen.axis_v));
        let (scale_u, scale_v) = (1.0 / axis_u.length(), 1.0 / axis_v.length());
        let (u0, v0) = (seen.offset_u, seen.offset_v);
        // dL/dt of a hit is h/t − a (u (u + u₀) + v (v + v₀))/t, and moving the plane by dn along
        // its normal moves t by t dn / ((p − o)·n).
        let plane = (h - (auu + avv + u0 * au + v0 * av)) / seen.plane;
        let plane_u = (hu - (aur2 + u0 * auu + v0 * auv)) / seen.plane;
        let plane_v = (hv - (avr2 + u0 * auv + v0 * avv)) / seen.plane;
        // N = Σ w n, turned; its derivative along t_u and t_v turns the normal. The plane turns
        // with it: dt/dn = (p − x)/(ω·n), and p − x = −(u s_u t_u + v s_v t_v).
        let sign = Face::of_plane(seen.plane).signs()[lane::NORMAL];
        let d_normal = Vec3::from_slice(&self.light.0[lane::NORMAL..][..3]) * sign;
        let d_normal_u = scale_u * (d_normal.dot(axis_u) - plane_u);
        let d_normal_v = scale_v * (d_normal.dot(axis_v) - plane_v);
        let shape = [
            au / scale_u,
            av / scale_v,
            plane,
            auu / scale_u,
            avv / scale_v,
            // About t_u the normal moves along −t_v, about t_v along t_u, about n the two axes move
            // along each other.
            -d_normal_v,
            d_normal_u,
            auv * (scale_u / scale_v - scale_v / scale_u),
            a / seen.opacity,
        ];
        gradient.0[..grad_lane::RADIANCE].copy_from_slice(&shape);
        gradient
    }
}
