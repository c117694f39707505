//! TOML files that people write: read by serde, with errors that name file, line and key.
//!
//! A reader derives [`serde::Deserialize`] for the tables of its files, of the types in
//! [`mod@value`]; a value that is checked later is a [`toml::Spanned`], whose span
//! [`ScriptFile::error`] turns into a line and a key.

pub mod value;

use crate::error::{Result, SceneError};
use crate::files;
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};
pub use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

/// A script and its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScriptFile {
    path: PathBuf,
    text: String,
}

impl ScriptFile {
    /// Reads the file `path`.
    ///
    /// # Errors
    /// [`SceneError`] if it cannot be read or is not UTF-8.
    pub fn read(path: &Path) -> Result<Self> {
        Self::new(path, files::read(path)?)
    }

    /// A file called `path` of this content.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if it is not UTF-8.
    pub fn new(path: &Path, bytes: Vec<u8>) -> Result<Self> {
        let text = String::from_utf8(bytes)
            .map_err(|error| SceneError::invalid(path, "TOML", error.to_string()))?;
        let path = path.to_owned();
        Ok(Self { path, text })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Content of the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Reads the whole file as a `T`.
    ///
    /// # Errors
    /// [`SceneError::Script`] if it is no TOML, or no `T`.
    pub fn parse<'a, T: Deserialize<'a>>(&'a self) -> Result<T> {
        let root = DeTable::parse(&self.text).map_err(|error| {
            let span = error.span().unwrap_or_default();
            self.error_at(&span, "TOML".to_owned(), error.message())
        })?;
        T::deserialize(Deserializer::from(root)).map_err(|error| {
            // The names of our types mean nothing to the reader of the message.
            let message = match error.message().split_once("expected struct ") {
                Some((found, _)) => format!("{found}expected a table"),
                None => error.message().to_owned(),
            };
            self.error(error.span().unwrap_or_default(), message)
        })
    }

    /// An error about the value or key at `span`, the bytes of the text it takes.
    pub fn error(&self, span: Range<usize>, problem: impl Into<String>) -> SceneError {
        let mut found = (usize::MAX, String::new());
        if let Ok(root) = DeTable::parse(&self.text) {
            find_in_table(root.get_ref(), "", &span, &mut found);
        }
        let key = match found.1 {
            key if key.is_empty() => "(top level)".to_owned(),
            key => key,
        };
        self.error_at(&span, key, problem)
    }

    /// Line on which a span begins, counted from 1.
    pub fn line(&self, span: &Range<usize>) -> usize {
        let before = self.text.as_bytes().iter().take(span.start);
        before.filter(|byte| **byte == b'\n').count() + 1
    }

    fn error_at(&self, span: &Range<usize>, key: String, problem: impl Into<String>) -> SceneError {
        SceneError::script(&self.path, self.line(span), key, problem)
    }
}

/// Length of the shortest span around another that was found so far, and the key of its value.
type Found = (usize, String);

fn find_in_table(table: &DeTable<'_>, parent: &str, span: &Range<usize>, found: &mut Found) {
    for (name, value) in table {
        let key = match parent {
            "" => name.get_ref().to_string(),
            _ => format!("{parent}.{}", name.get_ref()),
        };
        keep_shorter(name.span(), &key, span, found);
        find_in_value(value, &key, span, found);
    }
}

fn find_in_value(value: &Spanned<DeValue<'_>>, key: &str, span: &Range<usize>, found: &mut Found) {
    keep_shorter(value.span(), key, span, found);
    match value.get_ref() {
        DeValue::Table(table) => find_in_table(table, key, span, found),
        DeValue::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                find_in_value(item, &format!("{key}[{index}]"), span, found);
            }
        }
        _ => {}
    }
}

/// Of equal spans the later one is the inner one.
fn keep_shorter(around: Range<usize>, key: &str, span: &Range<usize>, found: &mut Found) {
    if around.start <= span.start && span.end <= around.end && around.len() <= found.0 {
        *found = (around.len(), key.to_owned());
    }
}

#[cfg(test)]
mod tests;
