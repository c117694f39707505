//! Selectors in a script.

use super::shapes;
use crate::cluster::{Cluster, Reach};
use crate::quantity::Quantity;
use crate::select::{Definitions, Selector};
use eagpt_scene::Result;
use eagpt_scene::script::value::{
    Array, Form, Fraction, NonEmpty, NotNegative, Number, Positive, checked,
};
use eagpt_scene::script::{ScriptFile, Spanned};
use glam::Vec3;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeSet;

/// The name of the selection that is always there.
const EVERYTHING: &str = "everything";
/// Sizes of a step of a cluster whose reach is not given: neighbours on a surface are one or two
/// sizes apart.
const DEFAULT_REACH: f32 = 3.0;
/// Most selections that refer to each other in a row.
const MAX_DEPTH: usize = 16;

/// Whether a name cannot be given to a selection or a group.
pub(super) fn is_reserved(name: &str) -> bool {
    name == EVERYTHING || name.is_empty()
}

/// A selector as a script has it: a name, or conditions that all have to hold.
pub(super) type SelectorKeys = Form<Box<Conditions>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Conditions {
    #[serde(default, rename = "box", deserialize_with = "shapes::cuboid")]
    cuboid: Option<Selector>,
    #[serde(default, deserialize_with = "shapes::sphere")]
    sphere: Option<Selector>,
    #[serde(default, deserialize_with = "shapes::half_space")]
    half_space: Option<Selector>,
    #[serde(default, deserialize_with = "shapes::cylinder")]
    cylinder: Option<Selector>,
    emission: Option<Limits<Fraction>>,
    opacity: Option<Limits<Fraction>>,
    radiance: Option<Limits<NotNegative>>,
    albedo: Option<Limits<Fraction>>,
    size: Option<Limits<NotNegative>>,
    lamp: Option<Spanned<String>>,
    cluster: Option<ClusterKeys>,
    all: Option<NonEmpty<Spanned<SelectorKeys>>>,
    any: Option<NonEmpty<Spanned<SelectorKeys>>>,
    not: Option<Spanned<SelectorKeys>>,
}

struct ClusterKeys {
    seed: Vec3,
    reach: Reach,
    within: Option<Spanned<SelectorKeys>>,
}

/// A range of values.
struct Limits<T> {
    min: Option<T>,
    max: Option<T>,
}

/// The reader of selectors, with the names they may refer to.
pub(super) struct SelectorReader<'a> {
    pub(super) file: &'a ScriptFile,
    /// Names in `[selections]`.
    pub(super) defined: BTreeSet<String>,
    /// Names given by steps that have been read.
    pub(super) groups: BTreeSet<String>,
    /// Names and patterns of lamps that have been read.
    pub(super) lamps: Vec<Spanned<String>>,
    num_clusters: usize,
}

impl<'a> SelectorReader<'a> {
    pub(super) fn new(file: &'a ScriptFile, defined: BTreeSet<String>) -> Self {
        Self {
            file,
            defined,
            groups: BTreeSet::new(),
            lamps: Vec::new(),
            num_clusters: 0,
        }
    }

    pub(super) fn selector(&mut self, keys: &Spanned<SelectorKeys>) -> Result<Selector> {
        let problem = match keys.get_ref() {
            Form::Text(name) if name == EVERYTHING => return Ok(Selector::Everything),
            Form::Text(name) if self.defined.contains(name) => {
                return Ok(Selector::Named(name.clone()));
            }
            Form::Text(name) if self.groups.contains(name) => {
                return Ok(Selector::Group(name.clone()));
            }
            Form::Text(name) => {
                format!("`{name}` is no selection, and no earlier step has this name")
            }
            Form::Table(conditions) => {
                let mut all = self.conditions(conditions)?;
                match all.len() {
                    0 => "is empty: there are no conditions".to_owned(),
                    1 => return Ok(all.remove(0)),
                    _ => return Ok(Selector::All(all)),
                }
            }
            other => other.unfit("a name or a table of conditions"),
        };
        Err(self.file.error(keys.span(), problem))
    }

