//! Scene files: the room, its lights in each condition, the cameras and the rig, as TOML.
//!
//! The grammar is in the documentation of the crate.

mod builder;
mod cameras;
mod decor;
mod furniture;
mod materials;
mod objects;
mod solids;

use crate::rig::Rig;
use crate::room::{Light, MAX_CONDITIONS, Material, Room};
use builder::Vocabulary;
use eagpt_scene::script::value::{Form, NotNegative, checked};
use eagpt_scene::script::{ScriptFile, Spanned};
use eagpt_scene::{Result, SceneError, files};
use glam::Vec3;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) use cameras::CameraPlan;

/// A scene file, read and checked.
#[derive(Debug, Clone)]
pub struct SceneScript {
    /// The file; the name of an embedded scene if it is none.
    pub path: PathBuf,
    /// BLAKE3 digest of the text, hexadecimal.
    pub blake3: String,
    /// Title.
    pub title: String,
    /// The room.
    pub(crate) room: Room,
    /// Names of the conditions, in the order of the room's.
    pub conditions: Vec<String>,
    /// Positions that photographs are taken from.
    pub(crate) cameras: CameraPlan,
    /// Camera that takes them.
    pub rig: Rig,
}

/// A scene as its file has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneKeys {
    #[serde(default)]
    title: String,
    materials: BTreeMap<String, Material>,
    lights: BTreeMap<String, Color>,
    condition: Spanned<Vec<ConditionKeys>>,
    object: Spanned<Vec<Spanned<objects::ObjectKeys>>>,
    cameras: CameraPlan,
    #[serde(default)]
    rig: Option<Spanned<Rig>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConditionKeys {
    name: Spanned<FileName>,
    #[serde(default)]
    lights: BTreeMap<String, Spanned<NotNegative>>,
}

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
        let file = ScriptFile::new(path, bytes.to_vec())?;
        let keys: SceneKeys = file.parse()?;
        let lights = keys.lights(&file)?;
        let conditions: Vec<String> = keys
            .condition
            .into_inner()
            .into_iter()
            .map(|condition| condition.name.into_inner().0)
            .collect();
        let words = Vocabulary {
            file: &file,
            materials: keys.materials.keys().map(String::as_str).collect(),
            lights: keys.lights.keys().map(String::as_str).collect(),
        };
        let surfaces = objects::surfaces(&words, &keys.object)?;
        let rig = match keys.rig {
            Some(rig) if rig.get_ref().black >= rig.get_ref().white => {
                let Rig { black, white, .. } = rig.get_ref();
                let problem = format!("black {black} is not below white {white}");
                return Err(file.error(rig.span(), problem));
            }
            Some(rig) => rig.into_inner(),
            None => Rig::default(),
        };
        let materials = keys.materials.into_values().collect();
        Ok(Self {
            path: path.to_owned(),
            blake3: blake3::hash(bytes).to_hex().to_string(),
            title: keys.title,
            room: Room::new(surfaces, materials, lights, conditions.len()),
            conditions,
            cameras: keys.cameras,
            rig,
        })
    }
}

impl SceneKeys {
    /// The lights as the conditions switch them.
    fn lights(&self, file: &ScriptFile) -> Result<Vec<Light>> {
        let conditions = self.condition.get_ref();
        if !(1..=MAX_CONDITIONS).contains(&conditions.len()) {
            let num = conditions.len();
            let problem = format!("{num} conditions: 1 to {MAX_CONDITIONS} are possible");
            return Err(file.error(self.condition.span(), problem));
        }
        let named = self.lights.keys().map(|name| Light {
            name: name.clone(),
            radiance: [Vec3::ZERO; MAX_CONDITIONS],
        });
        let mut lights: Vec<Light> = named.collect();
        for (index, condition) in conditions.iter().enumerate() {
            let name = &condition.name;
            if conditions[..index]
                .iter()
                .any(|other| other.name.get_ref() == name.get_ref())
            {
                let problem = format!("`{}` is there already", name.get_ref().0);
                return Err(file.error(name.span(), problem));
            }
            for (name, factor) in &condition.lights {
                let Some(light) = lights.iter_mut().find(|light| light.name == *name) else {
                    let names = self.lights.keys().map(String::as_str);
                    return Err(unknown(file, factor.span(), ("light", name), names));
                };
                light.radiance[index] = self.lights[name].0 * f32::from(*factor.get_ref());
            }
        }
        Ok(lights)
    }
}

/// The error that nothing has a name.
fn unknown<'a>(
    file: &ScriptFile,
    span: std::ops::Range<usize>,
    (noun, name): (&str, &str),
    names: impl Iterator<Item = &'a str>,
) -> SceneError {
    let names: Vec<&str> = names.collect();
    let (name, names) = (name.escape_debug(), names.join(", "));
    file.error(
        span,
        format!("there is no {noun} `{name}`; there are {names}"),
    )
}

/// A name that files and folders can have on any system.
#[derive(PartialEq)]
struct FileName(String);

impl<'de> Deserialize<'de> for FileName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |name: String| {
            let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if (1..=40).contains(&name.len()) && name.chars().all(allowed) {
                return Ok(Self(name));
            }
            let name = name.escape_debug();
            Err(format!(
                "`{name}` is no name: 1 to 40 letters, digits, - and _"
            ))
        })
    }
}

/// A linear Rec.709 colour: a number, three of them, or `"#rrggbb"` as displays show it.
#[derive(Clone, Copy)]
struct Color(Vec3);

impl Color {
    fn of<T>(value: Form<T>) -> Result<Self, String> {
        use eagpt_scene::color::linear_from_srgb;
        use eagpt_scene::script::value::Color;

        let Form::Text(text) = value else {
            return Color::of(value).map(|color| Self(color.0));
        };
        let digits = text.strip_prefix('#').filter(|d| d.len() == 6);
        let value = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let Some(value) = value else {
            let text = text.escape_debug();
            return Err(format!("`{text}` is no colour like \"#c0a080\""));
        };
        let channel = |shift: u32| linear_from_srgb((value >> shift & 255) as f32 / 255.0);
        Ok(Self(Vec3::new(channel(16), channel(8), channel(0))))
    }

    /// The colour as an albedo: with all channels at most 1.
    fn albedo(self) -> Result<Vec3, String> {
        match self.0.max_element() <= 1.0 {
            true => Ok(self.0),
            false => Err(format!("{} is above 1", self.0)),
        }
    }
}

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |value: Form| Self::of(value))
    }
}
