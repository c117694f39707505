//! The lobe of each surface, as its views ask for it.

use super::fit::{Fit, NormalEquations, ROUGHNESSES};
use super::observe::{Observation, Observations};
use super::planes::Planes;
use eagpt_light::segments::Segments;
use eagpt_scene::Gloss;
use eagpt_scene::median::median_of;
use eagpt_scene::rng::RandomKey;
use eagpt_trace::cpu::CpuScene;
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Points whose sums are added up together, in order.
const POINTS_AT_ONCE: usize = 64;
/// Light is compared from this part of the median on: what is darker is noise.
const DARK: f32 = 0.1;
/// Views are halved in runs of this length: neighbours show much the same.
const RUN: u32 = 2;
/// Least number of views of points of a surface, and of points: strips along edges that cameras see
/// mixed with what is behind differ between views, too.
const LEAST_SEEN: usize = 300;
const LEAST_POINTS: usize = 24;
/// Number of views from which on a surface speaks for itself.
const ENOUGH: usize = 60;
/// Least share of the differences between views that a lobe explains, and that of each half of the
/// views which the lobe of the other explains.
const LEAST_EXPLAINED: f64 = 0.15;
const LEAST_FORETOLD: f64 = 0.1;
/// Least part of the predicted light that is no noise.
const LEAST_CERTAINTY: f64 = 0.3;
/// Least number of views of a metal. Points of a surface differ between views all alike, and what
/// few views show beside things that hide a part of it is like some lobe by chance: in virtual
/// rooms without metals, such lobes had 6.3 and 7.0 views, steel in a kitchen 39 and more.
const LEAST_VIEWS_OF_METAL: f64 = 10.0;
/// F0 from which on a surface is a metal, which may have a colour.
pub(super) const METAL: f64 = 0.2;
/// F0 of other surfaces, at most: a refractive index of 1.58. Varnish, plastics, glass and ceramics
/// have 1.4 to 1.6, but what differs between views for other reasons makes fits up to twice as
/// large, and rooms then reflect several percent too much.
const MAX_DIELECTRIC: f64 = 0.05;

/// A surface that is glossy by its own views.
#[derive(Debug, Clone, Copy)]
pub(super) struct Decision {
    pub(super) lobe: Fit,
    pub(super) gloss: Gloss,
    /// Whether it is a metal that scatters nothing.
    pub(super) is_bare: bool,
    /// Share of the differences between views that the lobe explains.
    pub(super) explained: f64,
    /// The least share of one half of the views that the lobe of the other half explains.
    pub(super) foretold: f64,
}

/// Normal equations of a surface.
#[derive(Default, Clone)]
pub(super) struct Evidence {
    /// Of luminance: all views, and each half of them.
    pub(super) all: NormalEquations,
    halves: [NormalEquations; 2],
    /// The same of each channel, for a colour.
    channels: [NormalEquations; 3],
    channel_halves: [[NormalEquations; 2]; 3],
    /// Points that each view shows.
    views: BTreeMap<u32, usize>,
}

impl Evidence {
    pub(super) fn add(&mut self, other: &Self) {
        self.all.add(&other.all);
        for (view, num) in &other.views {
            *self.views.entry(*view).or_default() += num;
        }
        for (sum, more) in self.parts().zip(other.shared_parts()) {
            sum.add(more);
        }
    }

    fn parts(&mut self) -> impl Iterator<Item = &mut NormalEquations> {
        let channels = self.channels.iter_mut();
        let halves = self.channel_halves.as_flattened_mut().iter_mut();
        self.halves.iter_mut().chain(channels).chain(halves)
    }

    fn shared_parts(&self) -> impl Iterator<Item = &NormalEquations> {
        let halves = self.channel_halves.as_flattened().iter();
        self.halves.iter().chain(&self.channels).chain(halves)
    }

    /// Number of views, as if each showed as many points as any other.
    fn num_views(&self) -> f64 {
        let sum: usize = self.views.values().sum();
        let squares: usize = self.views.values().map(|num| num * num).sum();
        (sum * sum) as f64 / squares.max(1) as f64
    }

    /// Whether the views are enough to say that a surface is diffuse.
    pub(super) fn is_known(&self) -> bool {
        self.all.num_seen >= ENOUGH
    }

    /// The lobe that explains most of the differences between views, and that share of them; `None`
    /// where views are few or it explains little.
    pub(super) fn lobe(&self) -> Option<(Fit, f64)> {
        if self.all.num_seen < LEAST_SEEN || self.all.num_points < LEAST_POINTS {
            return None;
        }
        let lobe = self.all.fit(LEAST_CERTAINTY)?;
        let explained = self.all.explained(lobe);
        (explained >= LEAST_EXPLAINED).then_some((lobe, explained))
    }

    /// The lobe that the views ask for; `None` for a diffuse surface.
    pub(super) fn decide(&self) -> Option<Decision> {
        let (lobe, explained) = self.lobe()?;
        let [first, second] = &self.halves;
        let foretold = |from: &NormalEquations, of: &NormalEquations| {
            from.fit(LEAST_CERTAINTY)
                .map_or(f64::NEG_INFINITY, |lobe| of.explained(lobe))
        };
        let foretold = foretold(first, second).min(foretold(second, first));
        // All that a bare metal shows is mirrored: its lobe tells it better than the mean of each
        // point does, which walls that differ a little between views do not pass.
        let bare = self.bare(lobe);
        let is_told = bare.is_none_or(|bare| self.all.explained_alone(bare) > 0.0);
        let is_enough = lobe.specular < METAL || self.num_views() >= LEAST_VIEWS_OF_METAL;
        // More than all is noise.
        let sound = lobe.is_sound()
            && is_enough
            && is_told
            && explained <= 1.0
            && (LEAST_FORETOLD..=1.0).contains(&foretold);
        sound.then(|| Decision {
            lobe,
            gloss: Gloss {
                specular: self.specular(lobe, bare),
                roughness: ROUGHNESSES[lobe.roughness],
            },
            is_bare: bare.is_some(),
            explained,
            foretold,
        })
    }

