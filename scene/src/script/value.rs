//! Values of scripts: numbers within ranges, vectors, colours, directions.

mod checked;
mod geometry;
mod number;

pub use checked::checked;
pub use geometry::{Albedo, Color, Direction, Rotation, vec3};
pub use number::{Fraction, NotNegative, Number, Positive, Whole};

use number::finite;
use serde::de::{Error, IgnoredAny, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

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
                while let Some(number) = items.next_element::<Number>()? {
                    numbers.push(number.into());
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
