//! A part of work that several processes or machines divide among them.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A part of a list: every [`of`](Self::of)-th item, from the [`index`](Self::index)-th on.
///
/// Written as `2/3`. Neighbours go to different parts, so that what is heavy in one place of the
/// list is shared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Shard {
    /// Number of this part, 1 to `of`.
    pub index: u32,
    /// Number of parts, at least 1.
    pub of: u32,
}

impl Shard {
    /// Everything.
    pub const WHOLE: Self = Self { index: 1, of: 1 };

    /// True if the item at `place`, counted from 0, belongs to it.
    pub fn has(self, place: usize) -> bool {
        place % self.of as usize == self.index as usize - 1
    }

    /// All parts of which it is one, in order.
    pub fn siblings(self) -> impl Iterator<Item = Self> {
        (1..=self.of).map(move |index| Self { index, ..self })
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index, of }),
            _ => Err(format!("`{text}` is not I/N with I from 1 to N")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_divide_a_list() {
        let shard: Shard = "2/3".parse().unwrap();
        for place in 0..20 {
            let owners = shard.siblings().filter(|shard| shard.has(place));
            assert_eq!(owners.count(), 1);
            assert!(Shard::WHOLE.has(place));
        }
        assert!(shard.has(1) && shard.has(4) && !shard.has(0));
    }

    #[test]
    fn shards_are_parsed() {
        assert_eq!("2/3".parse(), Ok(Shard { index: 2, of: 3 }));
        assert_eq!(Shard { index: 2, of: 3 }.to_string(), "2/3");
        for bad in ["0/3", "4/3", "1", "1/0", "a/b", "1/-1", ""] {
            assert!(bad.parse::<Shard>().unwrap_err().contains(bad));
        }
    }
}
