//! Selectors of Gaussians: regions, ranges of values, connected clusters, and combinations of them.

use crate::cluster::Cluster;
use crate::quantity::Quantity;
use crate::shape::Shape;
use eagpt_scene::lamps::EMISSION_THRESHOLD;
use eagpt_scene::{Gaussians, Lamps};
use glam::Vec3;
use std::collections::BTreeMap;

/// A condition that a Gaussian meets or not.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Selector {
    /// Always.
    Everything,
    /// The selection of this name.
    Named(String),
    /// Gaussians that an earlier step acted on and named.
    Group(String),
    /// The centre lies in a region.
    Shape(Shape),
    /// A value lies in a range, ends included.
    Range {
        /// The value.
        quantity: Quantity,
        /// Least value.
        min: f32,
        /// Largest value.
        max: f32,
    },
    /// It emits, and belongs to a lamp whose name fits this pattern.
    Lamp(String),
    /// Reached from a seed point in steps on Gaussians of a selection.
    Cluster {
        cluster: Cluster,
        within: Box<Selector>,
    },
    /// All of them.
    All(Vec<Selector>),
    /// At least one of them.
    Any(Vec<Selector>),
    /// Not this one.
    Not(Box<Selector>),
}

/// Selections by their names.
pub(crate) type Definitions = BTreeMap<String, Selector>;

/// Groups by their names: for each Gaussian, whether it belongs.
pub(crate) type Groups = BTreeMap<String, Vec<bool>>;

/// A scene with what selectors refer to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scope<'a> {
    pub(crate) gaussians: &'a Gaussians,
    pub(crate) definitions: &'a Definitions,
    pub(crate) groups: &'a Groups,
    /// Lamps where training has found them, wherever their Gaussians have gone.
    pub(crate) lamps: &'a Lamps,
}

impl<'a> Scope<'a> {
    /// Makes a selector ready for questions: finds its clusters and lamps.
    pub(crate) fn prepare(self, selector: &'a Selector) -> Prepared<'a> {
        let mut prepared = Prepared {
            scope: self,
            selector,
            clusters: BTreeMap::new(),
            lamps: BTreeMap::new(),
        };
        prepared.find(selector);
        prepared
    }
}

/// A selector ready for questions about one scene.
pub(crate) struct Prepared<'a> {
    scope: Scope<'a>,
    selector: &'a Selector,
    clusters: BTreeMap<usize, Vec<bool>>,
    /// By pattern: for each lamp, whether its name fits.
    lamps: BTreeMap<&'a str, Vec<bool>>,
}

impl<'a> Prepared<'a> {
    /// Whether each Gaussian is selected.
    pub(crate) fn mask(&self) -> Vec<bool> {
        let positions = self.scope.gaussians.positions.iter().enumerate();
        positions
            .map(|(index, &position)| self.holds(index, position))
            .collect()
    }

    /// Whether Gaussian `index` would be selected if its centre were at `point`, with clusters and
    /// groups as they are.
    pub(crate) fn holds(&self, index: usize, point: Vec3) -> bool {
        self.meets(self.selector, index, point)
    }

    fn meets(&self, selector: &Selector, index: usize, point: Vec3) -> bool {
        let Scope {
            gaussians,
            definitions,
            groups,
            lamps,
        } = self.scope;
        match selector {
            Selector::Everything => true,
            Selector::Named(name) => self.meets(&definitions[name], index, point),
            // A group whose step has not run in this scene has no members.
            Selector::Group(name) => groups.get(name).is_some_and(|members| members[index]),
            Selector::Shape(shape) => shape.contains(point),
            Selector::Range { quantity, min, max } => {
                (*min..=*max).contains(&quantity.of(gaussians, index))
            }
            Selector::Lamp(pattern) => {
                gaussians.emissions[index] > EMISSION_THRESHOLD
                    && lamps
                        .of(point)
                        .is_some_and(|lamp| self.lamps[pattern.as_str()][lamp])
            }
            Selector::Cluster { cluster, .. } => self.clusters[&cluster.id][index],
            Selector::All(parts) => parts.iter().all(|part| self.meets(part, index, point)),
            Selector::Any(parts) => parts.iter().any(|part| self.meets(part, index, point)),
            Selector::Not(part) => !self.meets(part, index, point),
        }
    }

