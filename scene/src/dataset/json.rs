//! JSON values with the place they stand at, for errors that name it.

use crate::error::{Result, SceneError};
use serde_json::{Map, Value};
use std::path::Path;

/// An object of a JSON file; `place` is "" at the top, else as `frames[3]`.
#[derive(Clone, Copy)]
pub struct Object<'a> {
    /// The file.
    pub path: &'a Path,
    /// Keys and values.
    pub map: &'a Map<String, Value>,
    /// The list it is in, and where.
    pub within: Option<(&'static str, usize)>,
}

impl<'a> Object<'a> {
    /// The whole of a file.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if it is no object.
    pub fn root(path: &'a Path, value: &'a Value) -> Result<Self> {
        let map = value
            .as_object()
            .ok_or_else(|| SceneError::invalid(path, "JSON", "not an object"))?;
        Ok(Self {
            path,
            map,
            within: None,
        })
    }

    /// The objects of a list that has to be there and not be empty.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if it is not, or holds something else.
    pub fn objects(&self, list: &'static str) -> Result<Vec<Self>> {
        let values = self.need(list, self.array(list)?)?;
        if values.is_empty() {
            return Err(self.invalid(list, "empty"));
        }
        let objects = values.iter().enumerate().map(|(index, value)| {
            let map = value.as_object().ok_or_else(|| {
                let problem = format!("{} is not an object", excerpt(value));
                self.invalid(&format!("{list}[{index}]"), problem)
            })?;
            Ok(Self {
                path: self.path,
                map,
                within: Some((list, index)),
            })
        });
        objects.collect()
    }

    /// A value that has to be there.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if it is missing.
    pub fn need<T>(&self, key: &str, value: Option<T>) -> Result<T> {
        value.ok_or_else(|| self.invalid(key, "missing"))
    }

    /// `key` with the place of the object in front.
    pub fn field(&self, key: &str) -> String {
        match self.within {
            Some((list, index)) => format!("{list}[{index}].{key}"),
            None => key.to_owned(),
        }
    }

    /// A [`SceneError::Invalid`] for `key`.
    pub fn invalid(&self, key: &str, problem: impl Into<String>) -> SceneError {
        SceneError::invalid(self.path, self.field(key), problem)
    }

    /// A [`SceneError::Unsupported`] for `key`.
    pub fn unsupported(&self, key: &str, problem: impl Into<String>) -> SceneError {
        SceneError::unsupported(self.path, self.field(key), problem)
    }

    /// The value of `key`; null counts as absent.
    pub fn get(&self, key: &str) -> Option<&'a Value> {
        self.map.get(key).filter(|value| !value.is_null())
    }

    /// A finite number.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if there is something else.
    pub fn number(&self, key: &str) -> Result<Option<f64>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        match value.as_f64().filter(|number| number.is_finite()) {
            Some(number) => Ok(Some(number)),
            None => Err(self.invalid(key, format!("{} is not a finite number", excerpt(value)))),
        }
    }

    /// A number above 0.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if there is something else.
    pub fn positive(&self, key: &str) -> Result<Option<f64>> {
        match self.number(key)? {
            Some(number) if number <= 0.0 => {
                Err(self.invalid(key, format!("{number:?} is not above 0")))
            }
            number => Ok(number),
        }
    }

    /// A whole number of pixels, 1 to 2¹⁶ − 1.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if there is something else.
    pub fn pixels(&self, key: &str) -> Result<Option<u32>> {
        match self.number(key)? {
            None => Ok(None),
            Some(n) if n.fract() == 0.0 && (1.0..=65535.0).contains(&n) => Ok(Some(n as u32)),
            Some(n) => Err(self.invalid(key, format!("{n:?} is no number of pixels"))),
        }
    }

    /// Four rows of four finite numbers.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if there is something else.
    pub fn matrix(&self, key: &str) -> Result<Option<[[f64; 4]; 4]>> {
        let Some(rows) = self.array(key)? else {
            return Ok(None);
        };
        let row = |value: &Value| -> Option<[f64; 4]> {
            let cells: Vec<f64> = value
                .as_array()?
                .iter()
                .map(Value::as_f64)
                .collect::<Option<_>>()?;
            cells.try_into().ok()
        };
        let matrix: Option<Vec<[f64; 4]>> = rows.iter().map(row).collect();
        match matrix.and_then(|rows| <[[f64; 4]; 4]>::try_from(rows).ok()) {
            Some(matrix) => Ok(Some(matrix)),
            None => Err(self.invalid(key, "not four rows of four numbers")),
        }
    }

    /// A text.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if there is something else.
    pub fn string(&self, key: &str) -> Result<Option<&'a str>> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        match value.as_str() {
            Some(text) => Ok(Some(text)),
            None => Err(self.invalid(key, format!("{} is not a string", excerpt(value)))),
        }
    }

    /// A list.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if there is something else.
    pub fn array(&self, key: &str) -> Result<Option<&'a [Value]>> {
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
pub fn excerpt(value: &Value) -> String {
    const MAX_CHARS: usize = 60;
    let text = value.to_string();
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
