//! Light that glossy surfaces mirror: questions and answers.

use crate::transport::start::Surface;
use eagpt_scene::Gloss;
use glam::Vec3;

/// Light that a specular lobe adds to the diffuse part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mirrored {
    /// Light that the lobe reflects towards the eye, linear Rec.709, premultiplied.
    pub light: Vec3,
    /// E(μ): of light from everywhere, what the lobe reflects towards the eye. Of the rest the
    /// albedo is scattered.
    pub reflectance: Vec3,
}

/// A point of a glossy surface, and who looks at it.
#[derive(Debug, Clone, PartialEq)]
pub struct GlossyPoint {
    /// Where it is.
    pub surface: Surface,
    /// Its gloss.
    pub gloss: Gloss,
    /// Places of eyes above the surface, world space.
    pub eyes: Vec<Vec3>,
}

impl GlossyPoint {
    /// Unit vectors to the eyes.
    pub fn to_eyes(&self) -> impl Iterator<Item = Vec3> {
        let to_eye = |eye: &Vec3| (*eye - self.surface.position).normalize_or_zero();
        self.eyes.iter().map(to_eye)
    }
}
