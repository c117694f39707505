//! Gaussians that reflect light, and where it is gathered for them.
//!
//! Most Gaussians of a large scene are faint: their weight is small in every pixel, and so is what
//! is seen of an error of theirs. Rays are traced for those that are seen well, and the faint ones
//! take the mean irradiance of the nearest of these on the same surface (as records of an
//! irradiance cache: Ward et al. 1988).

use super::request::Told;
use crate::error::Result;
use crate::progress::BakeProgress;
use eagpt_light::surfaces::{self, BestSeen};
use eagpt_scene::lamps::emits;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::{Front, Receiver};
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Largest weight in any pixel below which a Gaussian is faint. Measured: a kitchen of 116,000
/// Gaussians, of which 59 % are, loses 0.01 dB of baked test views by day and 0.3 dB in a night of
/// three strips.
const FAINT: f32 = 0.2;
/// Rays are traced for at least so many Gaussians: those of small scenes are seen one by one, and
/// rooms of 40,000, half of them faint, would lose 0.2 to 0.5 dB.
const LEAST_TRACED: usize = 50_000;
/// Gaussians that a faint one takes its irradiance from, at most.
pub(super) const NUM_SOURCES: usize = 3;
/// The nearest traced Gaussians of a faint one, of which sources are chosen.
const NUM_NEAREST: NonZero<usize> = NonZero::new(16).unwrap();
/// Cosine between the normals of a faint Gaussian and its source, at least.
const MIN_COSINE: f32 = 0.9;
/// Distance of a source, at most, in mean sizes of both Gaussians.
const REACH: f32 = 4.0;
/// In place of a source where there are fewer.
pub(super) const NO_SOURCE: u32 = u32::MAX;
const NO_SOURCES: Sources = Sources([NO_SOURCE; NUM_SOURCES]);

/// The Gaussians of a scene that reflect.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Receivers {
    /// Those that rays are traced for: those that are seen well, ascending, then faint ones without
    /// neighbours.
    pub(super) traced: Vec<Receiver>,
    /// The others.
    pub(super) faint: Vec<Faint>,
    /// The sides from which all Gaussians are seen, `[n]`, which alone light others.
    pub(super) fronts: Vec<Front>,
}

/// A Gaussian for which no rays are traced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Faint {
    /// Its index.
    pub(super) gaussian: u32,
    /// Where it takes its irradiance from.
    pub(super) sources: Sources,
}

/// Numbers of [`Receivers::traced`], one at least, before [`NO_SOURCE`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sources(pub(super) [u32; NUM_SOURCES]);

impl Receivers {
    /// All Gaussians of `scene` that reflect: where one of the `cameras` sees them best, or, of
    /// those that no camera sees, which still light others, on their own plane. `None` if `told`
    /// has ended it.
    ///
    /// # Errors
    /// If the device of the `tracer` fails.
    pub(super) fn find<'a>(
        tracer: &dyn Tracer,
        scene: &Gaussians,
        cameras: impl Iterator<Item = &'a Camera>,
        told: &mut Told<'_>,
    ) -> Result<Option<Self>> {
        let cameras = surfaces::coarse(cameras, scene.len());
        let total = cameras.len();
        let mut best = BestSeen::new(scene.len());
        for (done, camera) in (1..).zip(&cameras) {
            best.add(tracer, camera)?;
            if told(BakeProgress::Looking { done, total }).is_break() {
                return Ok(None);
            }
        }
        let seen = best.finish();
        let reflecting =
            || (0..scene.len() as u32).filter(|&i| !emits(scene.emissions[i as usize]));
        let unseen = reflecting().filter(|&i| seen[i as usize].is_none());
        let unseen = unseen.map(|i| scene.get(i as usize));
        let mut lone = surfaces::lone(tracer, unseen, &[])?.into_iter();
        let surface = |i: u32| {
            let best = seen[i as usize].map(|seen| (seen.weight, seen.surface));
            let (weight, surface) = best.or_else(|| Some((0.0, lone.next()?)))?;
            Some((weight, (i, surface)))
        };
        let all: Vec<(f32, Receiver)> = reflecting().filter_map(surface).collect();
        let least = least_traced(all.iter().map(|(weight, _)| *weight));
        Ok(Some(Self {
            fronts: surfaces::fronts(scene, &seen),
            ..Self::divided(scene, &all, least)
        }))
    }

    /// Receivers with their weights in the pixels that see them best, ascending, divided into those
    /// that are traced, of a weight of at least `least`, and those that follow them.
    fn divided(scene: &Gaussians, all: &[(f32, Receiver)], least: f32) -> Self {
        let (traced, faint): (Vec<_>, Vec<_>) =
            all.iter().partition(|(weight, _)| *weight >= least);
        let traced = Traced::new(scene, traced.into_iter().map(|(_, one)| one).collect());
        let followed: Vec<Option<Sources>> =
            faint.par_iter().map(|(_, one)| traced.near(one)).collect();
        let mut divided = Self {
            traced: traced.receivers,
            faint: Vec::new(),
            fronts: Vec::new(),
        };
        for ((_, one), sources) in faint.iter().zip(followed) {
            match sources {
                Some(sources) => divided.faint.push(Faint {
                    gaussian: one.0,
                    sources,
                }),
                // No traced Gaussian is near.
                None => divided.traced.push(*one),
            }
        }
        divided
    }

    /// Index of each Gaussian, with the numbers of the traced ones whose irradiance it has.
    pub(super) fn each(&self) -> impl Iterator<Item = (usize, Sources)> {
        let traced = (0..).zip(&self.traced).map(|(row, (index, _))| {
            let mut own = NO_SOURCES;
            own.0[0] = row;
            (*index as usize, own)
        });
        let faint = self
            .faint
            .iter()
            .map(|faint| (faint.gaussian as usize, faint.sources));
        traced.chain(faint)
    }
}

