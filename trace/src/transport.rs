//! Light transport (EAG-PT, sections 3.3 and 3.4): camera rays are blended, others take one hit
//! unless told otherwise.
//!
//! - `0-bounce`: the blended radiance R itself.
//! - `1-bounce`: emitters (E > τ_E) show R; any other point shows P/π · ∫ R(ω) (ω·Ñ) dω, the
//!   incident light being the radiance that the Gaussians already carry (a radiance cache).
//! - `gather`: 0-bounce, where glossy surfaces mirror the radiance that the Gaussians carry.
//! - `path`: only emitters carry light; paths bounce in cosine-weighted directions until they meet
//!   one.
//!
//! That is for diffuse surfaces. Where a scene is glossy, P/π is a BSDF ([`bsdf`]), directions come
//! from both of its lobes, and `1-bounce` shows in a mirror what the Gaussians there carry.
//!
//! Directions are cosine-weighted, as in the paper, or emitters are sampled as well ([`Sampling`]);
//! the mean is the same.

pub mod bsdf;
pub mod glossy;
pub mod light_list;
pub mod lights;
pub mod matrix;
pub mod points;
pub mod sampling;
pub mod start;
pub(crate) mod vertex;

use serde::{Deserialize, Serialize};

/// Emission above which a blended hit counts as an emitter, τ_E of the paper.
pub use eagpt_scene::lamps::EMISSION_THRESHOLD;

/// Maximum path depth unless told otherwise, of paths and of bakes. In a room of white walls a
/// tenth of the light comes after seven bounces, the depth of the paper.
pub const MAX_BOUNCES: u32 = 16;
/// First bounce at which paths may end at random unless told otherwise. On the CPU what is expected
/// of the rest of a path stands in for it, so that the first is not too early.
pub const ROULETTE_FROM: u32 = 1;

/// Integrator of a frame. The names are those of the paper's tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "mode")]
pub enum Integrator {
    /// The scene's own radiance, seen in mirrors, too.
    #[serde(rename = "0-bounce")]
    ZeroBounce,
    /// One bounce into the scene's own radiance.
    #[serde(rename = "1-bounce")]
    OneBounce {
        /// Samples per pixel, at least 1.
        num_samples: u32,
    },
    /// The scene's own radiance, of glossy surfaces its diffuse part, and one bounce of their
    /// specular lobe into it. Without gloss the same as [`Self::ZeroBounce`].
    #[serde(rename = "gather")]
    Gather {
        /// Samples per pixel of a glossy surface, at least 1.
        num_samples: u32,
    },
    /// Multi-bounce path tracing from the emitters alone.
    #[serde(rename = "path")]
    Path {
        /// Samples per pixel, at least 1.
        num_samples: u32,
        /// Maximum path depth, at least 1; 7 in the paper.
        max_bounces: u32,
        /// First bounce at which a path may be ended at random (survivors are weighted up, so the
        /// mean stays), on devices the third at the earliest; `None`: never.
        roulette_from: Option<u32>,
    },
}

impl Integrator {
    /// Whether diffuse surfaces show the radiance that they carry.
    pub fn shows_own_radiance(&self) -> bool {
        matches!(self, Self::ZeroBounce | Self::Gather { .. })
    }
}

/// Options of all integrators.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LightOptions {
    /// Seed of the random numbers.
    pub seed: u64,
    /// τ_E, 0 to 1.
    pub emission_threshold: f32,
    /// Light sampling.
    pub sampling: Sampling,
    /// Hits of the rays of a path. A single bounce is linear in the radiance it meets, and always
    /// samples one hit.
    pub hits: Hits,
}

/// The surface of a ray that meets several Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Hits {
    /// The blend of all is one surface, as in the paper. Slower by far, and light comes to one to
    /// two percent more in a room
    ///
    /// Where a ray meets the edge of a thing and what is behind it, the mean of their places lies
    /// in mid-air, where light comes from everywhere.
    Blended,
    /// One of them, chosen by its weight, stands for all
    Sampled,
}

/// Light sampling. The noise differs, the mean does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Sampling {
    /// Cosine-weighted BSDF sampling only, as in the paper
    Cosine,
    /// Towards emitters as well, with multiple importance sampling
    ///
    /// Next-event estimation at every bounce of a path, and half of the directions of a single
    /// bounce.
    NextEvent,
}

/// Share of a single bounce's directions that go to emitters: no direction's weight exceeds 2.
pub(crate) const LIGHT_SHARE: f32 = 0.5;

impl Default for LightOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            emission_threshold: EMISSION_THRESHOLD,
            sampling: Sampling::NextEvent,
            hits: Hits::Sampled,
        }
    }
}
