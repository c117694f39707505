//! The traced part of a bake, kept on disk: receivers and their rows of the transport matrix.
//!
//! One rule says what a file is good for. Rays depend on the geometry (positions, scales,
//! rotations, opacities), on which Gaussians emit, and on cameras, samples and seed. As long as all
//! of these are the same to the bit, the rays are; everything else is traced anew. Albedos are not
//! among them, nor is the light of emitters: new light of the same emitters is weighted as light of
//! those that directions were chosen for ([`TransportMatrix::relight`]). Light samples are shared
//! among emitters by the light they give, so that an emitter that has become much brighter beside
//! others would be sampled too little: then, too, all is traced anew.
//!
//! The same file holds a bake under way, with the rows done so far.

mod file;

use super::bright::BrightSurfaces;
use super::receivers::Receivers;
use eagpt_scene::files::Key;
use eagpt_scene::lamps::emits;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Gaussian, Gaussians, LightGroups};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::light_list::LightList;
use eagpt_trace::transport::lights;
use eagpt_trace::transport::matrix::{Directions, Groups, Tracing, TransportMatrix};
use glam::Vec3;

/// Light samples are kept as long as no emitter has more than this times the share of the light
/// that it had when they were chosen. The noise that it adds is at most that of as many times fewer
/// samples.
const MAX_UNDERRATED: f64 = 4.0;

/// Radiance and emission of an emitter.
type EmitterLight = [f32; 4];

/// Receivers, and as many rows of their matrix as are traced.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TracedTransport {
    /// Everything that decides rays: parts "geometry", "cameras", "samples" and "seed".
    pub(super) key: Key,
    directions: Directions,
    /// Light of the emitters that light samples were chosen for, in the order of their indices.
    lights: Vec<EmitterLight>,
    pub(super) receivers: Receivers,
    pub(super) matrix: TransportMatrix,
    /// Samples to what is bright, once all rows are there.
    pub(super) bright: Option<BrightSurfaces>,
}

impl TracedTransport {
    /// Nothing traced yet for `receivers` of `scene`.
    pub(super) fn new(
        key: Key,
        directions: Directions,
        scene: &Gaussians,
        receivers: Receivers,
    ) -> Self {
        Self {
            key,
            directions,
            lights: emitters(scene).map(|g| light(&g)).collect(),
            receivers,
            matrix: TransportMatrix::default(),
            bright: None,
        }
    }

    pub(super) fn num_rows(&self) -> usize {
        self.matrix.direct.len()
    }

    /// True if light samples suit the light of the emitters of `scene`, whose geometry is the same.
    pub(super) fn suits(&self, scene: &Gaussians) -> bool {
        let now: Vec<f64> = emitters(scene).map(|g| lights::power(&g)).collect();
        let then: Vec<f64> = self.sampled(scene).map(|g| lights::power(&g)).collect();
        let (total_now, total_then) = (now.iter().sum::<f64>(), then.iter().sum::<f64>());
        (now.iter().zip(&then))
            .all(|(now, then)| now / total_now <= MAX_UNDERRATED * (then / total_then))
    }

    /// True if the rows may be given the light of the emitters of `scene`, whose geometry is the
    /// same. Rows that are not all there are only for the light that they were begun with.
    pub(super) fn serves(&self, scene: &Gaussians) -> bool {
        let is_whole = self.num_rows() == self.receivers.traced.len();
        self.has_light_of(scene) || (is_whole && self.suits(scene))
    }

    /// Gives the rows, all of which are there with the light that they were traced with by random
    /// numbers of `key`, that of the emitters of `scene`.
    pub(super) fn relight(&mut self, scene: &Gaussians, key: RandomKey) {
        if self.has_light_of(scene) {
            return;
        }
        let lights = self.sampled_lights(scene);
        let tracing = Tracing {
            receivers: &self.receivers.traced,
            directions: self.directions,
            key,
            lights: lights.as_ref(),
        };
        self.matrix.relight(&tracing, &scene.radiances);
    }

    /// True if light samples were chosen for the light of `scene`.
    fn has_light_of(&self, scene: &Gaussians) -> bool {
        let now = emitters(scene).map(|g| light(&g));
        now.eq(self.lights.iter().copied())
    }

    /// The direct light of all rows, traced with random numbers of `key`, by lights:
    /// `[receivers, lights]`.
    pub(super) fn direct_of(
        &self,
        scene: &Gaussians,
        key: RandomKey,
        lights: &LightGroups,
    ) -> Vec<Vec3> {
        let sampled = self.sampled_lights(scene);
        let tracing = Tracing {
            receivers: &self.receivers.traced,
            directions: self.directions,
            key,
            lights: sampled.as_ref(),
        };
        let groups = Groups {
            num: lights.names.len(),
            of: &lights.of,
        };
        self.matrix
            .direct_of_groups(&tracing, &scene.radiances, groups)
    }

    /// The lights that light samples were chosen from.
    fn sampled_lights(&self, scene: &Gaussians) -> Option<LightList> {
        let mut sampled = scene.clone();
        let emitting = (0..scene.len()).filter(|&i| emits(scene.emissions[i]));
        for (i, g) in emitting.zip(self.sampled(scene)) {
            (sampled.radiances[i], sampled.emissions[i]) = (g.radiance, g.emission);
        }
        LightList::new(&SurfelSet::new(&sampled))
    }

    /// The emitters of `scene` with the light that light samples were chosen for.
    fn sampled(&self, scene: &Gaussians) -> impl Iterator<Item = Gaussian> {
        emitters(scene)
            .zip(&self.lights)
            .map(|(g, &[r, green, b, emission])| Gaussian {
                radiance: Vec3::new(r, green, b),
                emission,
                ..g
            })
    }
}

fn emitters(scene: &Gaussians) -> impl Iterator<Item = Gaussian> {
    scene.iter().filter(|g| emits(g.emission))
}

fn light(g: &Gaussian) -> EmitterLight {
    let [r, green, b] = g.radiance.to_array();
    [r, green, b, g.emission]
}
