//! `[materials]`: what surfaces are made of.

use super::{Names, albedo, positive_or};
use crate::room::pattern::{Pattern, Texture};
use crate::room::{Gloss, Material};
use eagpt_scene::Result;
use eagpt_scene::script::{Node, Table};
use glam::{Vec2, Vec3};

/// Keys that name a pattern.
const PATTERNS: [&str; 9] = [
    "plain",
    "checker",
    "stripes",
    "noise",
    "bricks",
    "wood",
    "rug",
    "landscape",
    "motif",
];

pub(super) fn materials(node: &Node<'_>) -> Result<(Names, Vec<Material>)> {
    let (mut names, mut materials) = (Names::new(), Vec::new());
    for (name, node) in node.any_table()?.entries() {
        names.insert(name.to_owned(), materials.len() as u32);
        materials.push(material(&node)?);
    }
    Ok((names, materials))
}

fn material(node: &Node<'_>) -> Result<Material> {
    // A colour alone is a plain material.
    if !node.is_table() {
        return Ok(Material {
            texture: Texture::plain(albedo(node)?),
            gloss: None,
        });
    }
    let table = node.table(&[&PATTERNS[..], &["grain", "gloss"]].concat())?;
    let (kind, value) = table.one_of(&PATTERNS)?;
    Ok(Material {
        texture: Texture {
            pattern: pattern(kind, &value)?,
            grain: share(&table, "grain")?.unwrap_or(0.0),
        },
        gloss: match table.get("gloss") {
            Some(node) => {
                let table = node.table(&["reflectance", "roughness"])?;
                Some(Gloss {
                    reflectance: share(&table, "reflectance")?.unwrap_or(0.04),
                    roughness: share(&table, "roughness")?.unwrap_or(0.1),
                })
            }
            None => None,
        },
    })
}

fn pattern(kind: &str, node: &Node<'_>) -> Result<Pattern> {
    if kind == "plain" {
        return Ok(Pattern::Plain(albedo(node)?));
    }
    let known: &[&str] = match kind {
        "landscape" => &["seed"],
        "bricks" => &["colors", "size", "joint"],
        _ => &["colors", "size"],
    };
    let table = node.table(known)?;
    Ok(match kind {
        "checker" => Pattern::Checker {
            colors: colors(&table)?,
            size: positive_or(&table, "size", 0.3)?,
        },
        "stripes" => Pattern::Stripes {
            colors: stripes(&table.need("colors")?)?,
            size: positive_or(&table, "size", 0.1)?,
        },
        "noise" => Pattern::Noise {
            colors: colors(&table)?,
            size: positive_or(&table, "size", 0.3)?,
        },
        "bricks" => Pattern::Bricks {
            colors: colors(&table)?,
            size: size2(&table, [0.24, 0.08])?,
            joint: positive_or(&table, "joint", 0.01)?,
        },
        "wood" => Pattern::Wood {
            colors: colors(&table)?,
            size: size2(&table, [1.2, 0.12])?,
        },
        "rug" => Pattern::Rug {
            colors: colors(&table)?,
            size: positive_or(&table, "size", 0.3)?,
        },
        "motif" => Pattern::Motif {
            colors: colors(&table)?,
            size: positive_or(&table, "size", 0.2)?,
        },
        _ => Pattern::Landscape {
            seed: match table.get("seed") {
                Some(node) => node.whole(0..=u32::MAX)?,
                None => 0,
            },
        },
    })
}

fn colors<const N: usize>(table: &Table<'_>) -> Result<[Vec3; N]> {
    let node = table.need("colors")?;
    let items = node.array()?;
    if items.len() != N {
        return Err(node.error(format!("has {} colours, not {N}", items.len())));
    }
    let mut all = [Vec3::ZERO; N];
    for (slot, item) in all.iter_mut().zip(&items) {
        *slot = albedo(item)?;
    }
    Ok(all)
}

fn stripes(node: &Node<'_>) -> Result<Vec<Vec3>> {
    let items = node.array()?;
    if items.is_empty() {
        return Err(node.error("has no colours"));
    }
    items.iter().map(albedo).collect()
}

fn size2(table: &Table<'_>, default: [f32; 2]) -> Result<Vec2> {
    let Some(node) = table.get("size") else {
        return Ok(Vec2::from_array(default));
    };
    let [x, y] = node.fixed_array()?;
    Ok(Vec2::new(x.positive()?, y.positive()?))
}

/// A number from 0 to 1.
fn share(table: &Table<'_>, key: &str) -> Result<Option<f32>> {
    let Some(node) = table.get(key) else {
        return Ok(None);
    };
    let value = node.not_negative()?;
    if value > 1.0 {
        return Err(node.error(format!("{value} is above 1")));
    }
    Ok(Some(value))
}
