//! Gloss of the pixels of a camera: that of the Gaussians that they see, by their weights.

use super::CpuScene;
use super::record::CameraRecord;
use crate::blend::GlossBlend;
use crate::features::GBuffer;
use crate::view::Pixels;
use crate::weights::BlendWeights;
use eagpt_scene::Gloss;

impl CpuScene {
    /// Pixels of a camera, whose record and `features` are given, with their gloss.
    pub(super) fn pixels(&self, record: &CameraRecord, features: GBuffer) -> Pixels {
        if !self.is_glossy() {
            return Pixels::diffuse(features);
        }
        let weights = record.weights(0.0);
        Pixels {
            glosses: self.blended_gloss(&weights, &features),
            means: weights.blend(|i| self.attributes(i).radiance()),
            features,
        }
    }

    /// Blended gloss of the pixels of a camera, whose record and `features` are given; none where
    /// nothing is glossy.
    pub(super) fn gloss_of_pixels(&self, record: &CameraRecord, features: &GBuffer) -> Vec<Gloss> {
        if !self.is_glossy() {
            return Vec::new();
        }
        self.blended_gloss(&record.weights(0.0), features)
    }

    fn blended_gloss(&self, weights: &BlendWeights, features: &GBuffer) -> Vec<Gloss> {
        let of = |i: u32| GlossBlend::of(&self.surfels().gloss[i as usize]);
        let blended = weights.blend(of).into_iter().zip(&features.pixels);
        blended
            .map(|(blend, seen)| blend.finish(seen.alpha()))
            .collect()
    }
}
