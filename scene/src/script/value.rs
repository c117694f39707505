//! Values of scripts: numbers within ranges, vectors, colours, directions.

use crate::dataset::UpAxis;
use glam::{DVec2, DVec3, Quat, Vec2, Vec3};
use serde::de::{Error, IgnoredAny, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

/// Shortest vector that still has a direction.
const MIN_DIRECTION_LENGTH: f32 = 1e-6;

/// Reads a `Raw` and converts it. Unlike with `#[serde(try_from)]`, an error of the conversion is
/// about this value even where that is an element of an array.
///
/// # Errors
/// That of the `Raw`, or of `convert`.
pub fn checked<'de, D, Raw, T>(
    deserializer: D,
    convert: impl FnOnce(Raw) -> Result<T, String>,
) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    Raw: Deserialize<'de>,
{
    struct Checked<Raw, F>(F, PhantomData<Raw>);

    impl<'de, Raw, T, F> Visitor<'de> for Checked<Raw, F>
    where
        Raw: Deserialize<'de>,
        F: FnOnce(Raw) -> Result<T, String>,
    {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a value")
        }

        fn visit_newtype_struct<D: Deserializer<'de>>(self, inner: D) -> Result<T, D::Error> {
            (self.0)(Raw::deserialize(inner)?).map_err(D::Error::custom)
        }
    }

    deserializer.deserialize_newtype_struct("", Checked(convert, PhantomData))
}

/// Reads a field as `Via`, for `#[serde(deserialize_with)]`.
///
/// # Errors
/// That of the `Via`.
pub fn via<'de, Via, D, T>(deserializer: D) -> Result<T, D::Error>
where
    Via: Deserialize<'de> + Into<T>,
    D: Deserializer<'de>,
{
    Via::deserialize(deserializer).map(Into::into)
}

/// The one of several alternatives that is there.
///
/// # Errors
/// In words: none of them is, or more than one.
pub fn one_of<T, const N: usize>(alternatives: [(&str, Option<T>); N]) -> Result<T, String> {
    let names = alternatives.each_ref().map(|(name, _)| *name).join(", ");
    let mut found = None;
    for (name, alternative) in alternatives {
        if let Some(value) = alternative
            && found.replace(value).is_some()
        {
            return Err(format!("`{name}` is one too many: only one of {names}"));
        }
    }
    found.ok_or_else(|| format!("one of {names} is missing"))
}

/// A value that may have several forms.
#[derive(Debug, Clone, PartialEq)]
pub enum Form<T = IgnoredAny> {
    /// A string.
    Text(String),
    /// A finite number.
    Number(f64),
    /// Finite numbers.
    Numbers(Vec<f64>),
    /// A table.
    Table(T),
}

impl<T> Form<T> {
    /// The message that it should have another form.
    pub fn unfit(&self, expected: &str) -> String {
        let found = match self {
            Self::Text(text) => return format!("`{text}` is not {expected}"),
            Self::Number(number) => return format!("{number} is not {expected}"),
            Self::Numbers(_) => "an array",
            Self::Table(_) => "a table",
        };
        format!("is {found}, not {expected}")
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Form<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Any<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for Any<T> {
            type Value = Form<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a string, number, array of numbers or table")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Form<T>, E> {
                Ok(Form::Text(text.to_owned()))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Form<T>, E> {
                self.visit_f64(value as f64)
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Form<T>, E> {
                finite(value).map(Form::Number)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Form<T>, A::Error> {
                let mut numbers = Vec::new();
                while let Some(Number(number)) = items.next_element()? {
                    numbers.push(number);
                }
                Ok(Form::Numbers(numbers))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Form<T>, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Form::Table)
            }
        }

        deserializer.deserialize_any(Any(PhantomData))
    }
}

/// Values also have to be finite in single precision.
fn finite<E: Error>(value: f64) -> Result<f64, E> {
    if (value as f32).is_finite() {
        Ok(value)
    } else {
        Err(E::custom(format!("{value:?} is not a finite number")))
    }
}

/// A finite number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number(f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Finite;

        impl Visitor<'_> for Finite {
            type Value = Number;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number")
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Number, E> {
                finite(value).map(Number)
            }
        }

        deserializer.deserialize_f64(Finite)
    }
}

/// Declares a type of numbers that meet a condition in single precision.
macro_rules! numbers {
    ($($(#[$doc:meta])* $name:ident: $holds:expr, $problem:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name(f64);

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let holds: fn(f32) -> bool = $holds;
                checked(deserializer, |Number(value)| {
                    let valid = holds(value as f32).then_some(Self(value));
                    valid.ok_or_else(|| format!(concat!("{} ", $problem), value))
                })
            }
        }

        as_float!($name);
    )*};
}

macro_rules! as_float {
    ($name:ident) => {
        impl From<$name> for f64 {
            fn from(number: $name) -> Self {
                number.0
            }
        }

        impl From<$name> for f32 {
            fn from(number: $name) -> Self {
                number.0 as f32
            }
        }
    };
}

as_float!(Number);

numbers! {
    /// A number above 0.
    Positive: |value| value > 0.0, "is not above 0";
    /// A number of 0 or more.
    NotNegative: |value| value >= 0.0, "is negative";
    /// A number from 0 to 1.
    Fraction: |value| (0.0..=1.0).contains(&value), "is outside 0 to 1";
}

/// A whole number from `MIN` to `MAX`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whole<const MIN: u32, const MAX: u32>(u32);

impl<'de, const MIN: u32, const MAX: u32> Deserialize<'de> for Whole<MIN, MAX> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |Number(value)| {
            if value.fract() == 0.0 && (f64::from(MIN)..=f64::from(MAX)).contains(&value) {
                Ok(Self(value as u32))
            } else {
                Err(format!("{value} is not a whole number from {MIN} to {MAX}"))
            }
        })
    }
}

impl<const MIN: u32, const MAX: u32> From<Whole<MIN, MAX>> for u32 {
    fn from(number: Whole<MIN, MAX>) -> Self {
        number.0
    }
}

/// Exactly `N` values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Array<T, const N: usize>(pub [T; N]);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Array<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |values: Vec<T>| {
            let array = values.try_into();
            array
                .map(Self)
                .map_err(|values: Vec<T>| format!("has {} values, not {N}", values.len()))
        })
    }
}

impl<T: Into<U>, U, const N: usize> From<Array<T, N>> for [U; N] {
    fn from(array: Array<T, N>) -> Self {
        array.0.map(Into::into)
    }
}

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

/// One value or more.
#[derive(Debug, Clone, PartialEq)]
pub struct NonEmpty<T>(pub Vec<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for NonEmpty<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |values: Vec<T>| {
            let filled = (!values.is_empty()).then_some(Self(values));
            filled.ok_or_else(|| "is empty".to_owned())
        })
    }
}

impl<T: Into<U>, U> From<NonEmpty<T>> for Vec<U> {
    fn from(values: NonEmpty<T>) -> Self {
        values.0.into_iter().map(Into::into).collect()
    }
}

/// A value that is written as a string.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Parsed<T>(pub T);

impl<'de, T: FromStr<Err = String>> Deserialize<'de> for Parsed<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        checked(deserializer, |text: String| text.parse().map(Self))
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
