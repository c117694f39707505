//! Bulbs at hidden places, one after the other: always the one whose light explains most.
//!
//! The light of a bulb at a place leaves in two cones, upwards and downwards. What it would explain
//! is told from the slope and the curvature of the loss of [`Compared::fit`] at a receiver's known
//! light (orthogonal matching pursuit: Pati, Rezaiifar and Krishnaprasad 1993), and for the best of
//! all it is fitted, with all that were found before.

use super::places::{HALF, Place, Places, ring, side};
use crate::alike::{Compared, Expected, Fit, Residual, Row};
use crate::error::Result;
use crate::lamp_powers::luminances;
use crate::segments::Segments;
use eagpt_trace::{Features, Tracer};
use glam::Vec3;
use std::collections::BTreeMap;
use std::f32::consts::PI;

/// Receivers by which places are compared, about.
const NUM_COMPARED: usize = 2000;
/// Receivers of these that a cone lights, at least.
const LEAST_LIT: usize = 12;
/// Receivers nearer than this, in the reach of what hides a bulb, are of what hides it.
const NEAR: f32 = 0.5;
/// Distance to the next surface beyond a place, in the same: others are within something.
const MARGIN: f32 = 0.15;
/// Cosine to its normal at which a surface gets light, at least.
const GRAZING: f32 = 0.02;
/// Weight of light that no view shows.
const WEIGHT: f64 = 0.01;
/// Part of the loss that a bulb explains, at least, and one behind a flat lamp, which is likelier.
/// Measured in four rooms, two of them without such a luminaire: at places of none at most .020, and
/// behind lamps .003; at those of three .050 to .091, and at those of three behind lamps .009 to .032.
const LEAST_EXPLAINED: f64 = 0.03;
const LEAST_BEHIND_LAMP: f64 = 0.006;
/// Bulbs, at most, and those that are tried in vain before the search ends.
const MOST: usize = 12;
const MOST_REFUSED: usize = 6;
/// Distance of a place from those that were tried, in the reach, at least.
const APART: f32 = 1.0;
/// What a place explains, in what the best explains, for it to be as good.
const AS_GOOD: f64 = 0.7;
/// Albedo that surfaces have at least, and share of those lit by a bulb that may have less.
const LEAST_ALBEDO: f64 = 0.05;
const DARKER: f64 = 0.25;

/// A bulb, and the halves of the sphere around it in which its light leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub(super) position: Vec3,
    /// Rings of the cone upwards and of that downwards; 0 where it is closed.
    pub(super) cones: [usize; 2],
    /// Radiant intensity in each.
    pub(super) intensities: [f64; 2],
}

/// A receiver that a bulb of intensity 1 lights.
#[derive(Debug, Clone, Copy)]
struct Lit {
    receiver: usize,
    ring: usize,
    /// Irradiance over π.
    light: f32,
}

/// Compared receivers, in luminance.
pub(super) struct Search<'a> {
    pub(super) tracer: &'a dyn Tracer,
    pub(super) compared: &'a Compared,
    pub(super) up: Vec3,
    pub(super) reach: f32,
}

/// What is known of receivers.
struct State {
    radiances: Vec<f64>,
    known: Vec<f64>,
    /// Light of bulbs that were found.
    more: Vec<f64>,
    /// It, of intensity 1, by twice the number of a place, and one more for the cone downwards.
    rows: Vec<Row>,
}

