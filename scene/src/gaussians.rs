//! 2D Gaussians as struct of arrays, with activated (physical) values.

use crate::gloss::Gloss;
use crate::harmonics::Harmonics;
use crate::rng::{Purpose, RandomKey};
use glam::{Mat3, Quat, Vec2, Vec3};

/// Largest albedo of a Gaussian. A surface reflects no more than it receives; of the Gaussians that
/// a pixel blends some are brighter than the surface and some darker, where its texture is finer
/// than they are, and their blend is its albedo.
pub const MAX_ALBEDO: f32 = 4.0;

/// One 2D Gaussian: a flat, elliptical surface element that carries light and material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian {
    /// Centre, world space, scene units.
    pub position: Vec3,
    /// Standard deviations along the in-plane axes `t_u`, `t_v`; scene units, positive.
    pub scale: Vec2,
    /// Unit quaternion whose matrix has the columns `t_u`, `t_v`, normal.
    pub rotation: Quat,
    /// Peak opacity, 0 to 1.
    pub opacity: f32,
    /// Outgoing radiance, linear Rec.709, not negative.
    pub radiance: Vec3,
    /// Dependence of the radiance on the viewing direction.
    pub harmonics: Harmonics,
    /// Emission score, 0 (reflects) to 1 (emits).
    pub emission: f32,
    /// Diffuse albedo, linear Rec.709, 0 to [`MAX_ALBEDO`].
    pub albedo: Vec3,
    /// Specular part of the material.
    pub gloss: Gloss,
}

/// A set of [`Gaussian`]s; every array has the same length, but for `harmonics` and `gloss`,
/// which may be empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gaussians {
    /// Centres, `[n]`, world space, scene units.
    pub positions: Vec<Vec3>,
    /// In-plane standard deviations, `[n]`, scene units.
    pub scales: Vec<Vec2>,
    /// Unit quaternions, `[n]`.
    pub rotations: Vec<Quat>,
    /// Peak opacities, `[n]`, 0 to 1.
    pub opacities: Vec<f32>,
    /// Linear radiances, `[n]`.
    pub radiances: Vec<Vec3>,
    /// Dependence of the radiances on the direction, `[n]`; empty where none does.
    pub harmonics: Vec<Harmonics>,
    /// Emission scores, `[n]`, 0 to 1.
    pub emissions: Vec<f32>,
    /// Diffuse albedos, `[n]`, 0 to [`MAX_ALBEDO`].
    pub albedos: Vec<Vec3>,
    /// Specular parts of the materials, `[n]`; empty where nothing is glossy.
    pub gloss: Vec<Gloss>,
}

impl Gaussians {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// An empty set with capacity for this many Gaussians.
    pub fn with_capacity(capacity: usize) -> Self {
        Self {
            positions: Vec::with_capacity(capacity),
            scales: Vec::with_capacity(capacity),
            rotations: Vec::with_capacity(capacity),
            opacities: Vec::with_capacity(capacity),
            radiances: Vec::with_capacity(capacity),
            harmonics: Vec::new(),
            emissions: Vec::with_capacity(capacity),
            albedos: Vec::with_capacity(capacity),
            gloss: Vec::new(),
        }
    }

    /// Appends one Gaussian.
    pub fn push(&mut self, g: Gaussian) {
        if !self.harmonics.is_empty() || g.harmonics != Harmonics::NONE {
            self.harmonics.resize(self.len(), Harmonics::NONE);
            self.harmonics.push(g.harmonics);
        }
        if !self.gloss.is_empty() || g.gloss != Gloss::NONE {
            self.gloss.resize(self.len(), Gloss::NONE);
            self.gloss.push(g.gloss);
        }
        self.positions.push(g.position);
        self.scales.push(g.scale);
        self.rotations.push(g.rotation);
        self.opacities.push(g.opacity);
        self.radiances.push(g.radiance);
        self.emissions.push(g.emission);
        self.albedos.push(g.albedo);
    }

    /// Replaces the Gaussian at `index`.
    ///
    /// # Panics
    /// If `index` is not below [`Self::len`].
    pub fn set(&mut self, index: usize, g: &Gaussian) {
        self.positions[index] = g.position;
        self.scales[index] = g.scale;
        self.rotations[index] = g.rotation;
        self.opacities[index] = g.opacity;
        self.radiances[index] = g.radiance;
        self.emissions[index] = g.emission;
        self.albedos[index] = g.albedo;
        if !self.harmonics.is_empty() || g.harmonics != Harmonics::NONE {
            self.harmonics.resize(self.len(), Harmonics::NONE);
            self.harmonics[index] = g.harmonics;
        }
        if !self.gloss.is_empty() || g.gloss != Gloss::NONE {
            self.gloss.resize(self.len(), Gloss::NONE);
            self.gloss[index] = g.gloss;
        }
    }

