//! Selectors in a script.

use super::Reader;
use crate::cluster::{Cluster, Step};
use crate::select::{Definitions, Quantity, Selector};
use crate::shape::Shape;
use eagpt_scene::Result;
use eagpt_scene::script::{Node, Table};
use glam::{Quat, Vec3};
use std::collections::BTreeSet;

/// The name of the selection that is always there.
const EVERYTHING: &str = "everything";
/// Sizes of a step of a cluster that says nothing else: neighbours on a surface are one or two
/// sizes apart.
const DEFAULT_REACH: f32 = 3.0;
/// Most selections that refer to each other in a row.
const MAX_DEPTH: usize = 16;

const KEYS: [&str; 13] = [
    "box",
    "sphere",
    "half_space",
    "cylinder",
    "emission",
    "opacity",
    "radiance",
    "albedo",
    "size",
    "cluster",
    "all",
    "any",
    "not",
];

/// A name that a selection or a group may have.
pub(super) fn name<'a>(node: &Node<'a>) -> Result<&'a str> {
    match node.string()? {
        EVERYTHING => Err(node.error("`everything` is always there and cannot be given anew")),
        "" => Err(node.error("a name may not be empty")),
        name => Ok(name),
    }
}

impl Reader {
    /// The named selections. `all_groups` are the names that steps will give.
    pub(super) fn selections(
        &mut self,
        table: &Table<'_>,
        all_groups: BTreeSet<String>,
    ) -> Result<Definitions> {
        for (name, node) in table.entries() {
            if name == EVERYTHING || name.is_empty() {
                return Err(node.error("this name cannot be given"));
            }
            self.defined.insert(name.to_owned());
        }
        let read_groups = std::mem::replace(&mut self.groups, all_groups);
        let mut definitions = Definitions::new();
        for (name, node) in table.entries() {
            definitions.insert(name.to_owned(), self.selector(&node)?);
        }
        self.groups = read_groups;
        for (name, node) in table.entries() {
            let mut path = vec![name];
            if let Some(problem) = circle(&definitions[name], &definitions, &mut path) {
                return Err(node.error(problem));
            }
        }
        Ok(definitions)
    }

    /// A selector: a name, or a table of conditions that all have to hold.
    pub(super) fn selector(&mut self, node: &Node<'_>) -> Result<Selector> {
        if !node.is_table() {
            let name = node.string()?;
            return match name {
                EVERYTHING => Ok(Selector::Everything),
                _ if self.defined.contains(name) => Ok(Selector::Named(name.to_owned())),
                _ if self.groups.contains(name) => Ok(Selector::Group(name.to_owned())),
                _ => Err(node.error(format!(
                    "`{name}` is no selection, and no earlier step has this name"
                ))),
            };
        }
        let table = node.table(&KEYS)?;
        let mut conditions = Vec::new();
        for key in KEYS {
            if let Some(node) = table.get(key) {
                conditions.push(self.condition(key, &node)?);
            }
        }
        match conditions.len() {
            0 => Err(node.error(format!("is empty; conditions are {}", KEYS.join(", ")))),
            1 => Ok(conditions.remove(0)),
            _ => Ok(Selector::All(conditions)),
        }
    }

    fn condition(&mut self, key: &str, node: &Node<'_>) -> Result<Selector> {
        let range = |quantity| range(node, quantity);
        match key {
            "box" => shape_box(node).map(Selector::Shape),
            "sphere" => {
                let table = node.table(&["centre", "radius"])?;
                Ok(Selector::Shape(Shape::Sphere {
                    centre: table.need("centre")?.vec3()?,
                    radius: table.need("radius")?.positive()?,
                }))
            }
            "half_space" => {
                let table = node.table(&["point", "normal"])?;
                Ok(Selector::Shape(Shape::HalfSpace {
                    point: table.need("point")?.vec3()?,
                    normal: table.need("normal")?.direction()?,
                }))
            }
            "cylinder" => shape_cylinder(node).map(Selector::Shape),
            "emission" => range(Quantity::Emission),
            "opacity" => range(Quantity::Opacity),
            "radiance" => range(Quantity::Radiance),
            "albedo" => range(Quantity::Albedo),
            "size" => range(Quantity::Size),
            "cluster" => self.cluster(node),
            "all" => self.list(node).map(Selector::All),
            "any" => self.list(node).map(Selector::Any),
            _ => Ok(Selector::Not(Box::new(self.selector(node)?))),
        }
    }

