//! Stacks: shots of one position under one lighting condition that differ in exposure.

use crate::raw::{Header, RawFrame};
use std::cmp::Ordering;
use std::path::PathBuf;

/// Name of the only condition of a capture that names none.
pub(crate) const ONLY_CONDITION: &str = "all";

/// A decoded shot and its exposure.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shot<'a> {
    /// Its samples.
    pub frame: &'a RawFrame,
    /// Exposure in seconds at ISO 100 and f/1, or whatever all shots of a capture are measured in.
    pub exposure: f64,
}

/// A photograph of a stack.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Photograph {
    /// The file.
    pub path: PathBuf,
    /// Its name relative to the capture, with "/" between folders.
    pub name: String,
    /// Its header, with exposures stated elsewhere filled in.
    pub header: Header,
    /// BLAKE3 digest of the file, hexadecimal.
    pub blake3: String,
}

impl Photograph {
    /// Exposure in seconds at ISO 100 and f/1; 0 if unknown, which the checks refuse.
    pub(crate) fn exposure(&self) -> f64 {
        self.header.metadata.exposure().unwrap_or(0.0)
    }
}

/// Shots of one position under one condition.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stack {
    /// Lighting condition.
    pub condition: String,
    /// Position of the camera.
    pub position: String,
    /// Shots by exposure, shortest first, after [`Stack::sort`].
    pub shots: Vec<Photograph>,
}

impl Stack {
    /// `condition/position`, or the position alone where there is one condition.
    pub(crate) fn name(&self) -> String {
        if self.condition == ONLY_CONDITION {
            self.position.clone()
        } else {
            format!("{}/{}", self.condition, self.position)
        }
    }

    /// Sorts the shots by exposure, equal ones by name.
    pub(crate) fn sort(&mut self) {
        self.shots.sort_by(|a, b| {
            let order = a.exposure().total_cmp(&b.exposure());
            order.then_with(|| natural(&a.name, &b.name))
        });
    }
}

/// Order of names in which numbers count as numbers: `p2` comes before `p10`.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a.as_bytes(), b.as_bytes());
    loop {
        let (Some(x), Some(y)) = (a_rest.first(), b_rest.first()) else {
            return a_rest.len().cmp(&b_rest.len()).then_with(|| a.cmp(b));
        };
        if x.is_ascii_digit() && y.is_ascii_digit() {
            let (m, n) = (digits(a_rest), digits(b_rest));
            let order = trimmed(&a_rest[..m]).cmp(&trimmed(&b_rest[..n]));
            if order != Ordering::Equal {
                return order;
            }
            (a_rest, b_rest) = (&a_rest[m..], &b_rest[n..]);
        } else {
            let order = x.to_ascii_lowercase().cmp(&y.to_ascii_lowercase());
            if order != Ordering::Equal {
                return order;
            }
            (a_rest, b_rest) = (&a_rest[1..], &b_rest[1..]);
        }
    }
}

fn digits(text: &[u8]) -> usize {
    text.iter().take_while(|c| c.is_ascii_digit()).count()
}

/// A number without leading zeros, comparable: the length first.
fn trimmed(digits: &[u8]) -> (usize, &[u8]) {
    let zeros = digits.iter().take_while(|c| **c == b'0').count();
    (digits.len() - zeros, &digits[zeros..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = ["p10_0", "p2_1", "P2_0", "p002_2", "q", "p2"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["p2", "P2_0", "p2_1", "p002_2", "p10_0", "q"]);
    }
}