    /// Finds the clusters and lamps that a selector refers to.
    fn find(&mut self, selector: &'a Selector) {
        match selector {
            Selector::Named(name) => {
                let definitions = self.scope.definitions;
                self.find(&definitions[name]);
            }
            Selector::Lamp(pattern) => {
                let lamps = self.scope.lamps;
                let mut fitting = vec![false; lamps.lamps.len()];
                for index in lamps.matching(pattern) {
                    fitting[index] = true;
                }
                self.lamps.insert(pattern, fitting);
            }
            Selector::Cluster { cluster, within } if !self.clusters.contains_key(&cluster.id) => {
                let candidates = self.scope.prepare(within).mask();
                let members = cluster.members(self.scope.gaussians, &candidates);
                self.clusters.insert(cluster.id, members);
            }
            Selector::All(parts) | Selector::Any(parts) => {
                for part in parts {
                    self.find(part);
                }
            }
            Selector::Not(part) => self.find(part),
            _ => {}
        }
    }
}

impl Selector {
    /// Whether `holds` for this selector or a part of it, parts of named selections included.
    pub(crate) fn mentions(
        &self,
        definitions: &Definitions,
        holds: &dyn Fn(&Selector) -> bool,
    ) -> bool {
        if holds(self) {
            return true;
        }
        match self {
            Self::Named(name) => definitions[name].mentions(definitions, holds),
            Self::Cluster { within, .. } => within.mentions(definitions, holds),
            Self::All(parts) | Self::Any(parts) => {
                parts.iter().any(|part| part.mentions(definitions, holds))
            }
            Self::Not(part) => part.mentions(definitions, holds),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::disc;
    use eagpt_scene::Gaussian;

    fn row() -> Gaussians {
        let at = |i: u8| {
            let share = f32::from(i) / 4.0;
            Gaussian {
                emission: share,
                opacity: 1.0 - share,
                radiance: Vec3::splat(f32::from(i)),
                albedo: Vec3::new(0.0, share, 0.0),
                scale: glam::Vec2::new(0.1, 0.1 * f32::from(i * i) + 0.1),
                ..disc(Vec3::new(f32::from(i), 0.0, 0.0))
            }
        };
        (0..5).map(at).collect()
    }

    fn chosen(selector: &Selector, definitions: &Definitions, groups: &Groups) -> Vec<usize> {
        let gaussians = row();
        let scope = Scope {
            gaussians: &gaussians,
            definitions,
            groups,
            lamps: &Lamps::default(),
        };
        let mask = scope.prepare(selector).mask();
        (0..mask.len()).filter(|i| mask[*i]).collect()
    }

    #[test]
    fn ranges_include_their_ends() {
        for (quantity, min, max, expected) in [
            (Quantity::Emission, 0.25, 0.5, vec![1, 2]),
            (Quantity::Opacity, 0.5, 1.0, vec![0, 1, 2]),
            (Quantity::Radiance, 2.9, f32::INFINITY, vec![3, 4]),
            // Green weighs 0.7152.
            (Quantity::Albedo, 0.0, 0.36, vec![0, 1, 2]),
            // Sizes are 0.1 √(1 + i²).
            (Quantity::Size, 0.14, 0.23, vec![1, 2]),
        ] {
            let range = Selector::Range { quantity, min, max };
            let found = chosen(&range, &Definitions::new(), &Groups::new());
            assert_eq!(found, expected, "{range:?}");
        }
    }

    #[test]
    fn combinations_names_and_groups() {
        let above = |least: f32| {
            Selector::Shape(Shape::HalfSpace {
                point: Vec3::new(least, 0.0, 0.0),
                normal: Vec3::X,
            })
        };
        let definitions = Definitions::from([("right".to_owned(), above(2.5))]);
        let groups = Groups::from([("ends".to_owned(), vec![true, false, false, false, true])]);
        let right = Selector::Named("right".to_owned());
        let ends = Selector::Group("ends".to_owned());
        for (selector, expected) in [
            (Selector::Everything, vec![0, 1, 2, 3, 4]),
            (right.clone(), vec![3, 4]),
            (Selector::Not(right.clone().into()), vec![0, 1, 2]),
            (Selector::All(vec![right.clone(), ends.clone()]), vec![4]),
            (Selector::Any(vec![right, ends]), vec![0, 3, 4]),
            (Selector::Group("later".to_owned()), vec![]),
        ] {
            let found = chosen(&selector, &definitions, &groups);
            assert_eq!(found, expected, "{selector:?}");
        }
    }
}
