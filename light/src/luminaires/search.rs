//! Bulbs at hidden places, one after the other: always the one whose light explains most.
//!
//! The light of a bulb at a place leaves in two cones, upwards and downwards. Its gain, the part of
//! the loss that it would explain ([`gain`](super::gain)), is told from the slope and the curvature
//! of the loss of [`Compared::fit`] at a receiver's known light (orthogonal matching pursuit: Pati,
//! Rezaiifar and Krishnaprasad 1993), and for the best of all it is fitted, with all that were
//! found before.

use super::bulb::Found;
use super::gain::{Gain, Lit, State, WEIGHT};
use super::nearby;
use super::places::{NEAR, Places, cosine, ring, side};
use super::strip;
use crate::alike::{Compared, Expected, Fit, Row};
use crate::lamp_powers::luminances;
use crate::segments::Segments;
use eagpt_trace::{TraceError, Tracer};
use glam::Vec3;
use std::collections::BTreeMap;
use std::f32::consts::PI;

/// Receivers by which places are compared, about.
const NUM_COMPARED: usize = 2000;
/// Distance to the next surface beyond a place, in the reach of what hides a bulb: others are
/// within something.
const MARGIN: f32 = 0.15;
/// Cosine to its normal at which a surface gets light, at least.
const GRAZING: f32 = 0.02;
/// Part of the loss that a bulb explains, at least, and one behind a flat lamp, which is likelier.
/// Measured in four rooms, two of them without such a luminaire: at places of none at most .020,
/// and behind lamps .003; at those of three .050 to .091, and at those of three behind lamps .009
/// to .032.
const LEAST_EXPLAINED: f64 = 0.03;
const LEAST_BEHIND_LAMP: f64 = 0.006;
/// Bulbs, at most, and those that are tried in vain before the search ends.
const MOST: usize = 12;
const MOST_REFUSED: usize = 6;
/// Distance of a place from those that were tried, in the reach, at least.
const APART: f32 = 1.0;
/// Gain of a place, in that of the best, at least, for it to be as good.
const AS_GOOD: f64 = 0.7;
/// Part of the loss that a strip explains, in that of a bulb, at least.
const BETTER: f64 = 1.5;
/// Albedo that surfaces have at least, and share of those lit by a bulb that may have less.
const LEAST_ALBEDO: f64 = 0.05;
const DARKER: f64 = 0.25;
/// Intensity in one half, in that of the other, at least, for it to be open.
const LEAST_OF_HALF: f64 = 0.25;

/// A search for bulbs at `places`, by the luminance of receivers.
pub(super) struct Search<'a> {
    pub(super) tracer: &'a dyn Tracer,
    pub(super) compared: &'a Compared,
    pub(super) places: &'a Places,
    /// Unit vector upwards.
    pub(super) up: Vec3,
}

/// Bulbs that were tried.
#[derive(Default)]
struct Tried {
    positions: Vec<Vec3>,
    /// Those of lamps of one make that do not explain enough together; one alone may.
    of_makes: Vec<Vec3>,
    /// Single ones that did not explain enough.
    num_refused: usize,
}

/// A bulb that explains enough.
struct Next {
    number: usize,
    found: Found,
    /// Light of it and of those before, and their intensities.
    rows: Vec<Row>,
    fit: Fit,
}

