//! Arguments that commands share.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args};
use eagpt_scene::dataset::{SplitRule, Subset};
use std::num::NonZeroUsize;

/// Options of every command.
#[derive(Debug, Clone, Args)]
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
}

/// Parses the name of a [`SplitRule`].
pub(crate) fn split_rule() -> impl TypedValueParser<Value = SplitRule> {
    PossibleValuesParser::new(["every-8th", "listed", "all", "paper"])
        .try_map(|name| name.parse::<SplitRule>())
}

/// Parses the name of a [`Subset`].
pub(crate) fn subset() -> impl TypedValueParser<Value = Subset> {
    PossibleValuesParser::new(["train", "test", "all"]).try_map(|name| name.parse::<Subset>())
}

/// Parses a seed: what TOML and JSON numbers can hold.
pub(crate) fn seed() -> impl TypedValueParser<Value = u64> {
    clap::value_parser!(u64).range(..=i64::MAX as u64)
}
