//! Gaussians prepared for intersection.

use crate::attributes::Attributes;
use crate::features::lane;
use crate::model::{MIN_COSINE, OWN_COSINE, cut_radius_squared};
use crate::ray::Ray;
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// A Gaussian as the hit formula wants it: 64 bytes, the same on every engine.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Surfel {
    /// Centre, world space.
    pub position: [f32; 3],
    /// Peak opacity σ.
    pub opacity: f32,
    /// `t_u / s_u`: its dot product with an offset from the centre is u.
    pub axis_u: [f32; 3],
    /// Squared radius in standard deviations inside which hits count; negative if nowhere.
    pub cut2: f32,
    /// `t_v / s_v`.
    pub axis_v: [f32; 3],
    /// Geometric mean of the two scales, scene units.
    pub size: f32,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Keeps the layout at 64 bytes.
    pub padding: f32,
}

const _: () = assert!(size_of::<Surfel>() == 64);

/// Gaussians prepared for intersection, in the order of the scene.
#[derive(Debug, Clone, Default)]
pub struct SurfelSet {
    /// Geometry, `[n]`.
    pub surfels: Vec<Surfel>,
    /// Light and material, `[n]`; the radiance is that of all directions.
    pub attributes: Vec<Attributes>,
    /// How the radiance differs with the direction it is seen from, `[n]`; empty where none does.
    pub harmonics: Vec<Harmonics>,
    /// Specular parts of the materials, `[n]`; empty where nothing is glossy.
    pub gloss: Vec<Gloss>,
}

/// A [`SurfelSet`] as it looks from one point: attributes are those of
/// [`SurfelSet::attributes_from`] where a Gaussian can be seen from there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeenSet<'a> {
    pub(crate) surfels: &'a [Surfel],
    pub(crate) attributes: &'a [Attributes],
}

impl Surfel {
    /// Prepares one Gaussian.
    pub fn new(g: &Gaussian) -> Self {
        let frame = Mat3::from_quat(g.rotation);
        Self {
            position: g.position.to_array(),
            opacity: g.opacity,
            axis_u: (frame.x_axis / g.scale.x).to_array(),
            cut2: cut_radius_squared(g.opacity),
            axis_v: (frame.y_axis / g.scale.y).to_array(),
            size: (g.scale.x * g.scale.y).sqrt(),
            normal: frame.z_axis.to_array(),
            padding: 0.0,
        }
    }

    /// The two vectors that span the disc inside which hits count: `radius · s · t`, scene units.
    pub fn extents(&self) -> [Vec3; 2] {
        self.extents_within(self.cut2)
    }

    /// The two vectors that span the disc of `radius_squared`, in standard deviations.
    pub fn extents_within(&self, radius_squared: f32) -> [Vec3; 2] {
        let radius = radius_squared.max(0.0).sqrt();
        [self.axis_u, self.axis_v].map(|axis| {
            let axis = Vec3::from(axis);
            axis * (radius / axis.length_squared())
        })
    }

    /// The constants of the hit formula that depend on the ray's origin only.
    #[inline(always)]
    pub fn seen_from(&self, origin: [f32; 3]) -> SeenSurfel {
        let offset = [
            self.position[0] - origin[0],
            self.position[1] - origin[1],
            self.position[2] - origin[2],
        ];
        SeenSurfel {
            normal: self.normal,
            plane: dot(offset, self.normal),
            axis_u: self.axis_u,
            offset_u: dot(offset, self.axis_u),
            axis_v: self.axis_v,
            offset_v: dot(offset, self.axis_v),
            cut2: self.cut2,
            opacity: self.opacity,
        }
    }
}

/// A [`Surfel`] relative to the origin of rays.
#[derive(Debug, Clone, Copy)]
pub struct SeenSurfel {
    /// Unit normal.
    pub normal: [f32; 3],
    /// Signed distance of the plane from the origin along the normal.
    pub plane: f32,
    /// `t_u / s_u`.
    pub axis_u: [f32; 3],
    /// u of the centre as seen from the origin.
    pub offset_u: f32,
    /// `t_v / s_v`.
    pub axis_v: [f32; 3],
    /// v of the centre as seen from the origin.
    pub offset_v: f32,
    /// See [`Surfel::cut2`].
    pub cut2: f32,
    /// Peak opacity.
    pub opacity: f32,
}

/// Where a ray meets the plane of a Gaussian.
#[derive(Debug, Clone, Copy)]
pub struct PlaneHit {
    /// Distance along the ray; not finite if the ray runs in the plane.
    pub t: f32,
    /// ω·n, not turned.
    pub cosine: f32,
    /// In-plane coordinates in standard deviations.
    pub u: f32,
    /// See `u`.
    pub v: f32,
}