impl Sources {
    /// The first of them.
    pub(super) fn first(&self) -> usize {
        self.0[0] as usize
    }

    /// The mean of what they have; `of_row` is that of a number of [`Receivers::traced`].
    pub(super) fn mean(&self, of_row: impl Fn(usize) -> Vec3) -> Vec3 {
        let rows = || self.0.iter().filter(|&&row| row != NO_SOURCE);
        rows().map(|&row| of_row(row as usize)).sum::<Vec3>() / rows().count() as f32
    }
}

/// Weight from which on Gaussians are traced.
fn least_traced(weights: impl Iterator<Item = f32>) -> f32 {
    let mut weights: Vec<f32> = weights.collect();
    if weights.len() <= LEAST_TRACED {
        return 0.0;
    }
    let (_, last, _) = weights.select_nth_unstable_by(LEAST_TRACED - 1, |a, b| b.total_cmp(a));
    last.min(FAINT)
}

/// The traced Gaussians, in space.
struct Traced<'a> {
    scene: &'a Gaussians,
    receivers: Vec<Receiver>,
    tree: ImmutableKdTree<f32, 3>,
}

impl<'a> Traced<'a> {
    fn new(scene: &'a Gaussians, receivers: Vec<Receiver>) -> Self {
        let places: Vec<[f32; 3]> = (receivers.iter())
            .map(|(_, surface)| surface.position.to_array())
            .collect();
        Self {
            scene,
            receivers,
            tree: ImmutableKdTree::new_from_slice(&places),
        }
    }

    fn size(&self, (index, _): &Receiver) -> f32 {
        self.scene.size_of(*index as usize)
    }

    /// The nearest that are on the same surface as a faint Gaussian; `None` if there is none.
    fn near(&self, faint: &Receiver) -> Option<Sources> {
        let is_source = |other: &Receiver| {
            let (own, near) = (&faint.1, &other.1);
            let reach = REACH * 0.5 * (self.size(faint) + self.size(other));
            own.normal.dot(near.normal) >= MIN_COSINE
                && own.position.distance_squared(near.position) <= reach * reach
        };
        let mut sources = NO_SOURCES;
        let place = faint.1.position.to_array();
        let nearest = self.tree.nearest_n::<SquaredEuclidean>(&place, NUM_NEAREST);
        let found = (nearest.iter().map(|one| one.item as u32))
            .filter(|&number| is_source(&self.receivers[number as usize]));
        for (source, number) in sources.0.iter_mut().zip(found) {
            *source = number;
        }
        (sources != NO_SOURCES).then_some(sources)
    }
}

#[cfg(test)]
mod tests {
    use super::super::transport::TracedTransport;
    use super::*;
    use eagpt_scene::files::Key;
    use eagpt_testkit::gaussians::{material, rectangle};
    use eagpt_trace::transport::matrix::Directions;
    use eagpt_trace::transport::start::Surface;