impl Search<'_> {
    /// The bulbs at some of the places.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn find(&self) -> Result<Vec<Found>, TraceError> {
        let num = self.compared.receivers.len();
        let step = num.div_ceil(NUM_COMPARED).max(1);
        let places = self.places.all.iter();
        let lit: Vec<Vec<Lit>> = places
            .map(|place| self.lit((&place.positions, place.open), step))
            .collect::<Result<_, TraceError>>()?;
        let known = luminances(&self.compared.known);
        let mut sorted = known.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let mut state = State {
            radiances: luminances(&self.compared.radiances),
            usual: sorted.get(num / 2).copied().unwrap_or(1.0),
            known,
            more: vec![0.0; num],
            rows: vec![Row::new(); num],
        };
        let (mut chosen, mut intensities) = (Vec::new(), BTreeMap::new());
        let mut tried = Tried::default();
        while chosen.len() < MOST {
            let Some(next) = self.next(&state, (&lit, step), &mut tried)? else {
                break;
            };
            state.more = next.rows.iter().map(|row| next.fit.light(row)).collect();
            state.rows = next.rows;
            intensities = next.fit.x;
            chosen.push((next.number, next.found));
        }
        let intensity = |source: usize| intensities.get(&source).copied().unwrap_or(0.0);
        let found = chosen.into_iter().map(|(number, mut found)| {
            let halves = [0, 1].map(|side| intensity(2 * number + side));
            let least = LEAST_OF_HALF * halves[0].max(halves[1]);
            for (rings, intensity) in found.cones.iter_mut().zip(halves) {
                if intensity < least {
                    *rings = 0;
                }
            }
            found
        });
        Ok(found.collect())
    }

    /// The bulb that explains most, if one of the best that were not `tried` does enough.
    ///
    /// # Errors
    /// If the device fails.
    fn next(
        &self,
        state: &State,
        (lit, step): (&[Vec<Lit>], usize),
        tried: &mut Tried,
    ) -> Result<Option<Next>, TraceError> {
        let more: Vec<Vec3> = state.more.iter().map(|m| Vec3::splat(*m as f32)).collect();
        let segments = self.compared.segments(&more);
        let before = self.fit(state, &segments, &state.rows).explained;
        let light = state.light();
        let residuals =
            |light: &[f64]| (self.compared).residuals(&segments, [&state.radiances, light]);
        let left = residuals(&light);
        let gains = state.gains(lit, (&light, &left), &segments, step);
        while tried.num_refused < MOST_REFUSED {
            let Some(best) = self.best(&gains, tried) else {
                break;
            };
            let number = best.number;
            let place = &self.places.all[number];
            let bulbs = Found {
                positions: place.positions.clone(),
                is_strip: false,
                cones: best.cones,
            };
            let among = (self.tracer, self.places, gains.as_slice());
            let strip = strip::through(among, best, self.up)?;
            let fitted = |found: Found| -> Result<_, TraceError> {
                let rows = self.rows(state, &found, number)?;
                Ok((self.fit(state, &segments, &rows), rows, found))
            };
            let bulbs = fitted(bulbs)?;
            let strip = strip.map(fitted).transpose()?;
            let least = before + BETTER * (bulbs.0.explained - before);
            let strip = strip.filter(|(fit, ..)| fit.explained >= least);
            let (fit, rows, found) = strip.unwrap_or(bulbs);
            let least = match place.is_behind_lamp {
                true => LEAST_BEHIND_LAMP,
                false => LEAST_EXPLAINED,
            };
            let explained = fit.explained - before;
            let with = state.known.iter().zip(&rows);
            let with: Vec<f64> = with.map(|(known, row)| known + fit.light(row)).collect();
            let of_bulb = rows.iter().map(|row| {
                let row = row.iter().filter(|(source, _)| source / 2 == number);
                row.map(|(source, of)| of * fit.x[source]).sum()
            });
            let nearby = nearby::explained((&light, of_bulb), [&left, &residuals(&with)]);
            let is_enough = nearby::tells(nearby).unwrap_or(explained >= least);
            if !is_enough && place.positions.len() > 1 {
                tried.of_makes.extend(&found.positions);
                continue;
            }
            tried.positions.extend(&found.positions);
            if is_enough {
                return Ok(Some(Next {
                    number,
                    found,
                    rows,
                    fit,
                }));
            }
            tried.num_refused += 1;
        }
        Ok(None)
    }

    /// The place of most gain that is not near one that was `tried`; of several about as good lamps
    /// of one make, or else the one in their middle, as a bulb is in a shade.
    fn best<'g>(&self, gains: &'g [Gain], tried: &Tried) -> Option<&'g Gain> {
        let (all, reach) = (&self.places.all, self.places.reach);
        let positions = |of: &Gain| all[of.number].positions.as_slice();
        let is_near = |a: &[Vec3], b: &[Vec3], distance: f32| {
            let mut pairs = a.iter().flat_map(|a| b.iter().map(move |b| a.distance(*b)));
            pairs.any(|apart| apart < distance)
        };
        let is_open = |of: &&Gain| {
            let is_tried = |at: &[Vec3]| is_near(positions(of), at, APART * reach);
            let is_make = positions(of).len() > 1;
            !is_tried(&tried.positions) && (!is_make || !is_tried(&tried.of_makes))
        };
        let open: Vec<&Gain> = gains.iter().filter(is_open).collect();
        let best = *(open.iter()).max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        if best.gain <= 0.0 {
            return None;
        }
        let near_best = |of: &&&Gain| {
            of.gain >= AS_GOOD * best.gain && is_near(positions(of), positions(best), reach)
        };
        let as_good = || open.iter().filter(near_best);
        let sets = as_good().filter(|of| positions(of).len() > 1);
        if let Some(set) = sets.max_by(|a, b| a.gain.total_cmp(&b.gain)) {
            return Some(set);
        }
        let (sum, weight) = as_good().fold((Vec3::ZERO, 0.0), |sum, of| {
            let weight = of.gain as f32;
            (sum.0 + weight * positions(of)[0], sum.1 + weight)
        });
        let middle = sum / weight;
        let off = |of: &&&Gain| positions(of)[0].distance_squared(middle);
        as_good().min_by(|a, b| off(a).total_cmp(&off(b))).copied()
    }

    /// Light of what was found and of what is now, as the source of this number.
    ///
    /// # Errors
    /// If the device fails.
    fn rows(&self, state: &State, found: &Found, number: usize) -> Result<Vec<Row>, TraceError> {
        let mut rows = state.rows.clone();
        for lit in self.lit((&found.positions, found.cones), 1)? {
            let share = if found.is_strip {
                cosine(lit.ring).abs()
            } else {
                1.0
            };
            let (side, _) = side(lit.ring);
            add(
                &mut rows[lit.receiver],
                2 * number + side,
                share * lit.light,
            );
        }
        for row in &mut rows {
            row.sort_unstable_by_key(|(source, _)| *source);
        }
        Ok(rows)
    }

    /// Every so many-th of the receivers, if bulbs at these positions light it, within cones of so
    /// many rings.
    ///
    /// # Errors
    /// If the device fails.
    fn lit(
        &self,
        (positions, open): (&[Vec3], [usize; 2]),
        step: usize,
    ) -> Result<Vec<Lit>, TraceError> {
        let (mut rays, mut distances, mut lit) = (Vec::new(), Vec::new(), Vec::new());
        let receivers = self.compared.receivers.iter().enumerate().step_by(step);
        let pairs = receivers.flat_map(|of| positions.iter().map(move |at| (of, *at)));
        for ((receiver, (_, surface)), position) in pairs {
            let towards = position - surface.position;
            let distance = towards.length();
            let direction = towards / distance;
            let cosine = direction.dot(surface.normal);
            let ring = ring(-direction.dot(self.up));
            let (side, order) = side(ring);
            let is_far = distance > NEAR * self.places.reach;
            if is_far && cosine > GRAZING && order < open[side] {
                rays.push(surface.ray(direction));
                let light = cosine / (PI * distance * distance);
                distances.push(distance + MARGIN * self.places.reach);
                lit.push(Lit {
                    receiver,
                    ring,
                    light,
                });
            }
        }
        let are_free = self.tracer.are_free(&rays, &distances)?;
        let free = lit
            .into_iter()
            .zip(are_free)
            .filter(|(_, is_free)| *is_free);
        Ok(free.map(|(lit, _)| lit).collect())
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

/// Adds light of a source to a row.
fn add(row: &mut Row, source: usize, light: f32) {
    match row.iter_mut().find(|(other, _)| *other == source) {
        Some((_, sum)) => *sum += f64::from(light),
        None => row.push((source, f64::from(light))),
    }
}
