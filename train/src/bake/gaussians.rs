//! Light baking in Gaussian space.
//!
//! The light of a scene of diffuse surfaces solves `L = L_e + ρ/π ∫ L cos θ dω`. Its Neumann series
//! is light sorted by bounces, `L = L_e + T L_e + T² L_e + …` (Kajiya 1986, section 3), and here
//! every term is kept on the Gaussians. Rays are traced once: they give the light of emitters that
//! reaches each Gaussian, and which other Gaussians it sees ([`eagpt_trace::transport::matrix`]).
//! That is the first term, and the matrix T of all further ones: a bounce more is a product of it
//! with a vector. After b bounces the scene carries the light of paths of at most b bounces.
//!
//! Glossy surfaces send on what a diffuse surface of the same reflectance would: their energy is
//! kept, the direction of what they mirror is not. Cameras see it by harmonics
//! (`super::highlights`).
//!
//! Light is linear in the lamps. Where the light of each is asked for, it goes through the same
//! matrix and is smoothed by the weights of all light together: what Gaussians reflect of single
//! lamps adds up to what they reflect ([`eagpt_scene::light_basis`]).

use super::bright::{self, BrightSurfaces};
use super::emitters::with_emitters;
use super::highlights::Highlights;
use super::lamps::evened;
use super::receivers::Receivers;
use super::request::Bake;
use super::series::{DirectParts, Exchange, sum_of_bounces};
use super::transport::TracedTransport;
use super::unlit::Unlit;
use crate::error::{Result, TrainError};
use crate::progress::BakeProgress;
use eagpt_light::irradiance::{self, PIECE};
use eagpt_scene::files::{Key, digest};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_scene::lamps::read_lamps;
use eagpt_scene::light_basis::geometry_digest;
use eagpt_scene::machine::available_memory;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, Harmonics, LightBasis, LightGroups, SceneError};
use eagpt_trace::Tracer;
use eagpt_trace::transport::bsdf::equivalent_albedos;
use eagpt_trace::transport::matrix::Directions;
use glam::Vec3;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

pub use super::request::GaussianBake;

/// Time between two states on disk.
const STORE_EVERY: Duration = Duration::from_secs(30);

/// A solution.
pub(super) struct Solved {
    /// Of all Gaussians, `[n]`.
    pub(super) radiances: Vec<Vec3>,
    /// Reflected light of each lamp.
    pub(super) basis: Option<LightBasis>,
    /// Harmonics of all Gaussians, `[n]`, or none.
    pub(super) harmonics: Vec<Harmonics>,
}

/// File of the traced rows in the work folder.
pub(super) const STATE: &str = "transport.state";

