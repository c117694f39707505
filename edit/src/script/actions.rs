//! Actions and placements in a script.

use crate::act::{Action, Paint};
use crate::lamp::{LampShape, NewLamp, TubeSize};
use crate::place::{Goal, Pivot, Placement};
use eagpt_scene::Gloss;
use eagpt_scene::color::luminance;
use eagpt_scene::script::value::{
    Albedo, Array, Color, Direction, Form, Fraction, Number, Positive, Rotation, checked, vec3,
};
use glam::{Quat, Vec3};
use serde::{Deserialize, Deserializer};

/// An action as a script has it.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum ActionKeys {
    Remove,
    KeepOnly,
    LightsOff,
    MakeEmissive,
    MakeNotEmissive,
    MakeLamp(#[serde(deserialize_with = "lamp")] NewLamp),
    ScaleLight(Color),
    TintLight(#[serde(deserialize_with = "tint")] Vec3),
    SetRadiance(Color),
    SetAlbedo(Albedo),
    ScaleAlbedo(Color),
    SwapAlbedo(#[serde(deserialize_with = "channels")] [usize; 3]),
    SetRoughness(Fraction),
    SetSpecular(Albedo),
    Metal(MetalKeys),
    Move(Array<Number, 3>),
    Rotate(RotateKeys),
    Scale(ScaleKeys),
    Place(Placement),
    Duplicate(Placement),
    SnapToFloor(Number),
}

/// Roughness of a metal of which nothing is said.
const METAL_ROUGHNESS: f32 = 0.2;

/// A metal as a script has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MetalKeys {
    color: Albedo,
    roughness: Option<Fraction>,
}

impl MetalKeys {
    /// Its specular part; a metal has no other.
    pub(super) fn gloss(self) -> Gloss {
        Gloss {
            specular: self.color.0,
            roughness: self.roughness.map_or(METAL_ROUGHNESS, f32::from),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RotateKeys {
    axis: Direction,
    degrees: Number,
    #[serde(default)]
    about: Pivot,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScaleKeys {
    factor: Positive,
    #[serde(default)]
    about: Pivot,
}

/// A placement as a script has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlacementKeys {
    pub(super) scale: Option<Positive>,
    pub(super) rotate: Option<Rotation>,
    #[serde(default)]
    pub(super) about: Pivot,
    #[serde(rename = "move")]
    pub(super) offset: Option<Array<Number, 3>>,
    pub(super) to: Option<Array<Number, 3>>,
}

impl<'de> Deserialize<'de> for Action {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let still = Placement::by(Vec3::ZERO);
        Ok(Self::Paint(match ActionKeys::deserialize(deserializer)? {
            ActionKeys::Remove => return Ok(Self::Remove),
            ActionKeys::KeepOnly => return Ok(Self::KeepOnly),
            ActionKeys::LightsOff => Paint::LightsOff,
            ActionKeys::MakeEmissive => Paint::SetEmission(1.0),
            ActionKeys::MakeNotEmissive => Paint::SetEmission(0.0),
            ActionKeys::MakeLamp(lamp) => return Ok(Self::MakeLamp(lamp)),
            ActionKeys::ScaleLight(factor) => Paint::ScaleLight(factor.0),
            ActionKeys::TintLight(color) => Paint::TintLight(color),
            ActionKeys::SetRadiance(radiance) => Paint::SetRadiance(radiance.0),
            ActionKeys::SetAlbedo(albedo) => Paint::SetAlbedo(albedo.0),
            ActionKeys::ScaleAlbedo(factor) => Paint::ScaleAlbedo(factor.0),
            ActionKeys::SwapAlbedo(channels) => Paint::SwapAlbedo(channels),
            ActionKeys::SetRoughness(roughness) => Paint::SetRoughness(roughness.into()),
            ActionKeys::SetSpecular(specular) => Paint::SetSpecular(specular.0),
            ActionKeys::Metal(metal) => Paint::Metal(metal.gloss()),
            ActionKeys::Move(offset) => return Ok(Self::Place(Placement::by(offset.into()))),
            ActionKeys::Rotate(keys) => {
                return Ok(Self::Place(Placement {
                    rotation: Rotation::new(keys.axis, keys.degrees).into(),
                    pivot: keys.about,
                    ..still
                }));
            }
            ActionKeys::Scale(keys) => {
                return Ok(Self::Place(Placement {
                    scale: keys.factor.into(),
                    pivot: keys.about,
                    ..still
                }));
            }
            ActionKeys::Place(placement) => return Ok(Self::Place(placement)),
            ActionKeys::Duplicate(placement) => return Ok(Self::Duplicate(placement)),
            ActionKeys::SnapToFloor(height) => return Ok(Self::SnapToFloor(height.into())),
        }))
    }
}

fn tint<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    checked(deserializer, |Color(color)| {
        if luminance(color.to_array()) > 0.0 {
            Ok(color)
        } else {
            Err("black has no colour to tint with".to_owned())
        }
    })
}

fn lamp<'de, D: Deserializer<'de>>(deserializer: D) -> Result<NewLamp, D::Error> {
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Name {
        Rectangle,
        Ellipse,
        Ball,
        Tube,
    }

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        shape: Name,
        radiance: Color,
        axis: Option<Direction>,
        radii: Option<Array<Positive, 2>>,
        height: Option<Positive>,
    }

    checked(deserializer, |keys: Keys| {
        let size = match (keys.radii, keys.height) {
            (Some(radii), Some(height)) => Some(TubeSize {
                radii: radii.into(),
                height: height.into(),
            }),
            (None, None) => None,
            _ => return Err("a tube of known size has `radii` and a `height`".to_owned()),
        };
        let shape = match (keys.shape, keys.axis, size) {
            (Name::Tube, axis, size) => LampShape::Tube(axis.map(|axis| axis.0), size),
            (_, Some(_), _) => return Err("only a `tube` has an `axis`".to_owned()),
            (.., Some(_)) => return Err("only a `tube` has `radii` and a `height`".to_owned()),
            (Name::Rectangle, None, None) => LampShape::Rectangle,
            (Name::Ellipse, None, None) => LampShape::Ellipse,
            (Name::Ball, None, None) => LampShape::Ball,
        };
        let radiance = keys.radiance.0;
        Ok(NewLamp { shape, radiance })
    })
}

/// The channel that each one comes from, written like "bgr".
fn channels<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[usize; 3], D::Error> {
    checked(deserializer, |text: String| {
        let places: Vec<usize> = text.chars().filter_map(|c| "rgb".find(c)).collect();
        let mut sorted = places.clone();
        sorted.sort_unstable();
        match (places.as_slice(), text.len()) {
            (&[r, g, b], 3) if sorted == [0, 1, 2] => Ok([r, g, b]),
            _ => Err(format!("`{text}` is no order of the letters r, g, b")),
        }
    })
}

impl TryFrom<PlacementKeys> for Placement {
    type Error = String;

    fn try_from(keys: PlacementKeys) -> Result<Self, String> {
        Ok(Self {
            scale: keys.scale.map_or(1.0, f32::from),
            rotation: keys.rotate.map_or(Quat::IDENTITY, Quat::from),
            pivot: keys.about,
            goal: match (keys.offset, keys.to) {
                (Some(_), Some(_)) => {
                    return Err("a placement has a `move` or a `to`, not both".to_owned());
                }
                (Some(offset), None) => Goal::By(offset.into()),
                (None, Some(point)) => Goal::To(point.into()),
                (None, None) => Goal::By(Vec3::ZERO),
            },
        })
    }
}

impl<'de> Deserialize<'de> for Placement {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |keys: PlacementKeys| keys.try_into())
    }
}

impl<'de> Deserialize<'de> for Pivot {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |value: Form| match value {
            Form::Text(name) if name == "centre" => Ok(Self::Centre),
            Form::Text(name) if name == "base" => Ok(Self::Base),
            Form::Numbers(point) => vec3(point).map(Self::Point),
            other => Err(other.unfit("centre, base or a point [x, y, z]")),
        })
    }
}
