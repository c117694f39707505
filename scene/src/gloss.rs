//! Light that a surface mirrors beside what it scatters: the specular part of a material.
//!
//! A lobe of microfacets (GGX, Walter et al. 2007) of one roughness, whose facets reflect by
//! Schlick's approximation of Fresnel's formula. The lobe itself is `eagpt_trace::transport::bsdf`;
//! these are its numbers.

use glam::Vec3;

/// The specular part of a material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gloss {
    /// F0: what facets reflect of light that meets them head-on, linear Rec.709, 0 to 1. Some 0.04
    /// for varnish and plastic, coloured and above 0.5 for metals; 0 for surfaces without gloss.
    pub specular: Vec3,
    /// Perceptual roughness, 0 (mirror) to 1; its square is GGX's α.
    pub roughness: f32,
}

impl Gloss {
    /// A diffuse surface.
    pub const NONE: Self = Self {
        specular: Vec3::ZERO,
        roughness: 1.0,
    };

    /// Surfaces of less roughness, most of whose light is mirrored, show an image of the scene …
    pub const MIRROR_ROUGHNESS: f32 = 0.2;
    /// … as all do with more F0.
    const MIRROR_SPECULAR: f32 = 0.5;

    /// Whether anything is mirrored.
    #[inline]
    pub fn is_some(&self) -> bool {
        self.specular != Vec3::ZERO
    }

    /// Whether it is a mirror, or polished metal.
    #[inline]
    pub fn is_mirror(&self) -> bool {
        self.roughness < Self::MIRROR_ROUGHNESS
            && self.specular.max_element() > Self::MIRROR_SPECULAR
    }
}

impl Default for Gloss {
    fn default() -> Self {
        Self::NONE
    }
}
