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

fn ball<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Surface, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        centre: Array<Number, 3>,
        radius: Positive,
        albedo: Option<Albedo>,
        radiance: Option<Color>,
        specular: Option<Albedo>,
        roughness: Option<Fraction>,
        metal: Option<MetalKeys>,
        spacing: Option<Positive>,
    }

    checked(deserializer, |keys: Keys| {
        let solid = Solid::Ball {
            centre: keys.centre.into(),
            radius: keys.radius.into(),
        };
        let look = Look {
            albedo: keys.albedo,
            radiance: keys.radiance,
            specular: keys.specular,
            roughness: keys.roughness,
            metal: keys.metal,
        };
        surface(solid, look, keys.spacing)
    })
}

fn quad<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Surface, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        centre: Array<Number, 3>,
        u: Array<Number, 3>,
        v: Array<Number, 3>,
        albedo: Option<Albedo>,
        radiance: Option<Color>,
        specular: Option<Albedo>,
        roughness: Option<Fraction>,
        metal: Option<MetalKeys>,
        spacing: Option<Positive>,
    }

    checked(deserializer, |keys: Keys| {
        let [u, v] = [keys.u, keys.v].map(Vec3::from);
        if u.cross(v).length() <= MIN_SINE * u.length() * v.length() {
            return Err(format!("v {v} is parallel to u {u}"));
        }
        let solid = Solid::Quad {
            centre: keys.centre.into(),
            edges: [u, v],
        };
        let look = Look {
            albedo: keys.albedo,
            radiance: keys.radiance,
            specular: keys.specular,
            roughness: keys.roughness,
            metal: keys.metal,
        };
        surface(solid, look, keys.spacing)
    })
}

fn cuboid<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Surface, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        centre: Array<Number, 3>,
        size: Array<Positive, 3>,
        rotate: Option<Rotation>,
        albedo: Option<Albedo>,
        radiance: Option<Color>,
        specular: Option<Albedo>,
        roughness: Option<Fraction>,
        metal: Option<MetalKeys>,
        spacing: Option<Positive>,
    }

    checked(deserializer, |keys: Keys| {
        let solid = Solid::Box {
            centre: keys.centre.into(),
            size: keys.size.into(),
            rotation: keys.rotate.map_or(Quat::IDENTITY, Quat::from),
        };
        let look = Look {
            albedo: keys.albedo,
            radiance: keys.radiance,
            specular: keys.specular,
            roughness: keys.roughness,
            metal: keys.metal,
        };
        surface(solid, look, keys.spacing)
    })
}

/// Material of a new surface, key by key.
struct Look {
    albedo: Option<Albedo>,
    radiance: Option<Color>,
    specular: Option<Albedo>,
    roughness: Option<Fraction>,
    metal: Option<MetalKeys>,
}

impl Look {
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
}

fn surface(solid: Solid, look: Look, spacing: Option<Positive>) -> Result<Surface, String> {
    let surface = Surface {
        solid,
        material: look.material()?,
        spacing: spacing.map(f32::from),
    };
    let num = surface.num_discs();
    if num > MAX_DISCS as f64 {
        let spacing = match surface.spacing {
            Some(spacing) => format!("of spacing {spacing} "),
            None => String::new(),
        };
        return Err(format!(
            "a surface of {num:.0} discs {spacing}is too large: more than {MAX_DISCS} are not made"
        ));
    }
    Ok(surface)
}