    /// The lobe of a metal that scatters nothing, if it is one.
    fn bare(&self, lobe: Fit) -> Option<Fit> {
        (lobe.specular >= METAL)
            .then(|| self.all.bare(lobe))
            .flatten()
    }

    /// F0 of each channel: grey, unless it is a metal and a colour of one half of the views
    /// explains the other half better.
    fn specular(&self, lobe: Fit, bare: Option<Fit>) -> Vec3 {
        if lobe.specular < METAL {
            return Vec3::splat(lobe.specular.min(MAX_DIELECTRIC) as f32);
        }
        let specular = bare.unwrap_or(lobe).specular;
        let grey = Vec3::splat(specular as f32);
        let colour_of =
            |sums: &[NormalEquations; 3]| sums.each_ref().map(|s| s.fit_specular(lobe.roughness));
        let explained = |half: usize, speculars: [f64; 3]| -> f64 {
            let each = self.channel_halves.iter().zip(speculars);
            each.map(|(sums, specular)| sums[half].explained(Fit { specular, ..lobe }))
                .sum()
        };
        let is_colour = [(0, 1), (1, 0)].into_iter().all(|(from, of)| {
            let found = self
                .channel_halves
                .each_ref()
                .map(|sums| sums[from].fit_specular(lobe.roughness));
            explained(of, found) > explained(of, [lobe.specular; 3])
        });
        match is_colour {
            true => {
                let found = Vec3::from(colour_of(&self.channels).map(|f| f as f32));
                (found * (specular / lobe.specular) as f32).min(Vec3::ONE)
            }
            false => grey,
        }
    }
}

/// Normal equations of all surfaces; `scenes` are the place in each light.
pub(super) fn evidence(
    scenes: &[CpuScene],
    seen: &Observations,
    segments: &Segments,
    planes: &Planes,
    key: RandomKey,
) -> Vec<Evidence> {
    let mut place = BTreeMap::new();
    for (r, (i, _)) in seen.receivers.iter().enumerate() {
        place.insert(*i, r);
    }
    let points: Vec<&[Observation]> = seen
        .kept
        .chunk_by(|a, b| (a.gaussian, a.light) == (b.gaussian, b.light))
        .filter(|views| views.len() > 2 && place.contains_key(&views[0].gaussian))
        .collect();
    let dark = DARK * median_of(seen.colors.iter().map(|c| c.max_element()));
    let mut fronts = vec![Vec3::ZERO; scenes[0].surfels().surfels.len()];
    for (i, surface) in seen.receivers.iter().chain(&seen.faint) {
        fronts[*i as usize] = surface.normal;
    }
    let of_some = |points: &[&[Observation]]| {
        let mut sums: BTreeMap<u32, Evidence> = BTreeMap::new();
        for views in points {
            let receiver = place[&views[0].gaussian];
            let scene = &scenes[views[0].light];
            let of = sums.entry(segments.of[receiver]).or_default();
            let mean = seen.colors[receiver].max_element() + dark;
            let scale = 1.0 / (mean * mean);
            let plane = planes.of_receiver(receiver, segments.of[receiver]);
            let place = (planes.normals[receiver], plane);
            let found: Vec<_> = (views.iter())
                .filter_map(|view| Some((view, view.predict((scene, &fronts), place, key)?)))
                .collect();
            for (view, _) in &found {
                *of.views.entry(view.view).or_default() += 1;
            }
            let in_half = |half: Option<u32>, view: &Observation| {
                half.is_none_or(|half| view.view / RUN % 2 == half)
            };
            let mut add = |channel: usize, half: Option<u32>| {
                let chosen = found.iter().filter(|(view, _)| in_half(half, view));
                let samples: Vec<_> = chosen
                    .map(|(view, lobes)| {
                        let [x, y, z] = view.radiance.to_array();
                        let luminance = eagpt_scene::color::luminance([x, y, z]);
                        let light = [x, y, z, luminance][channel];
                        view.seen(light, scale, lobes[channel])
                    })
                    .collect();
                let sums = match (channel, half) {
                    (3, None) => &mut of.all,
                    (3, Some(half)) => &mut of.halves[half as usize],
                    (_, None) => &mut of.channels[channel],
                    (_, Some(half)) => &mut of.channel_halves[channel][half as usize],
                };
                sums.add_point(&samples);
            };
            for channel in 0..4 {
                for half in [None, Some(0), Some(1)] {
                    add(channel, half);
                }
            }
        }
        sums
    };
    let parts: Vec<BTreeMap<u32, Evidence>> =
        points.par_chunks(POINTS_AT_ONCE).map(of_some).collect();
    let mut all = vec![Evidence::default(); segments.num];
    for (segment, sums) in parts.iter().flatten() {
        all[*segment as usize].add(sums);
    }
    all
}
