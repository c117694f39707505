//! The lamps of a scene against those of a virtual room: which were found, and with how much power.
//!
//! A true lamp is an axis-aligned box and its power in each condition. Nothing is transformed: both
//! are in the world of the truth's dataset, where `eagpt synth` puts lamps and a training of that
//! dataset finds them. A scene trained on the photographs may have another world, that of the model
//! (`model_from_world`) aligned anew, and is not measured here.

#[cfg(test)]
mod tests;

use crate::error::{EvalError, Result};
use eagpt_scene::color::luminance;
use eagpt_scene::{Lamp, Lamps, SceneError, files};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

/// Grows boxes on every side, in parts of their largest edge, before they are compared: a lamp is
/// found with some error, and the box of a panel has no volume.
const BOX_MARGIN: f32 = 0.15;
/// Least share of the smaller of two boxes that is in both, if a lamp whose centre is elsewhere is
/// to be the same.
const MIN_OVERLAP: f32 = 0.5;

/// Lamps of a virtual room: the keys of `synth.json` that tell of them.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct TrueLamps {
    /// Names of the conditions, at least one.
    pub conditions: Vec<String>,
    /// The lamps.
    pub lamps: Vec<TrueLamp>,
}

/// A lamp of a virtual room.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct TrueLamp {
    /// Its name.
    pub name: String,
    /// Lowest and highest corner, metres.
    pub bounds_m: [[f32; 3]; 2],
    /// Radiant flux that leaves it by condition, linear Rec.709: radiance × m² × sr; 0 where it is
    /// off.
    pub power: BTreeMap<String, [f32; 3]>,
}

/// The result of [`compare_lamps`]. True lamps are those that are on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LampComparison {
    /// The condition whose light was compared.
    pub condition: String,
    /// True lamps, in their order.
    pub lamps: Vec<ComparedLamp>,
    /// Names of found lamps that are no true lamp.
    pub false_lamps: Vec<String>,
    /// Number of true lamps that were found.
    pub num_found: usize,
    /// Share of the true lamps that were found; `None` if no lamp is on.
    pub recall: Option<f64>,
    /// Luminance of the power of all found lamps, false ones too, over that of all true lamps.
    pub total_ratio: Option<f64>,
    /// Median of |ratio − 1| of the true lamps that were found; `None` if none was.
    pub median_error: Option<f64>,
    /// Largest |ratio − 1| of the true lamps that were found; `None` if none was.
    pub largest_error: Option<f64>,
}

/// A true lamp and what was found of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedLamp {
    /// Its name.
    pub name: String,
    /// Names of the found lamps that are parts of it.
    pub found: Vec<String>,
    /// Its power, linear Rec.709.
    pub power: [f64; 3],
    /// Sum of the powers of its parts, linear Rec.709.
    pub found_power: [f64; 3],
    /// Luminance of the found power over that of the true one; `None` if nothing was found.
    pub ratio: Option<f64>,
    /// The same of each channel; `None` for a channel that is 0 in truth, too.
    pub ratio_rgb: [Option<f64>; 3],
}

impl TrueLamps {
    /// Reads the lamps of a `synth.json`.
    ///
    /// # Errors
    /// [`EvalError::Scene`] naming the file and field of what is missing or cannot be.
    pub fn read(path: &Path) -> Result<Self> {
        let invalid = |field: String, problem: String| SceneError::invalid(path, field, problem);
        let bytes = files::read(path)?;
        let truth: Self = serde_json::from_slice(&bytes)
            .map_err(|error| invalid("JSON".to_owned(), error.to_string()))?;
        if truth.conditions.is_empty() {
            return Err(invalid("conditions".to_owned(), "empty".to_owned()).into());
        }
        for (index, lamp) in truth.lamps.iter().enumerate() {
            let field = |key: &str| format!("lamps[{index}].{key}");
            let [low, high] = lamp.bounds_m;
            if low.iter().zip(high).any(|(low, high)| *low > high) {
                let problem = format!("{low:?} is above {high:?}");
                return Err(invalid(field("bounds_m"), problem).into());
            }
            for condition in &truth.conditions {
                let key = || field(&format!("power.{condition}"));
                let power = lamp.power.get(condition);
                let power = power.ok_or_else(|| invalid(key(), "missing".to_owned()))?;
                if let Some(value) = power.iter().find(|value| **value < 0.0) {
                    return Err(invalid(key(), format!("{value:?} is negative")).into());
                }
            }
        }
        Ok(truth)
    }
}