    fn list(&mut self, node: &Node<'_>) -> Result<Vec<Selector>> {
        let nodes = node.array()?;
        if nodes.is_empty() {
            return Err(node.error("is empty"));
        }
        nodes.iter().map(|node| self.selector(node)).collect()
    }

    fn cluster(&mut self, node: &Node<'_>) -> Result<Selector> {
        let table = node.table(&["seed", "radius", "reach", "within"])?;
        let step = match (table.get("radius"), table.get("reach")) {
            (Some(_), Some(reach)) => {
                return Err(reach.error("a step has a `radius` or a `reach`, not both"));
            }
            (Some(radius), None) => Step::Fixed(radius.positive()?),
            (None, Some(reach)) => Step::Sizes(reach.positive()?),
            (None, None) => Step::Sizes(DEFAULT_REACH),
        };
        let within = match table.get("within") {
            Some(node) => self.selector(&node)?,
            None => Selector::Everything,
        };
        self.num_clusters += 1;
        Ok(Selector::Cluster(Box::new(Cluster {
            id: self.num_clusters,
            seed: table.need("seed")?.vec3()?,
            step,
            within,
        })))
    }
}

fn range(node: &Node<'_>, quantity: Quantity) -> Result<Selector> {
    let table = node.table(&["min", "max"])?;
    let end = |key: &str, otherwise: f32| match table.get(key) {
        Some(node) => {
            let value = node.not_negative()?;
            let is_share = !matches!(quantity, Quantity::Radiance | Quantity::Size);
            if is_share && value > 1.0 {
                return Err(node.error(format!("{value} is outside 0 to 1")));
            }
            Ok(value)
        }
        None => Ok(otherwise),
    };
    let (min, max) = (end("min", 0.0)?, end("max", f32::INFINITY)?);
    if table.get("min").is_none() && table.get("max").is_none() {
        return Err(node.error("has neither `min` nor `max`"));
    }
    if min > max {
        return Err(node.error(format!("min {min} is above max {max}")));
    }
    Ok(Selector::Range { quantity, min, max })
}

fn shape_box(node: &Node<'_>) -> Result<Shape> {
    let table = node.table(&["min", "max", "centre", "size", "rotate"])?;
    let (centre, half) = if let ("min", low) = table.one_of(&["min", "centre"])? {
        for key in ["size", "rotate"] {
            if let Some(extra) = table.get(key) {
                return Err(extra.error("belongs to a box of `centre` and `size`"));
            }
        }
        let (low, high) = (low.vec3()?, table.need("max")?.vec3()?);
        if low.cmpge(high).any() {
            return Err(node.error(format!("min {low} is not below max {high}")));
        }
        (0.5 * (low + high), 0.5 * (high - low))
    } else {
        if let Some(extra) = table.get("max") {
            return Err(extra.error("belongs to a box of `min` and `max`"));
        }
        let half = 0.5 * size(&table.need("size")?)?;
        (table.need("centre")?.vec3()?, half)
    };
    let rotation = match table.get("rotate") {
        Some(node) => node.rotation()?,
        None => Quat::IDENTITY,
    };
    Ok(Shape::Box {
        centre,
        half,
        rotation,
    })
}

fn shape_cylinder(node: &Node<'_>) -> Result<Shape> {
    let table = node.table(&["from", "to", "radius"])?;
    let (from, to) = (table.need("from")?.vec3()?, table.need("to")?.vec3()?);
    if from == to {
        return Err(node.error(format!("from and to are the same point {from}")));
    }
    Ok(Shape::Cylinder {
        from,
        to,
        radius: table.need("radius")?.positive()?,
    })
}

/// Three edge lengths, positive.
pub(super) fn size(node: &Node<'_>) -> Result<Vec3> {
    let size = node.vec3()?;
    if size.cmple(Vec3::ZERO).any() {
        return Err(node.error(format!("{size}: an edge is not above 0")));
    }
    Ok(size)
}

/// What is wrong with the names that a selector refers to, if they lead in a circle or too deep.
fn circle<'a>(
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
        Selector::Cluster(cluster) => circle(&cluster.within, definitions, path),
        Selector::All(parts) | Selector::Any(parts) => parts
            .iter()
            .find_map(|part| circle(part, definitions, path)),
        Selector::Not(part) => circle(part, definitions, path),
        _ => None,
    }
}
