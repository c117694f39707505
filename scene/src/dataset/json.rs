//! JSON values with the place they stand at, for errors that name it.

use crate::error::{Result, SceneError};
use serde_json::{Map, Value};
use std::path::Path;

/// An object of a JSON file; `place` is "" at the top, else as `frames[3]`.
#[derive(Clone, Copy)]
pub(super) struct Object<'a> {
    pub(super) path: &'a Path,
    pub(super) map: &'a Map<String, Value>,
    pub(super) index: Option<usize>,
}

impl<'a> Object<'a> {
    /// `key` with the place of the object in front.
    pub(super) fn field(&self, key: &str) -> String {
        match self.index {
            Some(index) => format!("frames[{index}].{key}"),
            None => key.to_owned(),
        }
    }

    pub(super) fn invalid(&self, key: &str, problem: impl Into<String>) -> SceneError {
        SceneError::invalid(self.path, self.field(key), problem)
    }

    pub(super) fn unsupported(&self, key: &str, problem: impl Into<String>) -> SceneError {
        SceneError::unsupported(self.path, self.field(key), problem)
    }

    /// The value of `key`; null counts as absent.
    pub(super) fn get(&self, key: &str) -> Option<&'a Value> {
        self.map.get(key).filter(|value| !value.is_null())
    }

    /// A finite number.
    pub(super) fn number(&self, key: &str) -> Result<Option<f64>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        match value.as_f64().filter(|number| number.is_finite()) {
            Some(number) => Ok(Some(number)),
            None => Err(self.invalid(key, format!("{} is not a finite number", excerpt(value)))),
        }
    }

    /// A number above 0.
    pub(super) fn positive(&self, key: &str) -> Result<Option<f64>> {
        match self.number(key)? {
            Some(number) if number <= 0.0 => {
                Err(self.invalid(key, format!("{number:?} is not above 0")))
            }
            number => Ok(number),
        }
    }

    pub(super) fn string(&self, key: &str) -> Result<Option<&'a str>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        match value.as_str() {
            Some(text) => Ok(Some(text)),
            None => Err(self.invalid(key, format!("{} is not a string", excerpt(value)))),
        }
    }

    pub(super) fn array(&self, key: &str) -> Result<Option<&'a [Value]>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        match value.as_array() {
            Some(array) => Ok(Some(array)),
            None => Err(self.invalid(key, format!("{} is not a list", excerpt(value)))),
        }
    }
}

/// A value as text, short enough for one line.
pub(super) fn excerpt(value: &Value) -> String {
    const MAX_CHARS: usize = 60;
    let text = value.to_string();
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
