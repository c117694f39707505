//! TOML files that people write: values that know where they stand, so that every complaint names
//! file, line and key.
//!
//! A reader asks a [`Table`] for the keys it knows and a [`Node`] for a value of the type it needs;
//! whatever does not fit is a [`SceneError::Script`].

#[path = "node_values.rs"]
mod values;

use crate::error::{Result, SceneError};
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of a script and its name.
#[derive(Debug, Clone, Copy)]
pub struct Text<'a> {
    path: &'a Path,
    text: &'a str,
}

/// Where in a script something stands, for errors that only the scene brings to light.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// Line, counted from 1.
    pub line: usize,
    /// Key, as `step[0].select`.
    pub key: String,
}

impl Origin {
    /// A [`SceneError::Script`] at this place of the script `path`.
    pub fn error(&self, path: &Path, problem: impl Into<String>) -> SceneError {
        SceneError::Script {
            path: path.to_owned(),
            line: self.line,
            key: if self.key.is_empty() {
                "(top level)".to_owned()
            } else {
                self.key.clone()
            },
            problem: problem.into(),
        }
    }
}

impl<'a> Text<'a> {
    /// The content of the file `path`.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if it is no UTF-8.
    pub fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let text = std::str::from_utf8(bytes).map_err(|error| {
            SceneError::invalid(path, "TOML", format!("the text is no UTF-8: {error}"))
        })?;
        Ok(Self { path, text })
    }

    /// The file.
    pub fn path(&self) -> &'a Path {
        self.path
    }

    /// Parses the text.
    ///
    /// # Errors
    /// [`SceneError::Script`] if it is no TOML.
    pub fn parse(&self) -> Result<Spanned<DeValue<'a>>> {
        let table = DeTable::parse(self.text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            self.error(offset, "TOML", error.message())
        })?;
        let span = table.span();
        Ok(Spanned::new(span, DeValue::Table(table.into_inner())))
    }

    fn line(&self, offset: usize) -> usize {
        let before = self.text.as_bytes().iter().take(offset);
        before.filter(|byte| **byte == b'\n').count() + 1
    }

    fn error(&self, offset: usize, key: &str, problem: impl Into<String>) -> SceneError {
        let key = key.to_owned();
        let line = self.line(offset);
        Origin { line, key }.error(self.path, problem)
    }
}

/// A value in a script.
#[derive(Debug, Clone)]
pub struct Node<'a> {
    text: Text<'a>,
    value: &'a Spanned<DeValue<'a>>,
    key: String,
}

/// A table in a script.
#[derive(Debug, Clone)]
pub struct Table<'a> {
    /// The table as a value.
    pub node: Node<'a>,
    entries: &'a DeTable<'a>,
}

impl<'a> Node<'a> {
    /// The whole script.
    pub fn root(text: Text<'a>, value: &'a Spanned<DeValue<'a>>) -> Self {
        let key = String::new();
        Self { text, value, key }
    }

    /// Where it stands.
    pub fn origin(&self) -> Origin {
        Origin {
            line: self.text.line(self.value.span().start),
            key: self.key.clone(),
        }
    }

    /// An error about this value.
    pub fn error(&self, problem: impl Into<String>) -> SceneError {
        self.origin().error(self.text.path, problem)
    }

    /// An error about a value of the wrong type.
    fn unfit(&self, wanted: &str) -> SceneError {
        let found = self.value.get_ref().type_str();
        self.error(format!("is of type {found}, not {wanted}"))
    }

    /// Whether it is a table.
    pub fn is_table(&self) -> bool {
        self.value.get_ref().is_table()
    }

    /// A table with no keys but `known`.
    ///
    /// # Errors
    /// [`SceneError::Script`] if it is no table, or has another key.
    pub fn table(&self, known: &[&str]) -> Result<Table<'a>> {
        let table = self.any_table()?;
        for key in table.entries.keys() {
            if !known.contains(&key.get_ref().as_ref()) {
                return Err(self.text.error(
                    key.span().start,
                    &table.key_of(key.get_ref()),
                    format!("no such key; here there are {}", known.join(", ")),
                ));
            }
        }
        Ok(table)
    }

    /// A table with whatever keys.
    ///
    /// # Errors
    /// [`SceneError::Script`] if it is none.
    pub fn any_table(&self) -> Result<Table<'a>> {
        match self.value.get_ref() {
            DeValue::Table(entries) => Ok(Table {
                node: self.clone(),
                entries,
            }),
            _ => Err(self.unfit("table")),
        }
    }

    /// The elements of an array.
    ///
    /// # Errors
    /// [`SceneError::Script`] if it is none.
    pub fn array(&self) -> Result<Vec<Self>> {
        let DeValue::Array(items) = self.value.get_ref() else {
            return Err(self.unfit("array"));
        };
        let nodes = items.iter().enumerate().map(|(index, value)| Self {
            text: self.text,
            value,
            key: format!("{}[{index}]", self.key),
        });
        Ok(nodes.collect())
    }
}

impl<'a> Table<'a> {
    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<Node<'a>> {
        self.entries.get(key).map(|value| Node {
            text: self.node.text,
            value,
            key: self.key_of(key),
        })
    }

    /// The value of a key that has to be there.
    ///
    /// # Errors
    /// [`SceneError::Script`] if it is not.
    pub fn need(&self, key: &str) -> Result<Node<'a>> {
        self.get(key)
            .ok_or_else(|| self.node.error(format!("`{key}` is missing")))
    }

    /// All keys with their values, by name.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, Node<'a>)> {
        self.entries.iter().map(|(key, value)| {
            let node = Node {
                text: self.node.text,
                value,
                key: self.key_of(key.get_ref()),
            };
            (key.get_ref().as_ref(), node)
        })
    }

    /// The one key that is there.
    ///
    /// # Errors
    /// [`SceneError::Script`] if there is none, or more than one.
    pub fn only(&self) -> Result<(&'a str, Node<'a>)> {
        let mut entries = self.entries();
        match (entries.next(), entries.next()) {
            (Some(entry), None) => Ok(entry),
            (None, _) => Err(self.node.error("is empty")),
            _ => Err(self.node.error("has more than one key: one table each")),
        }
    }

    /// The one of `keys` that is there.
    ///
    /// # Errors
    /// [`SceneError::Script`] if none of them is, or more than one.
    pub fn one_of(&self, keys: &[&'static str]) -> Result<(&'static str, Node<'a>)> {
        let found: Vec<_> = keys
            .iter()
            .filter_map(|&key| Some((key, self.get(key)?)))
            .collect();
        let others = keys.join(", ");
        match found.as_slice() {
            [one] => Ok(one.clone()),
            [] => Err(self.node.error(format!("one of {others} is missing"))),
            [_, (key, second), ..] => {
                Err(second.error(format!("`{key}` is one too many: only one of {others}")))
            }
        }
    }

    fn key_of(&self, key: &str) -> String {
        if self.node.key.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.node.key)
        }
    }
}
