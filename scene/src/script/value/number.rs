//! Numbers within ranges.

use super::checked::checked;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

/// Values also have to be finite in single precision.
pub(super) fn finite<E: Error>(value: f64) -> Result<f64, E> {
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
