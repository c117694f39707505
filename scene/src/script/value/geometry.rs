//! Vectors, directions, rotations and colours.

use super::{Array, Form, Number, checked};
use crate::dataset::UpAxis;
use glam::{DVec2, DVec3, Quat, Vec2, Vec3};
use serde::{Deserialize, Deserializer};

/// Shortest vector that still has a direction.
const MIN_DIRECTION_LENGTH: f32 = 1e-6;

impl<T: Into<f64>> From<Array<T, 3>> for DVec3 {
    fn from(array: Array<T, 3>) -> Self {
        Self::from_array(array.into())
    }
}

impl<T: Into<f64>> From<Array<T, 2>> for DVec2 {
    fn from(array: Array<T, 2>) -> Self {
        Self::from_array(array.into())
    }
}

impl<T: Into<f32>> From<Array<T, 3>> for Vec3 {
    fn from(array: Array<T, 3>) -> Self {
        Self::from_array(array.into())
    }
}

impl<T: Into<f32>> From<Array<T, 2>> for Vec2 {
    fn from(array: Array<T, 2>) -> Self {
        Self::from_array(array.into())
    }
}

/// A colour: one number for grey, or three; not negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Color(pub Vec3);

impl Color {
    /// The colour that a value gives.
    ///
    /// # Errors
    /// In words, if it gives none.
    pub fn of<T>(value: Form<T>) -> Result<Self, String> {
        let color = match value {
            Form::Number(grey) => Vec3::splat(grey as f32),
            Form::Numbers(numbers) => vec3(numbers)?,
            other => return Err(other.unfit("a number or [r, g, b]")),
        };
        let least = color.min_element();
        let valid = (least >= 0.0).then_some(Self(color));
        valid.ok_or_else(|| format!("{least} is negative"))
    }

    /// The colour, if all channels are at most 1.
    ///
    /// # Errors
    /// In words, if one is not.
    pub fn albedo(self) -> Result<Albedo, String> {
        let most = self.0.max_element();
        let valid = (most <= 1.0).then_some(Albedo(self.0));
        valid.ok_or_else(|| format!("{most} is above 1"))
    }
}

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |value: Form| Self::of(value))
    }
}

/// A colour with all channels at most 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Albedo(pub Vec3);

impl<'de> Deserialize<'de> for Albedo {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, Color::albedo)
    }
}

/// A unit vector: three numbers, or the name of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction(pub Vec3);

impl<'de> Deserialize<'de> for Direction {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |value: Form| {
            let vector = match value {
                Form::Text(name) => return name.parse().map(|axis: UpAxis| Self(axis.vector())),
                Form::Numbers(numbers) => vec3(numbers)?,
                other => return Err(other.unfit("an axis or [x, y, z]")),
            };
            let length = vector.length();
            if length > MIN_DIRECTION_LENGTH && length.is_finite() {
                Ok(Self(vector / length))
            } else {
                Err(format!(
                    "{length} is the length of a vector without direction"
                ))
            }
        })
    }
}

/// A rotation, `{ axis, degrees }`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    axis: Direction,
    degrees: Number,
}

impl Rotation {
    /// A rotation about an axis.
    pub fn new(axis: Direction, degrees: Number) -> Self {
        Self { axis, degrees }
    }
}

impl From<Rotation> for Quat {
    fn from(Rotation { axis, degrees }: Rotation) -> Self {
        Self::from_axis_angle(axis.0, f32::from(degrees).to_radians())
    }
}

/// Three numbers as a vector.
///
/// # Errors
/// In words, if they are not three.
pub fn vec3(numbers: Vec<f64>) -> Result<Vec3, String> {
    let num = numbers.len();
    let array: [f64; 3] = numbers
        .try_into()
        .map_err(|_| format!("has {num} values, not 3"))?;
    Ok(Vec3::from_array(array.map(|value| value as f32)))
}
