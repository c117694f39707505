//! Typed options printed as the command that one would type.

use clap::ValueEnum;
use serde::Serializer;
use std::fmt::Display;

/// A command as one would type it into a shell.
pub(crate) fn shown(words: &[String]) -> String {
    let quoted = words.iter().map(|word| {
        let is_plain = |c: char| c.is_alphanumeric() || "-_./,=:+%@".contains(c);
        match !word.is_empty() && word.chars().all(is_plain) {
            true => word.clone(),
            false => format!("'{}'", word.replace('\'', "'\\''")),
        }
    });
    format!("eagpt {}", quoted.collect::<Vec<_>>().join(" "))
}

/// Serializes a value as the text that its option is given.
pub(crate) fn text<T: Display, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(value)
}

/// Serializes a value under its name on the command line.
pub(crate) fn value<T: ValueEnum, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    match value.to_possible_value() {
        Some(possible) => to.serialize_str(possible.get_name()),
        None => to.serialize_none(),
    }
}

/// As [`text`], of a value that may not be given.
pub(crate) fn optional_text<T: Display, S: Serializer>(
    value: &Option<T>,
    to: S,
) -> Result<S::Ok, S::Error> {
    match value {
        Some(value) => to.collect_str(value),
        None => to.serialize_none(),
    }
}

/// As [`text`], of several values.
pub(crate) fn texts<T: Display, S: Serializer>(values: &[T], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(values.iter().map(ToString::to_string))
}
