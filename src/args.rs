//! Arguments that commands share.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args, ValueEnum};
use serde::{Serialize, Serializer};
use std::fmt::Display;
use std::num::NonZeroUsize;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Options of every command.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Global options")]
pub(crate) struct GlobalArgs {
    /// Threads to compute with [default: one for each core]
    #[arg(long, global = true, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Write progress and results as JSON, one object a line, on standard output
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Say more: once for what is done, twice for details
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub(crate) verbose: u8,
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// The command line without the name of the program, as records have it.
    #[arg(skip)]
    pub(crate) command_line: Vec<String>,
}

/// Parses a seed: what TOML and JSON numbers can hold.
pub(crate) fn seed() -> impl TypedValueParser<Value = u64> {
    clap::value_parser!(u64).range(..=i64::MAX as u64)
}

/// Parses a number of a range.
pub(crate) fn within<T>(range: RangeInclusive<T>) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err: Display> + PartialOrd + Display + Clone + Send + Sync + 'static,
{
    move |text: &str| match text.parse::<T>() {
        Ok(value) if range.contains(&value) => Ok(value),
        Ok(value) => Err(format!(
            "{value} is outside {} to {}",
            range.start(),
            range.end()
        )),
        Err(error) => Err(error.to_string()),
    }
}

/// Numbers with commas between them, if they are `N`.
pub(crate) fn numbers<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let numbers: Option<Vec<T>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    numbers?.try_into().ok()
}

/// Parses a width and a height, pixels, whose sides are in a range.
pub(crate) fn size(sides: RangeInclusive<u32>) -> impl TypedValueParser<Value = [u32; 2]> {
    move |text: &str| {
        let size = text.split_once('x');
        let size =
            size.and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
        let size = size.filter(|size| size.iter().all(|side| sides.contains(side)));
        size.ok_or_else(|| {
            let (least, most) = (sides.start(), sides.end());
            format!("`{text}` is not a width and a height of {least} to {most}, as 960x540")
        })
    }
}

/// A value, or `auto` for one that the job finds out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Auto<T>(pub(crate) Option<T>);

impl<T: Serialize> Serialize for Auto<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            None => serializer.serialize_str("auto"),
            Some(value) => value.serialize(serializer),
        }
    }
}

/// Parses a value or `auto`, which `help` describes.
pub(crate) fn auto<T: ValueEnum + Send + Sync + 'static>(
    help: &'static str,
) -> impl TypedValueParser<Value = Auto<T>> {
    let values = T::value_variants().iter();
    let values = values.filter_map(ValueEnum::to_possible_value);
    let auto = std::iter::once(PossibleValue::new("auto").help(help));
    PossibleValuesParser::new(auto.chain(values)).map(|name| Auto(T::from_str(&name, false).ok()))
}