impl Bake<'_> {
    /// Radiances of all Gaussians, and the basis of their light if that is asked for; `None` if it
    /// was stopped from outside.
    pub(super) fn solve(&mut self, method: GaussianBake) -> Result<Option<Solved>> {
        let is_per_light = self.request.per_light.is_some();
        let directions = irradiance::directions(method.number(self.scene.len(), is_per_light));
        let lights = match &self.request.per_light {
            Some(lamps) => Some(self.lights(lamps)?),
            None => None,
        };
        let num_lights = lights.as_ref().map_or(0, |lights| lights.names.len());
        self.check_memory(directions, num_lights)?;
        let evened = lights.as_ref().map(|lights| evened(&self.scene, lights));
        let evened = evened.as_ref();
        let mut tracer = (self.request.device).scene(evened.unwrap_or(&self.scene))?;
        let Some(mut traced) = self.trace(&mut *tracer, evened, directions)? else {
            return Ok(None);
        };
        if let Some(bright) = traced.bright.take() {
            let random = (directions, self.key(), self.request.options.seed);
            bright.add_to(&mut traced.matrix, &self.scene, &traced.receivers, random);
        }
        traced.relight(&self.scene, self.key());
        let light = Exchange::new(&traced.receivers, &traced.matrix, directions);
        let max_bounces = self.request.options.max_bounces;
        let parts = lights.as_ref().map(|lights| DirectParts {
            num: num_lights,
            direct: traced.direct_of(&self.scene, self.key(), lights),
        });
        let albedos = &equivalent_albedos(&self.scene);
        let told = &mut self.progress;
        let mut reflected = sum_of_bounces(albedos, &light, max_bounces, parts.as_ref(), told);
        let mut basis = None;
        if let Some(lights) = &lights {
            let unlit = Unlit {
                tracer: &*tracer,
                sampled: evened.unwrap_or(&self.scene),
                lights,
                cameras: &self.cameras(),
                fronts: &traced.receivers.fronts,
                directions,
                key: self.key(),
            };
            self.num_rays += unlit.add(&self.scene, albedos, &mut reflected.parts)?;
            basis = Some(LightBasis::new(&self.scene, lights, &reflected.parts));
        }
        let radiances = with_emitters(&self.scene, &reflected.total);
        self.scene.radiances.clone_from(&radiances);
        let (cameras, seed) = (self.cameras(), self.request.options.seed);
        let highlights = Highlights::new(&self.scene, &traced.receivers, &cameras, seed);
        let mut harmonics = self.scene.harmonics.clone();
        if let Some(highlights) = highlights {
            harmonics = highlights.harmonics(&self.scene, &mut *tracer)?;
            if let Some(plain) = basis.take() {
                basis = Some(highlights.of_lights(plain, &self.scene, &mut *tracer)?);
            }
        }
        Ok(Some(Solved {
            radiances,
            basis,
            harmonics,
        }))
    }

    /// Emitters, by the lamps of a file.
    fn lights(&self, lamps: &Path) -> Result<LightGroups> {
        let list = read_lamps(lamps)?;
        let groups = LightGroups::new(&self.scene, &list);
        Ok(groups.map_err(|problem| SceneError::invalid(lamps, "name", problem))?)
    }

    fn check_memory(&self, directions: Directions, num_lights: usize) -> Result<()> {
        // Beside the entries, a copy and the bytes of a file that is written.
        let copies = if self.request.transport.is_some() {
            3
        } else {
            1
        };
        let entries = directions.bsdf + directions.to_lights + bright::num_samples(directions);
        let entries = u64::from(entries);
        // Of each light: its direct light, that of a bounce before and after smoothing, that of the
        // last bounce and of all.
        let of_lights = 5 * size_of::<Vec3>() as u64 * num_lights as u64;
        // Half floats.
        let of_highlights = 2 * NUM_COEFFICIENTS as u64 * num_lights as u64;
        let num_glossy = self.scene.gloss.iter().filter(|g| g.is_some()).count() as u64;
        let needed = self.scene.len() as u64 * (copies * entries * 4 + of_lights)
            + num_glossy * of_highlights;
        match available_memory() {
            Some(available) if needed > available / 2 => Err(TrainError::Memory {
                needed_mib: needed >> 20,
                available_mib: available >> 21,
                advice: "fewer directions (--samples) would help".to_owned(),
            }),
            _ => Ok(()),
        }
    }

    /// All rows of the transport matrix, traced here or in an earlier process; `None` if it was
    /// stopped. `evened` is the scene with the light that light samples are chosen by, which
    /// `tracer` traces, if that is not its own.
    fn trace(
        &mut self,
        tracer: &mut dyn Tracer,
        evened: Option<&Gaussians>,
        directions: Directions,
    ) -> Result<Option<TracedTransport>> {
        let path = match &self.request.transport {
            Some(path) => path.clone(),
            None => self.request.work.join(STATE),
        };
        let cameras = (
            digest::of_file(self.dataset.transforms())?,
            self.frames.clone(),
        );
        let key = Key::new()
            .with("geometry", geometry_digest(&self.scene))
            .with_value("cameras", &cameras)?
            .with_value("samples", &[directions.bsdf, directions.to_lights])?
            .with_value("seed", &self.request.options.seed)?;
        let traced = match self.traced_before(&path, &key, evened)? {
            Some(traced) => traced,
            None => match self.find_receivers(tracer)? {
                Some(receivers) => {
                    let sampled = evened.unwrap_or(&self.scene);
                    TracedTransport::new(key, directions, sampled, receivers)
                }
                None => return Ok(None),
            },
        };
        let Some(mut traced) = self.trace_rows(tracer, traced, directions, &path)? else {
            return Ok(None);
        };
        if traced.bright.is_some() {
            return Ok(Some(traced));
        }
        let is_whole = self.trace_bright((tracer, evened), &mut traced, directions);
        if self.request.transport.is_some() || !matches!(is_whole, Ok(true)) {
            traced.write(&path)?;
        }
        Ok(is_whole?.then_some(traced))
    }

    /// Traces light samples to what is bright where all rows are traced; `false` if it was stopped.
    fn trace_bright(
        &mut self,
        (tracer, evened): (&mut dyn Tracer, Option<&Gaussians>),
        traced: &mut TracedTransport,
        directions: Directions,
    ) -> Result<bool> {
        let (receivers, direct) = (&traced.receivers, &traced.matrix.direct);
        let mut bright = BrightSurfaces::new(&self.scene, receivers, direct);
        let total = receivers.traced.len();
        let stop = &self.request.stop;
        let mut goes_on = |done| {
            (self.progress)(BakeProgress::Gathering { done, total });
            done == total || !stop.load(Ordering::Relaxed)
        };
        let random = (directions, self.request.options.seed);
        let among = (tracer, evened.unwrap_or(&self.scene));
        let is_whole = bright.trace(among, &receivers.traced, random, &mut goes_on)?;
        if is_whole {
            self.num_rays += bright.num_rays;
            traced.bright = Some(bright);
        }
        Ok(is_whole)
    }

    /// Rows that an earlier bake has left at `path`, if they are of use for this one: for the light
    /// of the scene, and for that which light samples would be chosen by.
    fn traced_before(
        &mut self,
        path: &Path,
        key: &Key,
        evened: Option<&Gaussians>,
    ) -> Result<Option<TracedTransport>> {
        if !path.exists() {
            return Ok(None);
        }
        let traced = TracedTransport::read(path)?;
        let serves = traced.serves(evened.unwrap_or(&self.scene));
        let problem = if traced.key != *key {
            format!("rays of {}", traced.key.differences_in_words(key))
        } else if !traced.fits(&self.scene) {
            return Err(SceneError::invalid(path, "entries", "the file is damaged").into());
        } else if serves && evened.is_none_or(|_| traced.suits(&self.scene)) {
            return Ok(Some(traced));
        } else {
            "light samples of emitters with another light".to_owned()
        };
        let text = format!("{}: {problem}: all are traced anew", path.display());
        (self.progress)(BakeProgress::Warning { text });
        Ok(None)
    }

    /// Traces the rows that are not in `traced`, piece by piece; `None` if it was stopped.
    fn trace_rows(
        &mut self,
        tracer: &dyn Tracer,
        mut traced: TracedTransport,
        directions: Directions,
        path: &Path,
    ) -> Result<Option<TracedTransport>> {
        let key = self.key();
        let total = traced.receivers.traced.len();
        let mut stored = Instant::now();
        loop {
            let done = traced.num_rows();
            (self.progress)(BakeProgress::Gathering { done, total });
            if done == total {
                break;
            }
            if self.stopped() || stored.elapsed() > STORE_EVERY {
                traced.write(path)?;
                stored = Instant::now();
            }
            if self.stopped() {
                return Ok(None);
            }
            let piece = &traced.receivers.traced[done..total.min(done + PIECE)];
            let among = (tracer, &self.scene, traced.receivers.fronts.as_slice());
            match irradiance::rows(among, piece, directions, key) {
                Ok(more) => traced.matrix.append(more),
                Err(error) => {
                    traced.write(path)?;
                    return Err(error.into());
                }
            }
        }
        self.num_rays += traced.matrix.num_rays;
        Ok(Some(traced))
    }

    /// Cameras of the views to bake for.
    fn cameras(&self) -> Vec<Camera> {
        let frames = self.dataset.frames();
        let cameras = self.frames.iter().map(|&frame| frames[frame].camera);
        cameras.collect()
    }

    /// Key of the random numbers of all directions.
    fn key(&self) -> RandomKey {
        RandomKey::new(self.request.options.seed, Purpose::Bake, 1)
    }

    /// The receivers for the views to bake for; `None` if it was stopped.
    fn find_receivers(&mut self, tracer: &dyn Tracer) -> Result<Option<Receivers>> {
        let cameras = self.cameras();
        let stop = &self.request.stop;
        let mut told = |progress| {
            (self.progress)(progress);
            match stop.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        Receivers::find(tracer, &self.scene, cameras.iter(), &mut told)
    }
}
