//! Sealed files, for state that is too large for JSON: a JSON header and an array of floats, with a
//! digest that tells a damaged file. Headers hold the [`eagpt_scene::files::Key`] of the state.
//!
//! Layout, little-endian: eight bytes of magic, u32 version, u64 length of the header, the header,
//! f32 values, then the BLAKE3 digest of everything before it.

use crate::error::Result;
use eagpt_scene::{SceneError, files};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

const DIGEST_LEN: usize = 32;
const PREFIX_LEN: usize = 8 + 4 + 8;

/// The format of a sealed file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SealedFormat {
    pub(crate) magic: &'static [u8; 8],
    pub(crate) version: u32,
    /// Its name in messages, as "checkpoint".
    pub(crate) noun: &'static str,
}

impl SealedFormat {
    /// Writes a file, atomically.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn write(
        &self,
        path: &Path,
        header: &impl Serialize,
        arrays: &[&[f32]],
    ) -> Result<()> {
        let header = serde_json::to_vec(header)
            .map_err(|e| SceneError::invalid(path, "header", e.to_string()))?;
        let num: usize = arrays.iter().map(|array| array.len()).sum();
        let mut bytes = Vec::with_capacity(PREFIX_LEN + header.len() + 4 * num + DIGEST_LEN);
        bytes.extend_from_slice(self.magic);
        bytes.extend_from_slice(&self.version.to_le_bytes());
        bytes.extend_from_slice(&(header.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&header);
        for value in arrays.iter().copied().flatten() {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
        let digest = blake3::hash(&bytes);
        bytes.extend_from_slice(digest.as_bytes());
        files::write_bytes_atomic(path, &bytes)?;
        Ok(())
    }

    /// Reads a file: its header, and all its values in one.
    ///
    /// # Errors
    /// If it cannot be read, is damaged, or is of another kind or version.
    pub(crate) fn read<H: DeserializeOwned>(&self, path: &Path) -> Result<(H, Vec<f32>)> {
        let bytes = files::read(path)?;
        let damaged =
            |what: &str| SceneError::invalid(path, what, format!("the {} is damaged", self.noun));
        if bytes.len() < PREFIX_LEN + DIGEST_LEN || !bytes.starts_with(self.magic) {
            return Err(damaged("magic").into());
        }
        let (body, digest) = bytes.split_at(bytes.len() - DIGEST_LEN);
        if blake3::hash(body).as_bytes() != digest {
            return Err(damaged("digest").into());
        }
        let version = u32::from_le_bytes(body[8..12].try_into().expect("four bytes"));
        if version != self.version {
            let problem = format!("version {version}, this program reads {}", self.version);
            return Err(SceneError::unsupported(path, "version", problem).into());
        }
        let header_len = u64::from_le_bytes(body[12..PREFIX_LEN].try_into().expect("eight bytes"));
        let header_len = usize::try_from(header_len).map_err(|_| damaged("header"))?;
        let rest = &body[PREFIX_LEN..];
        let (header, values) = rest
            .split_at_checked(header_len)
            .ok_or_else(|| damaged("header"))?;
        let header = serde_json::from_slice(header)
            .map_err(|e| SceneError::invalid(path, "header", e.to_string()))?;
        if values.len() % 4 != 0 {
            return Err(damaged("arrays").into());
        }
        let values = values
            .chunks_exact(4)
            .map(|value| f32::from_le_bytes(value.try_into().expect("four bytes")))
            .collect();
        Ok((header, values))
    }
}
