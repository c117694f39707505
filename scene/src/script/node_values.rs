//! What a value of a script may be: numbers, vectors, colours, directions.

use super::{Node, Table};
use crate::dataset::UpAxis;
use crate::error::Result;
use glam::{DVec3, Quat, Vec3};
use std::ops::RangeInclusive;
use toml::de::DeValue;

/// Shortest vector that still has a direction.
const MIN_DIRECTION_LENGTH: f32 = 1e-6;

impl<'a> Node<'a> {
    /// A string.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn string(&self) -> Result<&'a str> {
        match self.value.get_ref() {
            DeValue::String(text) => Ok(text),
            _ => Err(self.unfit("string")),
        }
    }

    /// A string, number or boolean, as text.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none of them.
    pub fn scalar(&self) -> Result<String> {
        match self.value.get_ref() {
            DeValue::String(text) => Ok(text.to_string()),
            DeValue::Boolean(flag) => Ok(flag.to_string()),
            DeValue::Float(float) => Ok(float.as_str().to_owned()),
            DeValue::Integer(integer) if integer.radix() == 10 => Ok(integer.as_str().to_owned()),
            _ => Err(self.unfit("string, number or boolean")),
        }
    }

    /// `true` or `false`.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn flag(&self) -> Result<bool> {
        self.value
            .get_ref()
            .as_bool()
            .ok_or_else(|| self.unfit("boolean"))
    }

    /// A finite number in double precision.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn double(&self) -> Result<f64> {
        let value = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(|value| value as f64),
            _ => return Err(self.unfit("number")),
        };
        match value {
            Some(value) if value.is_finite() => Ok(value),
            Some(value) => Err(self.error(format!("{value} is not a finite number"))),
            None => Err(self.error("is a number out of range")),
        }
    }

    /// A finite number.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn number(&self) -> Result<f32> {
        let value = self.double()?;
        if !(value as f32).is_finite() {
            return Err(self.error(format!("{value} is not a finite number")));
        }
        Ok(value as f32)
    }

    /// A whole number within `range`.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn whole(&self, range: RangeInclusive<u32>) -> Result<u32> {
        let value = self.double()?;
        let (least, most) = (f64::from(*range.start()), f64::from(*range.end()));
        if value.fract() != 0.0 || !(least..=most).contains(&value) {
            return Err(self.error(format!("{value} is no whole number from {least} to {most}")));
        }
        Ok(value as u32)
    }

    /// A number above 0.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn positive(&self) -> Result<f32> {
        self.checked(self.number()?, |value| value > 0.0, "is not above 0")
    }

    /// A number of 0 or more.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn not_negative(&self) -> Result<f32> {
        self.checked(self.number()?, |value| value >= 0.0, "is negative")
    }

    /// Three finite numbers.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn vec3(&self) -> Result<Vec3> {
        let [x, y, z] = self.fixed_array()?;
        Ok(Vec3::new(x.number()?, y.number()?, z.number()?))
    }

    /// Three finite numbers in double precision.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn dvec3(&self) -> Result<DVec3> {
        let [x, y, z] = self.fixed_array()?;
        Ok(DVec3::new(x.double()?, y.double()?, z.double()?))
    }

    /// Exactly `N` elements.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is no array of this length.
    pub fn fixed_array<const N: usize>(&self) -> Result<[Self; N]> {
        let items = self.array()?;
        items
            .try_into()
            .map_err(|items: Vec<Self>| self.error(format!("has {} numbers, not {N}", items.len())))
    }

    /// A colour: one number for grey, or three.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn color(&self) -> Result<Vec3> {
        let color = if matches!(self.value.get_ref(), DeValue::Array(_)) {
            self.vec3()?
        } else {
            Vec3::splat(self.number()?)
        };
        let least = self.checked(color.min_element(), |value| value >= 0.0, "is negative");
        least.map(|_| color)
    }

    /// A colour with all channels at most 1.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn albedo(&self) -> Result<Vec3> {
        let color = self.color()?;
        let most = self.checked(color.max_element(), |value| value <= 1.0, "is above 1");
        most.map(|_| color)
    }

    /// A unit vector: three numbers, or the name of an axis.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn direction(&self) -> Result<Vec3> {
        if let DeValue::String(name) = self.value.get_ref() {
            return name
                .parse()
                .map(UpAxis::vector)
                .map_err(|problem| self.error(problem));
        }
        let vector = self.vec3()?;
        let length = vector.length();
        self.checked(
            length,
            |length| length > MIN_DIRECTION_LENGTH && length.is_finite(),
            "is the length of a vector without direction",
        )?;
        Ok(vector / length)
    }

    /// `{ axis, degrees }`.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if it is none.
    pub fn rotation(&self) -> Result<Quat> {
        self.table(&["axis", "degrees"])?.rotation()
    }

    fn checked(&self, value: f32, holds: impl Fn(f32) -> bool, problem: &str) -> Result<f32> {
        if holds(value) {
            Ok(value)
        } else {
            Err(self.error(format!("{value} {problem}")))
        }
    }
}

impl Table<'_> {
    /// `axis` and `degrees` of this table.
    ///
    /// # Errors
    /// [`crate::SceneError::Script`] if they are not there or none.
    pub fn rotation(&self) -> Result<Quat> {
        let axis = self.need("axis")?.direction()?;
        Ok(Quat::from_axis_angle(
            axis,
            self.need("degrees")?.number()?.to_radians(),
        ))
    }
}
