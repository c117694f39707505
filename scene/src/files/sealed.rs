//! Sealed files, for state that is too large for JSON: a JSON header and arrays of numbers, with a
//! digest that tells a damaged file. Headers hold the [`super::Key`] of the state.
//!
//! Layout, little-endian: eight bytes of magic, u32 version, u64 length of the header, the header,
//! the arrays, then the BLAKE3 digest of everything before it. Spaces at the end of the header let
//! the arrays begin at a multiple of four bytes.

use super::write_bytes_atomic;
use crate::error::{Result, SceneError};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

const DIGEST_LEN: usize = 32;
const PREFIX_LEN: usize = 8 + 4 + 8;

/// The format of a sealed file.
#[derive(Debug, Clone, Copy)]
pub struct SealedFormat {
    /// First bytes.
    pub magic: &'static [u8; 8],
    /// Version of the layout of header and arrays.
    pub version: u32,
    /// Its name in messages, as "checkpoint".
    pub noun: &'static str,
}

impl SealedFormat {
    /// Writes a file with arrays of f32, atomically.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path, header: &impl Serialize, arrays: &[&[f32]]) -> Result<()> {
        let num: usize = arrays.iter().map(|array| array.len()).sum();
        self.seal(path, header, 4 * num, |bytes| {
            for value in arrays.iter().copied().flatten() {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        })
    }

    /// Writes a file, atomically; `arrays` are little-endian.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_bytes(&self, path: &Path, header: &impl Serialize, arrays: &[u8]) -> Result<()> {
        self.seal(path, header, arrays.len(), |bytes| {
            bytes.extend_from_slice(arrays);
        })
    }

    fn seal(
        &self,
        path: &Path,
        header: &impl Serialize,
        num_bytes: usize,
        fill: impl FnOnce(&mut Vec<u8>),
    ) -> Result<()> {
        let mut header = serde_json::to_vec(header)
            .map_err(|e| SceneError::invalid(path, "header", e.to_string()))?;
        header.resize(header.len().next_multiple_of(4), b' ');
        let mut bytes = Vec::with_capacity(PREFIX_LEN + header.len() + num_bytes + DIGEST_LEN);
        bytes.extend_from_slice(self.magic);
        bytes.extend_from_slice(&self.version.to_le_bytes());
        bytes.extend_from_slice(&(header.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&header);
        fill(&mut bytes);
        let digest = blake3::hash(&bytes);
        bytes.extend_from_slice(digest.as_bytes());
        write_bytes_atomic(path, &bytes)
    }

    /// Reads a file with arrays of f32: its header, and all values in one.
    ///
    /// # Errors
    /// If it cannot be read, is damaged, or is of another kind or version.
    pub fn read<H: DeserializeOwned>(&self, path: &Path) -> Result<(H, Vec<f32>)> {
        let (header, bytes) = self.read_bytes(path)?;
        let (values, rest) = bytes.as_chunks();
        if !rest.is_empty() {
            return Err(self.damaged(path, "arrays"));
        }
        Ok((
            header,
            values.iter().map(|v| f32::from_le_bytes(*v)).collect(),
        ))
    }

    /// Reads a file: its header, and the bytes of all arrays in one.
    ///
    /// # Errors
    /// If it cannot be read, is damaged, or is of another kind or version.
    pub fn read_bytes<H: DeserializeOwned>(&self, path: &Path) -> Result<(H, Vec<u8>)> {
        let mut bytes = super::read(path)?;
        let damaged = |what: &str| self.damaged(path, what);
        if bytes.len() < PREFIX_LEN + DIGEST_LEN || !bytes.starts_with(self.magic) {
            return Err(damaged("magic"));
        }
        let (body, digest) = bytes.split_at(bytes.len() - DIGEST_LEN);
        if blake3::hash(body).as_bytes() != digest {
            return Err(damaged("digest"));
        }
        let version = u32::from_le_bytes(body[8..12].try_into().expect("four bytes"));
        if version != self.version {
            let problem = format!("version {version}, this program reads {}", self.version);
            return Err(SceneError::unsupported(path, "version", problem));
        }
        let header_len = u64::from_le_bytes(body[12..PREFIX_LEN].try_into().expect("eight bytes"));
        let header_len = usize::try_from(header_len).map_err(|_| damaged("header"))?;
        let (header, _) = body[PREFIX_LEN..]
            .split_at_checked(header_len)
            .ok_or_else(|| damaged("header"))?;
        let header = serde_json::from_slice(header)
            .map_err(|e| SceneError::invalid(path, "header", e.to_string()))?;
        bytes.truncate(bytes.len() - DIGEST_LEN);
        bytes.drain(..PREFIX_LEN + header_len);
        Ok((header, bytes))
    }

    /// The error of a file whose `part` cannot be.
    pub fn damaged(&self, path: &Path, part: &str) -> SceneError {
        SceneError::invalid(path, part, format!("the {} is damaged", self.noun))
    }
}
