//! TransportMatrix of an earlier bake, brought up to date after an edit.
//!
//! A Gaussian is known again by the bits of its geometry. What reflects keeps the point where light
//! arrives, unless an edit has changed something between it and the camera that sees it best, or
//! another sees it better now. A direction keeps what it met, unless that is gone or something new
//! is in its way. The rest is looked for and traced. New light of the same emitters costs no ray,
//! nor do other albedos; where emitters are new or much brighter than they were, directions towards
//! emitters are chosen anew.
//!
//! The result is a sample of what a bake from nothing samples. It is the same to the bit where
//! geometry and light are what they were and only albedos differ, and random numbers are the same
//! for all Gaussians whose indices are, as long as directions towards emitters are.

mod boxes;
mod change;
mod kept;
mod rows;

use super::gaussians::{AT_ONCE, LONE};
use super::{Bake, BakeProgress, digest, emits};
use crate::error::Result;
use crate::surfaces::Seen;
use change::{Change, are_fair};
use eagpt_scene::{Camera, Gaussian, Gaussians, files};
use eagpt_trace::model::MAX_RADIUS;
use eagpt_trace::transport::lights::Lights;
use eagpt_trace::transport::matrix::known::KnownDirections;
use eagpt_trace::transport::matrix::{Directions, NOTHING, Receiver, TransportMatrix};
use eagpt_trace::{Ray, Tracer};
use glam::Vec3;
use kept::{Kept, Setup, shape};
use rayon::prelude::*;
use rows::{KeptReceiver, Places, Rows};
use std::collections::HashMap;
use std::path::Path;

/// Weights in a pixel that differ by less of themselves are those of the same ray, in a part of a
/// picture and in all of it.
const SAME_WEIGHT: f32 = 1e-3;