impl Search<'_> {
    /// The bulbs at some of the `places`.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn find(&self, places: &Places) -> Result<Vec<Found>> {
        let num = self.compared.receivers.len();
        let step = num.div_ceil(NUM_COMPARED).max(1);
        let mut lit = Vec::with_capacity(places.all.len());
        for place in &places.all {
            lit.push(self.lit(place, step)?);
        }
        let mut state = State {
            radiances: luminances(&self.compared.radiances),
            known: luminances(&self.compared.known),
            more: vec![0.0; num],
            rows: vec![Row::new(); num],
        };
        let (mut chosen, mut refused): (Vec<(usize, [usize; 2])>, Vec<Vec3>) = Default::default();
        let mut fit = None;
        while chosen.len() < MOST && refused.len() < MOST_REFUSED {
            let segments = self.segments(&state);
            let is_open = |number: &usize| {
                let at = places.all[*number].position;
                let found = chosen
                    .iter()
                    .map(|(number, _)| places.all[*number].position);
                let mut done = refused.iter().copied().chain(found);
                !done.any(|of| of.distance(at) < APART * self.reach)
            };
            let open = (0..places.all.len()).filter(is_open);
            let Some((number, cones)) =
                state.best((places, open), &lit, (self.compared, &segments), step)
            else {
                break;
            };
            let place = &places.all[number];
            let mut rows = state.rows.clone();
            for lit in self.lit(place, 1)? {
                let (side, order) = side(lit.ring);
                if order < cones[side] {
                    rows[lit.receiver].push((2 * number + side, f64::from(lit.light)));
                }
            }
            for row in &mut rows {
                row.sort_unstable_by_key(|(source, _)| *source);
            }
            let before = self.fit(&state, &segments, &state.rows);
            let after = self.fit(&state, &segments, &rows);
            let least = match place.is_behind_lamp {
                true => LEAST_BEHIND_LAMP,
                false => LEAST_EXPLAINED,
            };
            if after.explained - before.explained < least {
                refused.push(place.position);
                continue;
            }
            let light = |row: &Row| row.iter().map(|(source, of)| of * after.x[source]).sum();
            state.more = rows.iter().map(light).collect();
            state.rows = rows;
            chosen.push((number, cones));
            fit = Some(after);
        }
        let intensity = |source: usize| {
            let x = fit.as_ref().and_then(|fit| fit.x.get(&source));
            x.copied().unwrap_or(0.0)
        };
        let found = chosen.into_iter().map(|(number, cones)| Found {
            position: places.all[number].position,
            cones,
            intensities: [0, 1].map(|side| intensity(2 * number + side)),
        });
        Ok(found.collect())
    }

    /// Every so many-th of the receivers, if a bulb at a place lights it.
    ///
    /// # Errors
    /// If the device fails.
    fn lit(&self, place: &Place, step: usize) -> Result<Vec<Lit>> {
        let (mut rays, mut lit) = (Vec::new(), Vec::new());
        for (receiver, (_, surface)) in self.compared.receivers.iter().enumerate().step_by(step) {
            let towards = place.position - surface.position;
            let distance = towards.length();
            let direction = towards / distance;
            let cosine = direction.dot(surface.normal);
            let ring = ring(-direction.dot(self.up));
            let (side, order) = side(ring);
            let is_far = distance > NEAR * self.reach;
            if is_far && cosine > GRAZING && order < place.open[side] {
                rays.push(surface.ray(direction));
                let light = cosine / (PI * distance * distance);
                lit.push((
                    distance + MARGIN * self.reach,
                    Lit {
                        receiver,
                        ring,
                        light,
                    },
                ));
            }
        }
        let met = self.tracer.trace_rays(&rays)?;
        let is_free = |(met, (distance, _)): &(&Features, (f32, Lit))| {
            met.alpha() < 0.5 || met.mean_distance() > *distance
        };
        let free = met.iter().zip(lit).filter(is_free);
        Ok(free.map(|(_, (_, lit))| lit).collect())
    }

    fn segments(&self, state: &State) -> Segments {
        let more: Vec<Vec3> = state.more.iter().map(|m| Vec3::splat(*m as f32)).collect();
        self.compared.segments(&more)
    }

    /// Intensities of the cones of `rows`.
    fn fit(&self, state: &State, segments: &Segments, rows: &[Row]) -> Fit {
        let mut most: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for (i, (source, light)) in (0..)
            .zip(rows)
            .flat_map(|(i, row)| row.iter().map(move |of| (i, *of)))
        {
            let all: f64 = state.radiances[i] / LEAST_ALBEDO;
            let more = (all - state.known[i]).max(0.0) / light;
            most.entry(source).or_default().push(more);
        }
        let expected = most.into_iter().map(|(source, mut most)| {
            most.sort_unstable_by(f64::total_cmp);
            let most = most[(DARKER * most.len() as f64) as usize];
            let expected = Expected {
                radiance: 0.0,
                bounds: [0.0, most],
                weight: WEIGHT,
            };
            (source, expected)
        });
        let light = [state.radiances.as_slice(), &state.known];
        self.compared
            .fit((segments, true), rows, light, &expected.collect())
    }
}