/// Finds the true lamp that each found one is a part of, and compares their powers under a
/// condition; without one, the first.
///
/// A found lamp belongs to a true one if its centre is in the box of that, grown by a margin, or
/// else if at least half of the smaller of both boxes, grown likewise, is in the other; of several
/// to the one whose box is most like its own: a globe beside a long strip is not a part of that.
/// Several found lamps may be parts of one.
///
/// # Errors
/// [`EvalError::Condition`] if there is no such condition.
pub fn compare_lamps(
    found: &Lamps,
    truth: &TrueLamps,
    condition: Option<&str>,
) -> Result<LampComparison> {
    let condition = match condition {
        Some(name) if !truth.conditions.iter().any(|known| known == name) => {
            return Err(EvalError::Condition {
                name: name.to_owned(),
                known: truth.conditions.clone(),
            });
        }
        Some(name) => name,
        None => truth.conditions.first().map_or("", String::as_str),
    };
    let power = |lamp: &TrueLamp| lamp.power.get(condition).copied().unwrap_or_default();
    let emitting = truth
        .lamps
        .iter()
        .filter(|lamp| luminance(power(lamp)) > 0.0);
    let emitting: Vec<&TrueLamp> = emitting.collect();
    let mut parts: Vec<Vec<&Lamp>> = vec![Vec::new(); emitting.len()];
    let mut false_lamps = Vec::new();
    for lamp in &found.lamps {
        match true_lamp(lamp, &emitting) {
            Some(index) => parts[index].push(lamp),
            None => false_lamps.push(lamp.name.clone()),
        }
    }
    let compared = emitting.iter().zip(&parts);
    let lamps: Vec<ComparedLamp> = compared
        .map(|(lamp, parts)| ComparedLamp::new(&lamp.name, power(lamp), parts))
        .collect();
    let num_found = parts.iter().filter(|parts| !parts.is_empty()).count();
    let mut errors: Vec<f64> = lamps.iter().filter_map(ComparedLamp::error).collect();
    errors.sort_by(f64::total_cmp);
    let total: f64 = lamps.iter().map(|lamp| luminance_f64(lamp.power)).sum();
    let all = found.lamps.iter();
    let total_found: f64 = all.map(|lamp| f64::from(lamp.luminous_power())).sum();
    Ok(LampComparison {
        condition: condition.to_owned(),
        recall: (!lamps.is_empty()).then(|| num_found as f64 / lamps.len() as f64),
        total_ratio: (total > 0.0).then(|| total_found / total),
        median_error: median(&errors),
        largest_error: errors.last().copied(),
        lamps,
        false_lamps,
        num_found,
    })
}

impl ComparedLamp {
    fn new(name: &str, power: [f32; 3], parts: &[&Lamp]) -> Self {
        let power = power.map(f64::from);
        let mut found_power = [0.0; 3];
        for part in parts {
            for (sum, value) in found_power.iter_mut().zip(part.power) {
                *sum += f64::from(value);
            }
        }
        let ratio = |found: f64, true_value: f64| {
            (!parts.is_empty() && true_value > 0.0).then(|| found / true_value)
        };
        Self {
            name: name.to_owned(),
            found: parts.iter().map(|part| part.name.clone()).collect(),
            power,
            found_power,
            ratio: ratio(luminance_f64(found_power), luminance_f64(power)),
            ratio_rgb: [0, 1, 2].map(|i| ratio(found_power[i], power[i])),
        }
    }

    /// Relative error of the power.
    fn error(&self) -> Option<f64> {
        self.ratio.map(|ratio| (ratio - 1.0).abs())
    }
}

/// Index of the true lamp that a found one is a part of.
fn true_lamp(lamp: &Lamp, all: &[&TrueLamp]) -> Option<usize> {
    let own = grown(lamp.bounds());
    let candidates = all.iter().enumerate().filter_map(|(index, other)| {
        let [low, high] = grown(other.bounds_m.map(Vec3::from));
        let holds = lamp.centre().cmpge(low).all() && lamp.centre().cmple(high).all();
        let [of_smaller, of_either] = overlap(own, [low, high]);
        (holds || of_smaller >= MIN_OVERLAP).then_some((holds, of_either, index))
    });
    let best = candidates.reduce(|best, next| {
        let order = (next.0).cmp(&best.0).then(next.1.total_cmp(&best.1));
        if order == Ordering::Greater {
            next
        } else {
            best
        }
    });
    best.map(|(_, _, index)| index)
}

fn grown([low, high]: [Vec3; 2]) -> [Vec3; 2] {
    let margin = Vec3::splat(BOX_MARGIN * (high - low).max_element());
    [low - margin, high + margin]
}

/// Volume in both boxes over that of the smaller, and over that in either.
fn overlap([low, high]: [Vec3; 2], [other_low, other_high]: [Vec3; 2]) -> [f32; 2] {
    let volume = |size: Vec3| size.max(Vec3::ZERO).element_product();
    let both = volume(high.min(other_high) - low.max(other_low));
    let [own, other] = [volume(high - low), volume(other_high - other_low)];
    [own.min(other), own + other - both].map(|volume| both / volume.max(f32::MIN_POSITIVE))
}

fn luminance_f64(rgb: [f64; 3]) -> f64 {
    f64::from(luminance(rgb.map(|value| value as f32)))
}

/// Median of sorted values: of an even number the mean of the two in the middle.
fn median(sorted: &[f64]) -> Option<f64> {
    let middle = sorted.len().checked_sub(1)?;
    Some(0.5 * (sorted[middle / 2] + sorted[middle.div_ceil(2)]))
}
