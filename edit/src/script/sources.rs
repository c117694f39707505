//! What a step acts on: a selection, a new surface, or a part of another scene.

use super::actions::placement;
use super::selectors::size;
use super::{Asset, Reader, Source};
use crate::insert::{MAX_DISCS, Material, Solid, Surface};
use crate::select::{Definitions, Selector};
use eagpt_scene::Result;
use eagpt_scene::ply;
use eagpt_scene::script::{Node, Table};
use glam::Quat;
use std::path::Path;

/// Keys that say what a surface is made of.
const MATERIAL: [&str; 3] = ["albedo", "radiance", "spacing"];
/// Sine of the smallest angle between the edges of a quad.
const MIN_SINE: f32 = 1e-3;

impl Reader {
    pub(super) fn source(
        &mut self,
        table: &Table<'_>,
        selections: &Definitions,
        script: &Path,
    ) -> Result<Source> {
        let (key, node) = table.one_of(&["select", "insert", "import"])?;
        let origin = node.origin();
        match key {
            "select" => Ok(Source::Select {
                selector: self.selector(&node)?,
                origin,
            }),
            "insert" => Ok(Source::Insert {
                surface: surface(&node)?,
                origin,
            }),
            _ => self.import(&node, selections, script),
        }
    }

    fn import(
        &mut self,
        node: &Node<'_>,
        selections: &Definitions,
        script: &Path,
    ) -> Result<Source> {
        let table = node.table(&["file", "select", "scale", "rotate", "about", "move", "to"])?;
        let selector = match table.get("select") {
            Some(node) => {
                let selector = self.selector(&node)?;
                let is_group = |part: &Selector| matches!(part, Selector::Group(_));
                if selector.mentions(selections, &is_group) {
                    return Err(node.error(
                        "refers to what a step of this script made, which the other scene does not have",
                    ));
                }
                selector
            }
            None => Selector::Everything,
        };
        let placement = placement(&table)?;
        Ok(Source::Import {
            asset: self.asset(&table.need("file")?, script)?,
            selector,
            placement,
            origin: node.origin(),
        })
    }

    /// The index of a scene, read if it has not been.
    fn asset(&mut self, node: &Node<'_>, script: &Path) -> Result<usize> {
        let name = node.string()?;
        if name.is_empty() {
            return Err(node.error("a file name may not be empty"));
        }
        let path = script.parent().unwrap_or(Path::new("")).join(name);
        if let Some(index) = self.assets.iter().position(|asset| asset.path == path) {
            return Ok(index);
        }
        let bytes = std::fs::read(&path)
            .map_err(|error| node.error(format!("{}: read: {error}", path.display())))?;
        let gaussians =
            ply::read_gaussians(&path).map_err(|error| node.error(error.to_string()))?;
        self.assets.push(Asset {
            path,
            blake3: blake3::hash(&bytes).to_hex().to_string(),
            gaussians,
        });
        Ok(self.assets.len() - 1)
    }
}

fn surface(node: &Node<'_>) -> Result<Surface> {
    let table = node.table(&["ball", "quad", "box"])?;
    let (shape, node) = table.one_of(&["ball", "quad", "box"])?;
    let known = |own: &[&'static str]| [own, MATERIAL.as_slice()].concat();
    let (table, solid) = match shape {
        "ball" => {
            let table = node.table(&known(&["centre", "radius"]))?;
            let centre = table.need("centre")?.vec3()?;
            let radius = table.need("radius")?.positive()?;
            (table, Solid::Ball { centre, radius })
        }
        "quad" => {
            let table = node.table(&known(&["centre", "u", "v"]))?;
            let (u, v) = (table.need("u")?, table.need("v")?);
            let edges = [u.vec3()?, v.vec3()?];
            let least = MIN_SINE * edges[0].length() * edges[1].length();
            if edges[0].cross(edges[1]).length() <= least {
                return Err(v.error(format!("{} is parallel to u {}", edges[1], edges[0])));
            }
            let centre = table.need("centre")?.vec3()?;
            (table, Solid::Quad { centre, edges })
        }
        _ => {
            let table = node.table(&known(&["centre", "size", "rotate"]))?;
            let centre = table.need("centre")?.vec3()?;
            let size = size(&table.need("size")?)?;
            let rotation = match table.get("rotate") {
                Some(node) => node.rotation()?,
                None => Quat::IDENTITY,
            };
            let solid = Solid::Box {
                centre,
                size,
                rotation,
            };
            (table, solid)
        }
    };
    let surface = Surface {
        solid,
        material: material(&table)?,
        spacing: match table.get("spacing") {
            Some(node) => Some(node.positive()?),
            None => None,
        },
    };
    let num = surface.num_discs();
    if num > MAX_DISCS as f64 {
        let about = table.get("spacing").unwrap_or(table.node);
        return Err(about.error(format!(
            "a surface of {num:.0} discs: more than {MAX_DISCS} are not made"
        )));
    }
    Ok(surface)
}

fn material(table: &Table<'_>) -> Result<Material> {
    if table.get("albedo").is_none() && table.get("radiance").is_none() {
        return Err(table.node.error("has neither `albedo` nor `radiance`"));
    }
    Ok(Material {
        albedo: match table.get("albedo") {
            Some(node) => node.albedo()?,
            None => glam::Vec3::ZERO,
        },
        radiance: match table.get("radiance") {
            Some(node) => Some(node.color()?),
            None => None,
        },
    })
}
