//! Typed options printed as the command that one would type.
//!
//! The options of a command are one struct that clap reads and serde writes under the same names.
//! [`words`] asks clap how an option is spelled and serde for its value; options that have their
//! default are left out.

use anyhow::{Result, anyhow};
use clap::{Arg, ArgAction, ValueEnum};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};
use std::fmt::Display;

/// The arguments of a command of the program, its name first.
///
/// # Errors
/// If a path is not UTF-8.
pub(crate) fn words(program: &clap::Command, command: &impl Serialize) -> Result<Vec<String>> {
    // Through text: it holds the shortest form of a float.
    let text = serde_json::to_string(command).map_err(|e| anyhow!("command line: {e}"))?;
    let mut words = Vec::new();
    push_command(&mut words, program, &serde_json::from_str(&text)?)?;
    Ok(words)
}

/// Adds a command: an object of one entry, its name with its options.
fn push_command(words: &mut Vec<String>, parent: &clap::Command, value: &Value) -> Result<()> {
    let entry = value.as_object().and_then(|object| object.iter().next());
    let (name, options) = entry.ok_or_else(|| anyhow!("command line: {value} is no command"))?;
    words.push(name.clone());
    let (Some(known), Value::Object(options)) = (parent.find_subcommand(name), options) else {
        return Ok(());
    };
    push_options(words, known, options).map_err(|problem| anyhow!("command line: {problem}"))?;
    match options.get("command") {
        Some(inner) if !inner.is_null() => push_command(words, known, inner),
        _ => Ok(()),
    }
}

fn push_options(
    words: &mut Vec<String>,
    command: &clap::Command,
    options: &Map<String, Value>,
) -> Result<(), String> {
    for argument in command.get_arguments() {
        let value = options.get(argument.get_id().as_str());
        if let Some(value) = value.filter(|value| !value.is_null()) {
            push_option(words, argument, value)?;
        }
    }
    Ok(())
}

/// Adds an option, unless it has its default.
///
/// # Errors
/// If the option does not take such a value.
pub(crate) fn push_option(
    words: &mut Vec<String>,
    argument: &Arg,
    value: &Value,
) -> Result<(), String> {
    let flag = argument.get_long().map(|long| format!("--{long}"));
    if matches!(argument.get_action(), ArgAction::SetTrue) {
        let is_set = value.as_bool();
        let is_set = is_set.ok_or_else(|| format!("{value} is neither true nor false"))?;
        words.extend(flag.filter(|_| is_set));
        return Ok(());
    }
    let is_size = argument.get_value_names().is_some_and(|of| of == ["WxH"]);
    let separator = if is_size { "x" } else { "," };
    let delimiter = argument.get_value_delimiter();
    let mut texts = match value {
        Value::Array(items)
            if delimiter.is_some() || matches!(argument.get_action(), ArgAction::Append) =>
        {
            let texts = items.iter().map(|item| text_of(item, separator));
            texts.collect::<Result<Vec<_>, _>>()?
        }
        value => vec![text_of(value, separator)?],
    };
    if texts == argument.get_default_values() {
        return Ok(());
    }
    if let Some(delimiter) = delimiter.filter(|_| !texts.is_empty()) {
        texts = vec![texts.join(&delimiter.to_string())];
    }
    for text in texts {
        words.extend(flag.clone());
        words.push(text);
    }
    Ok(())
}

fn text_of(value: &Value, separator: &str) -> Result<String, String> {
    Ok(match value {
        Value::String(text) => text.clone(),
        // Whole numbers without a fraction.
        Value::Number(number) => match number.as_f64() {
            Some(float) if number.is_f64() => float.to_string(),
            _ => number.to_string(),
        },
        Value::Bool(value) => value.to_string(),
        Value::Array(items) if items.iter().all(Value::is_number) => {
            let texts = items.iter().map(|item| text_of(item, separator));
            texts.collect::<Result<Vec<_>, _>>()?.join(separator)
        }
        Value::Array(_) => return Err(format!("{value}: takes one value, not several")),
        Value::Null | Value::Object(_) => return Err(format!("{value} is no value of an option")),
    })
}

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
