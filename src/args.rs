//! Arguments that commands share.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args, ValueEnum};
use serde::{Serialize, Serializer};
use std::num::NonZeroUsize;

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
