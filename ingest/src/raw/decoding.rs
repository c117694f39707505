//! Decoding in this process, or in others that a damaged file can end without harm.

use super::worker::Workers;
use super::{FileKind, Header, RawFrame, Want, decode, kind_of};
use crate::error::Result;
use eagpt_scene::files;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The processes in which photographs are decoded.
///
/// Decoders of RAW files believe what a file says of itself. One that is damaged may ask them for
/// more memory than there is, which ends a process, overflow the stack, or never end.
#[derive(Debug, Clone, Default)]
pub enum Decoding {
    /// The process itself: a damaged file may end it.
    #[default]
    InProcess,
    /// Processes of a program that calls [`crate::serve_decoding`], with limits of memory and time:
    /// what ends one of them is an error of the file.
    Workers(Arc<Workers>),
}

impl Decoding {
    /// Decoding in processes of `program` with arguments `arguments`, started as they are needed.
    pub fn by_program(program: PathBuf, arguments: Vec<OsString>) -> Self {
        Self::Workers(Arc::new(Workers::new(program, arguments)))
    }

    /// Starts the first process, so that a program that cannot decode is not taken for files that
    /// cannot be decoded.
    ///
    /// # Errors
    /// [`crate::IngestError::Decoder`].
    pub(crate) fn check(&self) -> Result<()> {
        match self {
            Self::InProcess => Ok(()),
            Self::Workers(workers) => workers.check(),
        }
    }

    /// Header of a file, without its samples, and the BLAKE3 digest of the whole file, hexadecimal.
    ///
    /// # Errors
    /// [`crate::IngestError::Photograph`] if the file is no photograph that can be used: 8 bits, a
    /// reduced RAW with three components, an unknown camera or format, a damaged header;
    /// [`crate::IngestError::Scene`] if it cannot be read.
    pub(crate) fn inspect(&self, path: &Path) -> Result<(Header, String)> {
        let bytes = Arc::new(files::read(path)?);
        let digest = files::digest::of_bytes(&bytes);
        let frame = self.decode(path, &bytes, Want::Header)?;
        Ok((frame.header, digest))
    }

    /// Decodes a photograph.
    ///
    /// # Errors
    /// As `inspect`, and if the samples are damaged or end early.
    pub(crate) fn read(&self, path: &Path) -> Result<RawFrame> {
        self.decode(path, &Arc::new(files::read(path)?), Want::Samples)
    }

    fn decode(&self, path: &Path, bytes: &Arc<Vec<u8>>, want: Want) -> Result<RawFrame> {
        match self {
            Self::Workers(workers) if needs_care(path) => workers.decode(path, bytes, want),
            _ => decode(path, bytes, want),
        }
    }
}

/// Whether a decoder of others reads the file. The workspace's reader of EXR, which every command
/// uses, checks sizes before it allocates; what is no photograph is not decoded at all.
fn needs_care(path: &Path) -> bool {
    let is_exr = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    let kind = kind_of(path);
    matches!(
        kind,
        Some(FileKind::Raw | FileKind::Linear | FileKind::Jpeg)
    ) && !is_exr
}
