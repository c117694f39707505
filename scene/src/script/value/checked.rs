//! Values that are converted as they are read.

use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;

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
