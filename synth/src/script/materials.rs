//! `[materials]`: colours, patterns and coats of surfaces.

use super::Color;
use crate::room::pattern::{Pattern, Texture};
use crate::room::{Gloss, Material};
use eagpt_scene::script::value::{
    Array, Form, Fraction, NonEmpty, Positive, Whole, checked, one_of,
};
use glam::{Vec2, Vec3};
use serde::{Deserialize, Deserializer};

/// A colour of a surface, at most 1.
struct Albedo(Vec3);

impl<'de> Deserialize<'de> for Albedo {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |color: Color| color.albedo().map(Self))
    }
}

impl From<Albedo> for Vec3 {
    fn from(albedo: Albedo) -> Self {
        albedo.0
    }
}

/// A material as a scene file has it: one of the patterns, with `grain` and `gloss`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialKeys {
    plain: Option<Albedo>,
    checker: Option<Colored<2>>,
    stripes: Option<Stripes>,
    noise: Option<Colored<2>>,
    bricks: Option<Bricks>,
    wood: Option<Wood>,
    rug: Option<Colored<4>>,
    landscape: Option<Landscape>,
    motif: Option<Colored<2>>,
    grain: Option<Fraction>,
    gloss: Option<GlossKeys>,
}

/// A pattern of `N` colours and one size.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Colored<const N: usize> {
    colors: Array<Albedo, N>,
    size: Option<Positive>,
}

impl<const N: usize> Colored<N> {
    fn with_size(self, default: f32) -> ([Vec3; N], f32) {
        (self.colors.into(), self.size.map_or(default, f32::from))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stripes {
    colors: NonEmpty<Albedo>,
    size: Option<Positive>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Bricks {
    colors: Array<Albedo, 2>,
    size: Option<Array<Positive, 2>>,
    joint: Option<Positive>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wood {
    colors: Array<Albedo, 2>,
    size: Option<Array<Positive, 2>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Landscape {
    seed: Option<Whole<0, { u32::MAX }>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GlossKeys {
    reflectance: Option<Albedo>,
    roughness: Option<Fraction>,
}

impl<'de> Deserialize<'de> for Material {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |value: Form<Box<MaterialKeys>>| match value {
            Form::Table(keys) => keys.material(),
            // A colour alone is a plain material.
            color => Ok(Self {
                texture: Texture::plain(Color::of(color)?.albedo()?),
                gloss: None,
            }),
        })
    }
}

impl MaterialKeys {
    fn material(self) -> Result<Material, String> {
        let pattern = one_of([
            ("plain", self.plain.map(|color| Pattern::Plain(color.0))),
            (
                "checker",
                self.checker.map(|keys| {
                    let (colors, size) = keys.with_size(0.3);
                    Pattern::Checker { colors, size }
                }),
            ),
            (
                "stripes",
                self.stripes.map(|keys| Pattern::Stripes {
                    colors: keys.colors.into(),
                    size: keys.size.map_or(0.1, f32::from),
                }),
            ),
            (
                "noise",
                self.noise.map(|keys| {
                    let (colors, size) = keys.with_size(0.3);
                    Pattern::Noise { colors, size }
                }),
            ),
            (
                "bricks",
                self.bricks.map(|keys| Pattern::Bricks {
                    colors: keys.colors.into(),
                    size: keys.size.map_or(Vec2::new(0.24, 0.08), Vec2::from),
                    joint: keys.joint.map_or(0.01, f32::from),
                }),
            ),
            (
                "wood",
                self.wood.map(|keys| Pattern::Wood {
                    colors: keys.colors.into(),
                    size: keys.size.map_or(Vec2::new(1.2, 0.12), Vec2::from),
                }),
            ),
            (
                "rug",
                self.rug.map(|keys| {
                    let (colors, size) = keys.with_size(0.3);
                    Pattern::Rug { colors, size }
                }),
            ),
            (
                "landscape",
                self.landscape.map(|keys| Pattern::Landscape {
                    seed: keys.seed.map_or(0, u32::from),
                }),
            ),
            (
                "motif",
                self.motif.map(|keys| {
                    let (colors, size) = keys.with_size(0.2);
                    Pattern::Motif { colors, size }
                }),
            ),
        ])?;
        Ok(Material {
            texture: Texture {
                pattern,
                grain: self.grain.map_or(0.0, f32::from),
            },
            gloss: self.gloss.map(|keys| Gloss {
                reflectance: keys.reflectance.map_or(Vec3::splat(0.04), Vec3::from),
                roughness: keys.roughness.map_or(0.1, f32::from),
            }),
        })
    }
}