    fn conditions(&mut self, keys: &Conditions) -> Result<Vec<Selector>> {
        let shapes = [&keys.cuboid, &keys.sphere, &keys.half_space, &keys.cylinder];
        let ranges = [
            limits(Quantity::Emission, keys.emission.as_ref()),
            limits(Quantity::Opacity, keys.opacity.as_ref()),
            limits(Quantity::Radiance, keys.radiance.as_ref()),
            limits(Quantity::Albedo, keys.albedo.as_ref()),
            limits(Quantity::Size, keys.size.as_ref()),
        ];
        let shapes = shapes.into_iter().flatten().cloned();
        let mut all: Vec<Selector> = shapes.chain(ranges.into_iter().flatten()).collect();
        if let Some(lamp) = &keys.lamp {
            self.lamps.push(lamp.clone());
            all.push(Selector::Lamp(lamp.get_ref().clone()));
        }
        if let Some(cluster) = &keys.cluster {
            all.push(self.cluster(cluster)?);
        }
        if let Some(parts) = &keys.all {
            all.push(Selector::All(self.list(parts)?));
        }
        if let Some(parts) = &keys.any {
            all.push(Selector::Any(self.list(parts)?));
        }
        if let Some(part) = &keys.not {
            all.push(Selector::Not(Box::new(self.selector(part)?)));
        }
        Ok(all)
    }

    fn list(&mut self, parts: &NonEmpty<Spanned<SelectorKeys>>) -> Result<Vec<Selector>> {
        parts.0.iter().map(|part| self.selector(part)).collect()
    }

    fn cluster(&mut self, keys: &ClusterKeys) -> Result<Selector> {
        let within = match &keys.within {
            Some(selector) => self.selector(selector)?,
            None => Selector::Everything,
        };
        self.num_clusters += 1;
        let cluster = Cluster {
            id: self.num_clusters,
            seed: keys.seed,
            reach: keys.reach,
        };
        Ok(Selector::Cluster {
            cluster,
            within: Box::new(within),
        })
    }
}

fn limits<T: Copy + Into<f32>>(quantity: Quantity, limits: Option<&Limits<T>>) -> Option<Selector> {
    limits.map(|Limits { min, max }| Selector::Range {
        quantity,
        min: min.map_or(0.0, T::into),
        max: max.map_or(f32::INFINITY, T::into),
    })
}

impl<'de, T: Copy + Into<f32> + Deserialize<'de>> Deserialize<'de> for Limits<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Keys<T> {
            min: Option<T>,
            max: Option<T>,
        }

        checked(deserializer, |Keys { min, max }: Keys<T>| {
            match (min.map(T::into), max.map(T::into)) {
                (None, None) => return Err("has neither `min` nor `max`".to_owned()),
                (Some(min), Some(max)) if min > max => {
                    return Err(format!("min {min} is above max {max}"));
                }
                _ => {}
            }
            Ok(Self { min, max })
        })
    }
}

impl<'de> Deserialize<'de> for ClusterKeys {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Keys {
            seed: Array<Number, 3>,
            radius: Option<Positive>,
            reach: Option<Positive>,
            within: Option<Spanned<SelectorKeys>>,
        }

        checked(deserializer, |keys: Keys| {
            Ok(Self {
                seed: keys.seed.into(),
                reach: match (keys.radius, keys.reach) {
                    (Some(_), Some(_)) => {
                        return Err("a cluster has a `radius` or a `reach`, not both".to_owned());
                    }
                    (Some(radius), None) => Reach::Fixed(radius.into()),
                    (None, Some(sizes)) => Reach::Sizes(sizes.into()),
                    (None, None) => Reach::Sizes(DEFAULT_REACH),
                },
                within: keys.within,
            })
        })
    }
}

/// The problem of the names that a selector refers to, if they form a circle or are too deep.
pub(super) fn circle<'a>(
    selector: &'a Selector,
    definitions: &'a Definitions,
    path: &mut Vec<&'a str>,
) -> Option<String> {
    match selector {
        Selector::Named(name) => {
            if path.contains(&name.as_str()) {
                path.push(name);
                return Some(format!("refers to itself: {}", path.join(" → ")));
            }
            if path.len() >= MAX_DEPTH {
                return Some(format!(
                    "more than {MAX_DEPTH} selections refer to each other"
                ));
            }
            path.push(name);
            let problem = circle(&definitions[name], definitions, path);
            path.pop();
            problem
        }
        Selector::Cluster { within, .. } => circle(within, definitions, path),
        Selector::All(parts) | Selector::Any(parts) => parts
            .iter()
            .find_map(|part| circle(part, definitions, path)),
        Selector::Not(part) => circle(part, definitions, path),
        _ => None,
    }
}
