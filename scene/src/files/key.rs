//! Digests of everything that decides a result, by part.

use super::digest;
use crate::error::{Result, SceneError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Everything that decides a result: BLAKE3 digests by the name of what was digested, as "scene" or
/// "options". What was made under one key is of use only under the same.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Key(BTreeMap<String, String>);

impl Key {
    /// A key without parts.
    pub fn new() -> Self {
        Self::default()
    }

    /// With a part whose digest is known.
    #[must_use]
    pub fn with(mut self, part: &str, digest: String) -> Self {
        self.0.insert(part.to_owned(), digest);
        self
    }

    /// With a part that is digested as JSON.
    ///
    /// # Errors
    /// If it cannot be put into JSON.
    pub fn with_value(self, part: &str, value: &impl Serialize) -> Result<Self> {
        let json = serde_json::to_vec(value)
            .map_err(|e| SceneError::invalid(Path::new(part), "JSON", e.to_string()))?;
        Ok(self.with(part, digest::of_bytes(&json)))
    }

    /// With the content of a file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn with_file(self, part: &str, path: &Path) -> Result<Self> {
        Ok(self.with(part, digest::of_file(path)?))
    }

    /// Digest of a part.
    pub fn part(&self, part: &str) -> Option<&str> {
        self.0.get(part).map(String::as_str)
    }

    /// Names of the parts in which `other` differs.
    pub fn differences<'a>(&'a self, other: &'a Self) -> Vec<&'a str> {
        let mut names: Vec<&str> = (self.0.keys().chain(other.0.keys()))
            .map(String::as_str)
            .filter(|part| self.part(part) != other.part(part))
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// The differences in words, as "another scene and other options".
    pub fn differences_in_words(&self, other: &Self) -> String {
        let parts = self.differences(other);
        let words: Vec<String> = (parts.iter())
            .map(|part| match part.ends_with('s') {
                true => format!("other {part}"),
                false => format!("another {part}"),
            })
            .collect();
        words.join(" and ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_named() {
        let key = |scene: u32, options: &str| {
            let key = Key::new().with_value("scene", &scene).unwrap();
            key.with_value("options", &options).unwrap()
        };
        assert_eq!(key(1, "a").differences(&key(1, "a")), [""; 0]);
        let words = key(1, "a").differences_in_words(&key(2, "b"));
        assert_eq!(words, "other options and another scene");
        let more = key(1, "a").with("seed", digest::of_bytes(b"0"));
        assert_eq!(key(1, "a").differences(&more), ["seed"]);
        let text = serde_json::to_string(&more).unwrap();
        assert_eq!(serde_json::from_str::<Key>(&text).unwrap(), more);
    }
}