impl SeenSurfel {
    /// Meets the plane with a ray of unit `direction`. Written without branches so that loops over
    /// rays vectorise, and with one fixed order of operations so that every way of finding hits
    /// gives the same bits.
    #[inline(always)]
    pub fn meet(&self, direction: [f32; 3]) -> PlaneHit {
        let cosine = dot(direction, self.normal);
        let t = self.plane / cosine;
        PlaneHit {
            t,
            cosine,
            u: dot(direction, self.axis_u) * t - self.offset_u,
            v: dot(direction, self.axis_v) * t - self.offset_v,
        }
    }

    /// Whether a plane hit lies on the Gaussian, in front of the origin.
    #[inline(always)]
    pub fn counts(&self, hit: &PlaneHit) -> bool {
        let r2 = hit.u * hit.u + hit.v * hit.v;
        // Not short-circuit: comparisons with the NaN of a degenerate plane are false, and no
        // branch is needed.
        (r2 <= self.cut2) & (hit.t > 0.0) & (hit.cosine.abs() > MIN_COSINE)
    }

    /// Whether a hit is on the very surface that `ray` leaves from: near its start, on a Gaussian
    /// that lies along that surface. A wall that meets the surface at an angle is not its own,
    /// however near.
    #[inline(always)]
    pub fn is_own(&self, hit: &PlaneHit, ray: &Ray) -> bool {
        (hit.t <= ray.t_min) & (dot(self.normal, ray.own_normal).abs() > OWN_COSINE)
    }
}

impl SurfelSet {
    /// Prepares all Gaussians.
    pub fn new(gaussians: &Gaussians) -> Self {
        let mut set = Self::default();
        set.update(gaussians);
        set
    }

    /// Prepares all Gaussians again, reusing the memory.
    pub fn update(&mut self, gaussians: &Gaussians) {
        (0..gaussians.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let g = gaussians.get(i);
                (Surfel::new(&g), Attributes::new(&g))
            })
            .unzip_into_vecs(&mut self.surfels, &mut self.attributes);
        let harmonics = gaussians.harmonics.par_iter().with_min_len(1024);
        harmonics.copied().collect_into_vec(&mut self.harmonics);
        self.gloss.clear();
        if gaussians.is_glossy() {
            self.gloss.extend_from_slice(&gaussians.gloss);
        }
    }

    /// Light and material of a Gaussian as it looks from `eye`.
    #[inline]
    pub(crate) fn attributes_from(&self, index: u32, eye: Vec3) -> Attributes {
        let i = index as usize;
        let mut seen = self.attributes[i];
        if let Some(harmonics) = self.harmonics.get(i) {
            let position = self.surfels[i].position.into();
            let radiance = harmonics.seen(seen.radiance(), position, eye);
            seen.0[lane::RADIANCE..][..3].copy_from_slice(&radiance.to_array());
        }
        seen
    }

    /// Replaces the albedos alone, `[n]`.
    pub fn set_albedos(&mut self, albedos: &[Vec3]) {
        for (attributes, albedo) in self.attributes.iter_mut().zip(albedos) {
            attributes.0[lane::ALBEDO..][..3].copy_from_slice(&albedo.to_array());
        }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.surfels.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.surfels.is_empty()
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `exp(x)` for −80 ≤ x ≤ 0, within 2 units in the last place; basic arithmetic, so that it
/// vectorises and gives the same bits on every machine (a libm does neither).
#[inline(always)]
pub(crate) fn exp_of_negative(x: f32) -> f32 {
    // Adding 1.5·2²³ rounds to the nearest integer; its low mantissa bits are that integer.
    const ROUNDER: f32 = 12_582_912.0;
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let shifted = x * std::f32::consts::LOG2_E + ROUNDER;
    let n = shifted - ROUNDER;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    // Taylor series to degree 7 on |r| ≤ ln(2)/2: the next term is below 6e-9.
    let p = 1.0 / 5040.0;
    let p = p * r + 1.0 / 720.0;
    let p = p * r + 1.0 / 120.0;
    let p = p * r + 1.0 / 24.0;
    let p = p * r + 1.0 / 6.0;
    let p = p * r + 0.5;
    let p = p * r + 1.0;
    let p = p * r + 1.0;
    let exponent = shifted
        .to_bits()
        .wrapping_sub(ROUNDER.to_bits())
        .wrapping_add(127)
        << 23;
    p * f32::from_bits(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_is_accurate_to_two_ulps() {
        for i in 0..=100_000 {
            let x = -80.0 * i as f32 / 100_000.0;
            let exact = f64::from(x).exp();
            let relative = (f64::from(exp_of_negative(x)) - exact).abs() / exact;
            assert!(
                relative < 2.0 * f64::from(f32::EPSILON),
                "exp({x}) off by {relative:e}"
            );
        }
        assert_eq!(exp_of_negative(0.0), 1.0);
    }
}