impl State {
    /// Of the places of these numbers, that whose cones explain most, and these: of several that are
    /// about as good, the one in their middle, as a bulb is in a shade.
    fn best(
        &self,
        (places, open): (&Places, impl Iterator<Item = usize>),
        lit: &[Vec<Lit>],
        (compared, segments): (&Compared, &Segments),
        step: usize,
    ) -> Option<(usize, [usize; 2])> {
        let both = self.known.iter().zip(&self.more);
        let light: Vec<f64> = both.map(|(known, more)| known + more).collect();
        let residuals = compared.residuals(segments, [&self.radiances, &light]);
        let mut weights = vec![0.0; segments.num];
        for (i, of) in residuals.iter().enumerate().step_by(step) {
            weights[segments.of[i] as usize] += of.weight;
        }
        let mut usual = self.known.clone();
        usual.sort_unstable_by(f64::total_cmp);
        let loss = Loss {
            residuals: &residuals,
            light: &light,
            segments,
            weights: &weights,
            usual: usual.get(usual.len() / 2).copied().unwrap_or(1.0),
        };
        let tried: Vec<Tried> = open
            .map(|number| {
                let (gains, cones): (Vec<f64>, Vec<usize>) =
                    (0..2).map(|half| loss.cone(&lit[number], half)).unzip();
                Tried {
                    number,
                    gain: gains[0] + gains[1],
                    cones: [cones[0], cones[1]],
                }
            })
            .collect();
        let position = |of: &Tried| places.all[of.number].position;
        let best = tried.iter().max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        let is_as_good = |of: &&Tried| {
            of.gain >= AS_GOOD * best.gain && position(of).distance(position(best)) < places.reach
        };
        let (sum, weight) = (tried.iter().filter(is_as_good)).fold((Vec3::ZERO, 0.0), |sum, of| {
            let weight = of.gain as f32;
            (sum.0 + weight * position(of), sum.1 + weight)
        });
        let middle = sum / weight;
        let off = |of: &&Tried| position(of).distance_squared(middle);
        let nearest = tried.iter().filter(is_as_good);
        let nearest = nearest.min_by(|a, b| off(a).total_cmp(&off(b)))?;
        (best.gain > 0.0).then_some((nearest.number, nearest.cones))
    }
}

/// What a bulb at a place would explain, by its best cones.
struct Tried {
    number: usize,
    gain: f64,
    cones: [usize; 2],
}

/// The loss about the known light.
struct Loss<'a> {
    residuals: &'a [Residual],
    light: &'a [f64],
    segments: &'a Segments,
    /// Sum of the weights of each surface's receivers that places are compared by.
    weights: &'a [f64],
    /// Median of the known light.
    usual: f64,
}

impl Loss<'_> {
    /// What the best cone in one half explains, and its rings.
    fn cone(&self, lit: &[Lit], half: usize) -> (f64, usize) {
        let mut rings: [Vec<&Lit>; HALF] = Default::default();
        for of in lit {
            let (side, order) = side(of.ring);
            if side == half && self.residuals[of.receiver].weight > 0.0 {
                rings[order].push(of);
            }
        }
        let (mut slope, mut curvature, mut num) = (0.0, 0.0, 0);
        let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
        let mut best = (0.0, 0);
        for (order, lit) in rings.iter().enumerate() {
            for of in lit {
                let left = &self.residuals[of.receiver];
                let part = f64::from(of.light) / self.light[of.receiver];
                let pull = left.weight * left.off + left.weight_above * left.above;
                slope += part * pull - WEIGHT * f64::from(of.light) / self.usual;
                curvature += (left.weight + left.weight_above) * part * part;
                let segment = self.segments.of[of.receiver] as usize;
                *sums.entry(segment).or_default() += left.weight * part;
            }
            num += lit.len();
            // The mean of each surface follows.
            let mean = |(segment, sum): (&usize, &f64)| sum * sum / self.weights[*segment];
            let curvature = curvature - sums.iter().map(mean).sum::<f64>();
            if num >= LEAST_LIT && slope > 0.0 && curvature > 0.0 {
                let gain = slope * slope / curvature;
                if gain > best.0 {
                    best = (gain, order + 1);
                }
            }
        }
        best
    }
}