    /// A floor of Gaussians with a weight each, and their receivers.
    fn floor(weight: impl Fn(u32) -> f32) -> (Gaussians, Vec<(f32, Receiver)>) {
        let gray = material(Vec3::ZERO, 0.0, Vec3::splat(0.5));
        let scene: Gaussians = rectangle(Vec3::ZERO, Vec3::X, Vec3::Y, 0.1, gray)
            .into_iter()
            .collect();
        let receiver = |i: u32| {
            let surface = Surface {
                position: scene.positions[i as usize],
                normal: Vec3::Z,
                offset: 0.01,
            };
            (weight(i), (i, surface))
        };
        let receivers = (0..scene.len() as u32).map(receiver).collect();
        (scene, receivers)
    }

    #[test]
    fn faint_gaussians_have_the_mean_irradiance_of_their_neighbours() {
        let (scene, all) = floor(|i| if i % 2 == 0 { 0.6 } else { 0.1 });
        let receivers = Receivers::divided(&scene, &all, FAINT);
        assert_eq!(receivers.traced.len(), scene.len().div_ceil(2));
        assert_eq!(receivers.faint.len(), scene.len() / 2);
        // Of a linear irradiance they have what is there, but for the side of the nearest.
        let light = |position: Vec3| Vec3::splat(3.0 + position.x);
        let mut seen = vec![false; scene.len()];
        for (i, sources) in receivers.each() {
            let got = sources.mean(|row| light(receivers.traced[row].1.position));
            let (wanted, far) = (
                light(scene.positions[i]),
                if i % 2 == 0 { 1e-6 } else { 0.2 },
            );
            assert!(
                (got - wanted).abs().max_element() < far,
                "{i}: {got} {wanted}"
            );
            assert!(!std::mem::replace(&mut seen[i], true));
        }
        assert!(seen.into_iter().all(|is_there| is_there));
    }

    /// Gaussians that face another way, or are far from all others, have rays of their own.
    #[test]
    fn faint_gaussians_without_neighbours_are_traced() {
        let (scene, mut all) = floor(|i| if [3, 7].contains(&i) { 0.1 } else { 0.6 });
        all[3].1.1.normal = Vec3::X;
        all[7].1.1.position.z = 5.0;
        all[11].0 = 0.1;
        let receivers = Receivers::divided(&scene, &all, FAINT);
        let [faint] = receivers.faint.as_slice() else {
            panic!("{:?}", receivers.faint);
        };
        assert_eq!(faint.gaussian, 11);
        let is_near = |&row: &u32| {
            let (index, surface) = receivers.traced[row as usize];
            assert!(![3, 7, 11].contains(&index));
            surface.position.distance(scene.positions[11]) < 0.35
        };
        assert!(faint.sources.0.iter().all(is_near));
        let last = receivers.traced.iter().rev().map(|(index, _)| *index);
        assert_eq!(last.take(2).collect::<Vec<_>>(), [7, 3]);
    }

    #[test]
    fn small_scenes_are_traced_whole_and_of_large_ones_the_best_seen() {
        let weights = |num: usize| (0..num).map(move |i| (i % 1000) as f32 / 1000.0);
        assert_eq!(least_traced(weights(LEAST_TRACED)), 0.0);
        assert_eq!(least_traced(weights(10 * LEAST_TRACED)), FAINT);
        let least = least_traced(weights(LEAST_TRACED * 10 / 9));
        assert!((least - 0.1).abs() < 2e-3, "{least}");
    }

    #[test]
    fn faint_gaussians_are_kept_in_files() {
        let (scene, all) = floor(|i| if i % 3 == 0 { 0.6 } else { 0.1 });
        let directions = Directions {
            bsdf: 4,
            to_lights: 0,
        };
        let fronts = (0..scene.len()).map(|i| [Front::Both, Front::Along, Front::Against][i % 3]);
        let receivers = Receivers {
            fronts: fronts.collect(),
            ..Receivers::divided(&scene, &all, FAINT)
        };
        assert!(!receivers.faint.is_empty());
        let traced = TracedTransport::new(Key::new(), directions, &scene, receivers);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("transport");
        traced.write(&path).unwrap();
        let read = TracedTransport::read(&path).unwrap();
        assert_eq!(read, traced);
        assert!(read.fits(&scene));
        let mut damaged = read;
        damaged.receivers.faint[0].sources.0[0] = damaged.receivers.traced.len() as u32;
        assert!(!damaged.fits(&scene));
    }
}