    /// The Gaussian at `index`.
    ///
    /// # Panics
    /// If `index` is not below [`Self::len`].
    #[inline]
    pub fn get(&self, index: usize) -> Gaussian {
        Gaussian {
            position: self.positions[index],
            scale: self.scales[index],
            rotation: self.rotations[index],
            opacity: self.opacities[index],
            radiance: self.radiances[index],
            harmonics: self.harmonics.get(index).copied().unwrap_or_default(),
            emission: self.emissions[index],
            albedo: self.albedos[index],
            gloss: self.gloss_of(index),
        }
    }

    /// Unit normal of the Gaussian at `index`: the third axis of its frame.
    pub fn normal_of(&self, index: usize) -> Vec3 {
        Mat3::from_quat(self.rotations[index]).z_axis
    }

    /// Size of the Gaussian at `index`, the geometric mean of its scales, scene units.
    pub fn size_of(&self, index: usize) -> f32 {
        let scale = self.scales[index];
        (scale.x * scale.y).sqrt()
    }

    /// Specular part of the material of the Gaussian at `index`.
    pub fn gloss_of(&self, index: usize) -> Gloss {
        self.gloss.get(index).copied().unwrap_or_default()
    }

    /// Whether any Gaussian mirrors light.
    pub fn is_glossy(&self) -> bool {
        self.gloss.iter().any(Gloss::is_some)
    }

    /// Radiance of the Gaussian at `index` as it is seen from `eye`.
    ///
    /// # Panics
    /// If `index` is not below [`Self::len`].
    pub fn seen_radiance(&self, index: usize, eye: Vec3) -> Vec3 {
        let radiance = self.radiances[index];
        self.harmonics.get(index).map_or(radiance, |harmonics| {
            harmonics.seen(radiance, self.positions[index], eye)
        })
    }

    /// All Gaussians in order, by value.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Gaussian> + '_ {
        (0..self.len()).map(|index| self.get(index))
    }

    /// Axis-aligned bounds of the centres, or `None` for an empty set.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = *self.positions.first()?;
        Some(
            self.positions
                .iter()
                .fold((first, first), |(low, high), &p| (low.min(p), high.max(p))),
        )
    }
}

impl FromIterator<Gaussian> for Gaussians {
    fn from_iter<I: IntoIterator<Item = Gaussian>>(iter: I) -> Self {
        let iter = iter.into_iter();
        let mut set = Self::with_capacity(iter.size_hint().0);
        for gaussian in iter {
            set.push(gaussian);
        }
        set
    }
}

/// Random Gaussians in a box around the origin, of all orientations, elongations and opacities:
/// what engines are compared on.
pub fn random_cloud(num: usize, seed: u64) -> Gaussians {
    let key = RandomKey::new(seed, Purpose::Initialise, 0);
    (0..num as u32)
        .map(|i| {
            let mut stream = key.stream(i, 0);
            let mut next = || stream.next_uniforms();
            let ([a, b, c, d], [e, f, g, h], [k, l, m, n], [o, p, q, r]) =
                (next(), next(), next(), next());
            Gaussian {
                position: Vec3::new(a - 0.5, b - 0.5, c - 0.5) * 2.0,
                scale: Vec2::new(0.02 + 0.2 * d * d, 0.02 + 0.2 * e * e),
                rotation: Quat::from_xyzw(f - 0.5, g - 0.5, h - 0.5, k - 0.5 + 1e-3).normalize(),
                opacity: 0.02 + 0.979 * l,
                radiance: Vec3::new(m, n, o) * 4.0,
                harmonics: Harmonics::NONE,
                gloss: Gloss::NONE,
                emission: p,
                albedo: Vec3::new(q, r, a),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_are_there_for_all_or_none() {
        let mut set = random_cloud(3, 1);
        assert!(set.harmonics.is_empty());
        let mut turned = set.get(1);
        turned.harmonics.0[4] = 0.5;
        set.push(turned);
        assert_eq!(set.harmonics.len(), 4);
        assert_eq!(
            (set.get(3), set.get(0).harmonics),
            (turned, Harmonics::NONE)
        );
        set.push(set.get(0));
        assert_eq!(set.harmonics.len(), 5);
        let mut plain = random_cloud(3, 1);
        plain.set(2, &plain.get(1));
        assert!(plain.harmonics.is_empty());
        plain.set(2, &turned);
        assert_eq!((plain.get(2), plain.harmonics.len()), (turned, 3));
        let kept: Gaussians = plain.iter().take(2).collect();
        assert_eq!(kept, random_cloud(2, 1));
    }
}
