//! Scene files: the room, its lights in each condition, the cameras and the rig, as TOML.
//!
//! The grammar stands in the documentation of the crate.

mod cameras;
mod furniture;
mod materials;
mod objects;

use crate::rig::Rig;
use crate::room::{Light, MAX_CONDITIONS, Material, Room};
use eagpt_scene::script::{Node, Table, Text};
use eagpt_scene::{Result, files};
use glam::Vec3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub use cameras::{CameraPlan, Ring};

/// A scene file, read and checked.
#[derive(Debug, Clone)]
pub struct SceneScript {
    /// The file; the name of an embedded scene if it is none.
    pub path: PathBuf,
    /// BLAKE3 digest of the text, hexadecimal.
    pub blake3: String,
    /// Title for people.
    pub title: String,
    /// The room.
    pub room: Room,
    /// Names of the conditions, in the order of the room's.
    pub conditions: Vec<String>,
    /// Where photographs are taken from.
    pub cameras: CameraPlan,
    /// What they are taken with.
    pub rig: Rig,
}

/// Names of materials or lights with their index.
type Names = BTreeMap<String, u32>;

impl SceneScript {
    /// Reads a scene file.
    ///
    /// # Errors
    /// [`eagpt_scene::SceneError`] naming file, line and key.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &files::read(path)?)
    }

    /// Reads the text of a scene file called `path`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let text = Text::new(path, bytes)?;
        let value = text.parse()?;
        let root = Node::root(text, &value);
        let table = root.table(&[
            "title",
            "materials",
            "lights",
            "condition",
            "object",
            "cameras",
            "rig",
        ])?;
        let (material_names, materials) = materials::materials(&table.need("materials")?)?;
        let conditions = conditions(&table.need("condition")?)?;
        let (light_names, lights) = lights(&table.need("lights")?, &conditions)?;
        let surfaces = objects::surfaces(
            &table.need("object")?,
            &objects::Vocabulary {
                materials: material_names,
                lights: light_names,
            },
        )?;
        let names = conditions
            .into_iter()
            .map(|(name, _)| name)
            .collect::<Vec<_>>();
        Ok(Self {
            path: path.to_owned(),
            blake3: blake3::hash(bytes).to_hex().to_string(),
            title: match table.get("title") {
                Some(node) => node.string()?.to_owned(),
                None => String::new(),
            },
            room: room(surfaces, materials, lights, names.len()),
            conditions: names,
            cameras: cameras::plan(&table.need("cameras")?)?,
            rig: match table.get("rig") {
                Some(node) => Rig::read(&node)?,
                None => Rig::default(),
            },
        })
    }
}

fn room(
    surfaces: Vec<crate::room::Surface>,
    materials: Vec<Material>,
    lights: Vec<Light>,
    num_conditions: usize,
) -> Room {
    Room::new(surfaces, materials, lights, num_conditions)
}

/// Names of the conditions, with their tables of lights.
fn conditions<'a>(node: &Node<'a>) -> Result<Vec<(String, Option<Node<'a>>)>> {
    let mut found: Vec<(String, Option<Node<'a>>)> = Vec::new();
    let nodes = node.array()?;
    if nodes.is_empty() || nodes.len() > MAX_CONDITIONS {
        let num = nodes.len();
        return Err(node.error(format!(
            "{num} conditions: 1 to {MAX_CONDITIONS} are possible"
        )));
    }
    for node in nodes {
        let table = node.table(&["name", "lights"])?;
        let name_node = table.need("name")?;
        let name = file_name(&name_node)?;
        if found.iter().any(|(other, _)| *other == name) {
            return Err(name_node.error(format!("`{name}` is there already")));
        }
        found.push((name, table.get("lights")));
    }
    Ok(found)
}

/// A name that files and folders can have on any system.
fn file_name(node: &Node<'_>) -> Result<String> {
    let name = node.string()?;
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || name.len() > 40 || !name.chars().all(allowed) {
        return Err(node.error(format!(
            "`{}` is no name: 1 to 40 letters, digits, - and _",
            name.escape_debug()
        )));
    }
    Ok(name.to_owned())
}

fn lights(
    node: &Node<'_>,
    conditions: &[(String, Option<Node<'_>>)],
) -> Result<(Names, Vec<Light>)> {
    let (mut names, mut lights) = (Names::new(), Vec::new());
    for (name, node) in node.any_table()?.entries() {
        names.insert(name.to_owned(), lights.len() as u32);
        lights.push((name.to_owned(), color(&node)?));
    }
    let mut switched: Vec<Light> = lights
        .iter()
        .map(|(name, _)| Light {
            name: name.clone(),
            radiance: [Vec3::ZERO; MAX_CONDITIONS],
        })
        .collect();
    for (condition, (_, node)) in conditions.iter().enumerate() {
        let Some(node) = node else { continue };
        for (name, factor) in node.any_table()?.entries() {
            let Some(&index) = names.get(name) else {
                return Err(unknown(&factor, name, &names, "light"));
            };
            let index = index as usize;
            switched[index].radiance[condition] = lights[index].1 * factor.not_negative()?;
        }
    }
    Ok((names, switched))
}

fn unknown(node: &Node<'_>, name: &str, names: &Names, what: &str) -> eagpt_scene::SceneError {
    let all: Vec<&str> = names.keys().map(String::as_str).collect();
    node.error(format!(
        "there is no {what} `{}`; there are {}",
        name.escape_debug(),
        all.join(", ")
    ))
}

/// A linear Rec.709 colour: a number, three of them, or `"#rrggbb"` as displays show it.
fn color(node: &Node<'_>) -> Result<Vec3> {
    let Ok(text) = node.string() else {
        return node.color();
    };
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6);
    let value = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let Some(value) = value else {
        let text = text.escape_debug();
        return Err(node.error(format!("`{text}` is no colour like \"#c0a080\"")));
    };
    let channel =
        |shift: u32| eagpt_scene::color::linear_from_srgb((value >> shift & 255) as f32 / 255.0);
    Ok(Vec3::new(channel(16), channel(8), channel(0)))
}

/// A colour with all channels at most 1.
fn albedo(node: &Node<'_>) -> Result<Vec3> {
    let color = color(node)?;
    if color.max_element() > 1.0 {
        return Err(node.error(format!("{color} is above 1")));
    }
    Ok(color)
}

/// An optional number above 0.
fn positive_or(table: &Table<'_>, key: &str, default: f32) -> Result<f32> {
    table.get(key).map_or(Ok(default), |node| node.positive())
}