impl Bake<'_> {
    /// All receivers and their matrix, with what the file at `path` knows of them; it then knows
    /// these. `None` if it was stopped.
    pub(super) fn relink(
        &mut self,
        tracer: &dyn Tracer,
        directions: Directions,
        path: &Path,
    ) -> Result<Option<(Vec<Receiver>, TransportMatrix)>> {
        let earlier = self.earlier(directions, path)?;
        let change = Change::new(&earlier.shapes, &self.scene);
        let Some(places) = self.look_again(tracer, &earlier, &change)? else {
            return Ok(None);
        };
        let emitters = self.scene.iter().filter(|g| emits(g.emission));
        let emitters: Gaussians = emitters.collect();
        let fair = are_fair(&earlier.lights, &emitters);
        let looked_for = if fair {
            earlier.lights.clone()
        } else {
            emitters
        };
        let lights = Lights::new(&looked_for);
        let known = KnownDirections::new(lights.as_ref(), directions, self.key());
        let mut rows = Rows::merge(&earlier, &places, &change, fair);
        let receivers: Vec<Receiver> = (rows.receivers.iter())
            .map(|one| (one.element, one.seen.surface))
            .collect();
        if !change.added.is_empty() {
            let scene = &self.scene;
            known.forget(&receivers, &mut rows.targets, |target, ray| {
                change.added.are_crossed(ray, reach(scene, ray, target))
            });
        }
        if !self.trace_unknown(tracer, &known, &receivers, &mut rows.targets)? {
            return Ok(None);
        }
        let scene = &self.scene;
        let emitted =
            |i: u32| emits(scene.emissions[i as usize]).then(|| scene.radiances[i as usize]);
        let matrix = known.matrix(&receivers, &rows.targets, &mut rows.weights, emitted);
        let indices = rows.receivers.iter().map(|one| one.index);
        let receivers = indices.zip(receivers.iter().map(|(_, surface)| *surface));
        let receivers = receivers.collect();
        let kept = Kept {
            setup: earlier.setup,
            shapes: scene.iter().map(|g| shape(&g)).collect(),
            lights: looked_for,
            rows,
        };
        kept.write(path)?;
        Ok(Some((receivers, matrix)))
    }

    /// What the file at `path` knows of an earlier bake with the same cameras and directions.
    fn earlier(&mut self, directions: Directions, path: &Path) -> Result<Kept> {
        let cameras = files::read(self.dataset.transforms())?;
        let setup = Setup {
            cameras: digest(&cameras),
            frames: self.frames.clone(),
            directions: [directions.plain, directions.to_lights],
            seed: self.request.options.seed,
        };
        if !path.exists() {
            return Ok(Kept::nothing(setup));
        }
        let earlier = Kept::read(path)?;
        if earlier.setup == setup {
            return Ok(earlier);
        }
        let text = format!(
            "{}: matrix of other cameras, samples or seed; all are traced anew",
            path.display()
        );
        (self.progress)(BakeProgress::Warning { text });
        Ok(Kept::nothing(setup))
    }

    /// Where light arrives for all that reflects; `None` if it was stopped. Only parts of pictures
    /// are looked at: those where something has changed.
    fn look_again(
        &mut self,
        tracer: &dyn Tracer,
        earlier: &Kept,
        change: &Change,
    ) -> Result<Option<Places>> {
        let cameras = self.cameras();
        let mut known = self.known_again(earlier, change, &cameras);
        let fresh = self.without(&known);
        let fresh = fresh.iter().map(|&i| self.scene.get(i as usize));
        let doubtful: Vec<Gaussian> = fresh.chain(change.gone.iter().copied()).collect();
        let (numbers, parts): (Vec<u32>, Vec<Camera>) = (0..)
            .zip(&cameras)
            .filter_map(|(number, camera)| Some((number, boxes::part_of(camera, &doubtful)?)))
            .unzip();
        let Some(mut seen) = self.look(tracer, &parts)? else {
            return Ok(None);
        };
        for seen in seen.iter_mut().flatten() {
            seen.camera = numbers[seen.camera as usize];
        }
        // Where something is gone, others may be seen better than before.
        known.retain(|&i, row| {
            let now = seen[i as usize].map_or(0.0, |seen| seen.weight);
            now <= (1.0 + SAME_WEIGHT) * earlier.rows.receivers[*row].seen.weight
        });
        let fresh = self.places(tracer, &self.without(&known), &seen)?;
        Ok(Some(Places { known, fresh }))
    }

    /// Rows of the earlier bake that are as they were, by the index now: nothing has changed
    /// between the camera and what it saw.
    fn known_again(
        &self,
        earlier: &Kept,
        change: &Change,
        cameras: &[Camera],
    ) -> HashMap<u32, usize> {
        let origins: Vec<Vec3> = cameras.iter().map(Camera::origin).collect();
        let emissions = &self.scene.emissions;
        let is_same = |one: &KeptReceiver| {
            let Seen {
                surface, camera, ..
            } = one.seen;
            if camera == LONE {
                return !change.all.contain(surface.position);
            }
            let origin = origins[camera as usize];
            let direction = (surface.position - origin).normalize_or_zero();
            let ray = Ray::free(origin.to_array(), direction.to_array());
            let end = origin.distance(surface.position) + 2.0 * surface.offset;
            !change.all.are_crossed(&ray, end)
        };
        let rows = earlier.rows.receivers.par_iter().enumerate();
        rows.filter_map(|(row, one)| {
            let now = change.now[one.index as usize]?;
            let reflects = !emits(emissions[now as usize]);
            (reflects && is_same(one)).then_some((now, row))
        })
        .collect()
    }

    /// What reflects and is not in `places`.
    fn without(&self, places: &HashMap<u32, usize>) -> Vec<u32> {
        self.reflecting()
            .filter(|i| !places.contains_key(i))
            .collect()
    }

    /// Traces what is not known; `false` if it was stopped.
    fn trace_unknown(
        &mut self,
        tracer: &dyn Tracer,
        known: &KnownDirections<'_>,
        receivers: &[Receiver],
        targets: &mut [u32],
    ) -> Result<bool> {
        let total = receivers.len();
        let mut done = 0;
        let pieces = receivers.chunks(AT_ONCE);
        for (receivers, targets) in pieces.zip(targets.chunks_mut(AT_ONCE * known.num())) {
            if self.stopped() {
                return Ok(false);
            }
            self.num_rays += known.trace(tracer, receivers, targets)?;
            done += receivers.len();
            (self.progress)(BakeProgress::Gathering { done, total });
        }
        Ok(true)
    }
}

/// A distance at which `ray` has met `target`.
fn reach(scene: &Gaussians, ray: &Ray, target: u32) -> f32 {
    if target == NOTHING {
        return f32::INFINITY;
    }
    let i = target as usize;
    let centre = scene.positions[i] - Vec3::from_array(ray.origin);
    centre.length() + MAX_RADIUS * scene.scales[i].max_element()
}
