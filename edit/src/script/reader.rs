//! TOML values that know where they stand, so that every complaint names file, line and key.

use crate::error::{EditError, Result};
use eagpt_scene::dataset::UpAxis;
use glam::{Quat, Vec3};
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Shortest vector that still has a direction.
const MIN_DIRECTION_LENGTH: f32 = 1e-6;

/// The text of a script and its name.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Text<'a> {
    pub(crate) path: &'a Path,
    pub(crate) text: &'a str,
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
    /// An error at this place of the script `path`.
    pub(crate) fn error(&self, path: &Path, problem: impl Into<String>) -> EditError {
        EditError::Script {
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
    /// Parses the text.
    pub(crate) fn parse(&self) -> Result<Spanned<DeValue<'a>>> {
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

    fn error(&self, offset: usize, key: &str, problem: impl Into<String>) -> EditError {
        let key = key.to_owned();
        let line = self.line(offset);
        Origin { line, key }.error(self.path, problem)
    }
}

/// A value in a script.
#[derive(Debug, Clone)]
pub(crate) struct Node<'a> {
    text: Text<'a>,
    value: &'a Spanned<DeValue<'a>>,
    key: String,
}

/// A table in a script.
#[derive(Debug, Clone)]
pub(crate) struct Table<'a> {
    pub(crate) node: Node<'a>,
    entries: &'a DeTable<'a>,
}

impl<'a> Node<'a> {
    /// The whole script.
    pub(crate) fn root(text: Text<'a>, value: &'a Spanned<DeValue<'a>>) -> Self {
        let key = String::new();
        Self { text, value, key }
    }

    /// Where it stands.
    pub(crate) fn origin(&self) -> Origin {
        Origin {
            line: self.text.line(self.value.span().start),
            key: self.key.clone(),
        }
    }

    /// An error about this value.
    pub(crate) fn error(&self, problem: impl Into<String>) -> EditError {
        self.origin().error(self.text.path, problem)
    }

    /// An error about a value of the wrong type.
    fn unfit(&self, wanted: &str) -> EditError {
        let found = self.value.get_ref().type_str();
        self.error(format!("is of type {found}, not {wanted}"))
    }

    /// Whether it is a table.
    pub(crate) fn is_table(&self) -> bool {
        self.value.get_ref().is_table()
    }

    /// A table with no keys but `known`.
    pub(crate) fn table(&self, known: &[&str]) -> Result<Table<'a>> {
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
    pub(crate) fn any_table(&self) -> Result<Table<'a>> {
        match self.value.get_ref() {
            DeValue::Table(entries) => Ok(Table {
                node: self.clone(),
                entries,
            }),
            _ => Err(self.unfit("table")),
        }
    }

    /// The elements of an array.
    pub(crate) fn array(&self) -> Result<Vec<Self>> {
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

    /// A string.
    pub(crate) fn string(&self) -> Result<&'a str> {
        match self.value.get_ref() {
            DeValue::String(text) => Ok(text),
            _ => Err(self.unfit("string")),
        }
    }

    /// `true` or `false`.
    pub(crate) fn flag(&self) -> Result<bool> {
        self.value
            .get_ref()
            .as_bool()
            .ok_or_else(|| self.unfit("boolean"))
    }

    /// A finite number.
    pub(crate) fn number(&self) -> Result<f32> {
        let value = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(|value| value as f64),
            _ => return Err(self.unfit("number")),
        };
        match value {
            Some(value) if (value as f32).is_finite() => Ok(value as f32),
            Some(value) => Err(self.error(format!("{value} is not a finite number"))),
            None => Err(self.error("is a number out of range")),
        }
    }

    /// A number above 0.
    pub(crate) fn positive(&self) -> Result<f32> {
        self.checked(self.number()?, |value| value > 0.0, "is not above 0")
    }

    /// A number of 0 or more.
    pub(crate) fn not_negative(&self) -> Result<f32> {
        self.checked(self.number()?, |value| value >= 0.0, "is negative")
    }

    /// Three finite numbers.
    pub(crate) fn vec3(&self) -> Result<Vec3> {
        let items = self.array()?;
        let [x, y, z] = items.as_slice() else {
            let found = items.len();
            return Err(self.error(format!("has {found} numbers, not 3")));
        };
        Ok(Vec3::new(x.number()?, y.number()?, z.number()?))
    }

    /// A colour: one number for grey, or three.
    pub(crate) fn color(&self) -> Result<Vec3> {
        let color = if matches!(self.value.get_ref(), DeValue::Array(_)) {
            self.vec3()?
        } else {
            Vec3::splat(self.number()?)
        };
        let least = self.checked(color.min_element(), |value| value >= 0.0, "is negative");
        least.map(|_| color)
    }

    /// A colour with all channels at most 1.
    pub(crate) fn albedo(&self) -> Result<Vec3> {
        let color = self.color()?;
        let most = self.checked(color.max_element(), |value| value <= 1.0, "is above 1");
        most.map(|_| color)
    }

    /// A unit vector: three numbers, or the name of an axis.
    pub(crate) fn direction(&self) -> Result<Vec3> {
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
    pub(crate) fn rotation(&self) -> Result<Quat> {
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

impl<'a> Table<'a> {
    /// The value of a key.
    pub(crate) fn get(&self, key: &str) -> Option<Node<'a>> {
        self.entries.get(key).map(|value| Node {
            text: self.node.text,
            value,
            key: self.key_of(key),
        })
    }

    /// The value of a key that has to be there.
    pub(crate) fn need(&self, key: &str) -> Result<Node<'a>> {
        self.get(key)
            .ok_or_else(|| self.node.error(format!("`{key}` is missing")))
    }

    /// All keys with their values, by name.
    pub(crate) fn entries(&self) -> impl Iterator<Item = (&'a str, Node<'a>)> {
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
    pub(crate) fn only(&self) -> Result<(&'a str, Node<'a>)> {
        let mut entries = self.entries();
        match (entries.next(), entries.next()) {
            (Some(entry), None) => Ok(entry),
            (None, _) => Err(self.node.error("is empty")),
            _ => Err(self.node.error("has more than one key: one table each")),
        }
    }

    /// `axis` and `degrees` of this table.
    pub(crate) fn rotation(&self) -> Result<Quat> {
        let axis = self.need("axis")?.direction()?;
        Ok(Quat::from_axis_angle(
            axis,
            self.need("degrees")?.number()?.to_radians(),
        ))
    }

    fn key_of(&self, key: &str) -> String {
        if self.node.key.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.node.key)
        }
    }
}
