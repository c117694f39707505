//! New surfaces in a script.

use super::actions::MetalKeys;
use eagpt_scene::Gloss;
use eagpt_scene::discs::{MAX_DISCS, Material, Solid, Surface};
use eagpt_scene::script::value::{
    Albedo, Array, Color, Fraction, Number, Positive, Rotation, checked,
};
use glam::{Quat, Vec3};
use serde::{Deserialize, Deserializer};

/// Roughness of a specular surface of which nothing is said.
const DEFAULT_ROUGHNESS: f32 = 0.2;
/// Sine of the smallest angle between the edges of a quad.
const MIN_SINE: f32 = 1e-3;

/// A surface as a script has it.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum SurfaceKeys {
    Ball(#[serde(deserialize_with = "ball")] Surface),
    Quad(#[serde(deserialize_with = "quad")] Surface),
    Box(#[serde(deserialize_with = "cuboid")] Surface),
}

/// A [`Surface`] as it is read from a script.
pub(super) struct ReadSurface(pub(super) Surface);

impl<'de> Deserialize<'de> for ReadSurface {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(match SurfaceKeys::deserialize(deserializer)? {
            SurfaceKeys::Ball(surface) | SurfaceKeys::Quad(surface) | SurfaceKeys::Box(surface) => {
                Self(surface)
            }
        })
    }
}

/// Place and material of a new surface, key by key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    centre: Array<Number, 3>,
    radius: Option<Positive>,
    u: Option<Array<Number, 3>>,
    v: Option<Array<Number, 3>>,
    size: Option<Array<Positive, 3>>,
    rotate: Option<Rotation>,
    albedo: Option<Albedo>,
    radiance: Option<Color>,
    specular: Option<Albedo>,
    roughness: Option<Fraction>,
    metal: Option<MetalKeys>,
    spacing: Option<Positive>,
}

fn ball<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Surface, D::Error> {
    checked(deserializer, |keys: Keys| {
        let (Some(radius), None, None, None, None) =
            (keys.radius, keys.u, keys.v, keys.size, keys.rotate)
        else {
            return Err("a ball has a `centre` and a `radius`".to_owned());
        };
        let (centre, radius) = (keys.centre.into(), radius.into());
        keys.surface(Solid::Ball { centre, radius })
    })
}

fn quad<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Surface, D::Error> {
    checked(deserializer, |keys: Keys| {
        let (Some(u), Some(v), None, None, None) =
            (keys.u, keys.v, keys.radius, keys.size, keys.rotate)
        else {
            return Err("a quad has a `centre`, `u` and `v`".to_owned());
        };
        let [u, v] = [u, v].map(Vec3::from);
        if u.cross(v).length() <= MIN_SINE * u.length() * v.length() {
            return Err(format!("v {v} is parallel to u {u}"));
        }
        let (centre, edges) = (keys.centre.into(), [u, v]);
        keys.surface(Solid::Quad { centre, edges })
    })
}

fn cuboid<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Surface, D::Error> {
    checked(deserializer, |keys: Keys| {
        let (Some(size), None, None, None) = (keys.size, keys.radius, keys.u, keys.v) else {
            return Err("a box has a `centre` and a `size`, and may `rotate`".to_owned());
        };
        let solid = Solid::Box {
            centre: keys.centre.into(),
            size: size.into(),
            rotation: keys.rotate.map_or(Quat::IDENTITY, Quat::from),
        };
        keys.surface(solid)
    })
}

impl Keys {
    /// The material.
    fn material(self) -> Result<Material, String> {
        let is_metal = self.metal.is_some();
        if is_metal && (self.albedo.is_some() || self.specular.is_some()) {
            return Err("a `metal` has no `albedo` and no `specular`".to_owned());
        }
        if self.roughness.is_some() && self.specular.is_none() {
            return Err("`roughness` is that of a `specular`".to_owned());
        }
        let has_color = self.albedo.is_some() || self.radiance.is_some();
        if !has_color && self.specular.is_none() && !is_metal {
            return Err("has none of `albedo`, `radiance`, `specular`, `metal`".to_owned());
        }
        let gloss = match (self.metal, self.specular) {
            (Some(metal), _) => metal.gloss(),
            (None, Some(specular)) => Gloss {
                specular: specular.0,
                roughness: self.roughness.map_or(DEFAULT_ROUGHNESS, f32::from),
            },
            (None, None) => Gloss::NONE,
        };
        Ok(Material {
            albedo: self.albedo.map_or(Vec3::ZERO, |albedo| albedo.0),
            radiance: self.radiance.map(|radiance| radiance.0),
            gloss,
        })
    }

    /// The surface of this shape.
    fn surface(self, solid: Solid) -> Result<Surface, String> {
        let spacing = self.spacing.map(f32::from);
        let material = self.material()?;
        let surface = Surface {
            solid,
            material,
            spacing,
        };
        let num = surface.num_discs();
        if num > MAX_DISCS as f64 {
            let spacing = match spacing {
                Some(spacing) => format!("of spacing {spacing} "),
                None => String::new(),
            };
            return Err(format!(
                "a surface of {num:.0} discs {spacing}is too large: more than {MAX_DISCS} are not made"
            ));
        }
        Ok(surface)
    }
}
