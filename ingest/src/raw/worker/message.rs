//! Messages between a process and those that decode for it, over their standard input and output.
//!
//! A request is the length of a JSON header in 4 bytes, the header, and the bytes of the file; an
//! answer [`MAGIC`], the length of a JSON header, the header, and the samples. Numbers are as the
//! machine has them, which is one and the same.

use crate::raw::{Header, RawFrame, Samples, Want};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind, Read, Result, Write};

/// Begins every answer, and is the first that a process says: nothing else is taken for one.
pub(super) const MAGIC: &[u8; 8] = b"eagptraw";
/// Longest header of a message in bytes: that of a photograph has a few thousand.
const MAX_HEADER: u32 = 1 << 20;

/// A frame, or field and problem of a file that cannot be used.
pub(super) type Decoded = std::result::Result<RawFrame, (String, String)>;

/// Request to decode a file.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Request {
    /// Extension of the file, which tells its format.
    pub(super) extension: String,
    /// Whether to decode the samples or the header alone.
    pub(super) want: Want,
    /// Bytes of the file that follow.
    pub(super) num_bytes: u64,
}

/// Answer to a request.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Answer {
    /// The file was decoded; the samples follow.
    Decoded {
        header: Box<Header>,
        /// Whether they are integers of 16 bits, else floating point.
        integers: bool,
        /// Samples that follow.
        num_samples: u64,
    },
    /// The file cannot be used.
    Refused { field: String, problem: String },
}

fn invalid(problem: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::new(ErrorKind::InvalidData, problem)
}

fn write_header(to: &mut dyn Write, header: &impl Serialize) -> Result<()> {
    let text = serde_json::to_vec(header).map_err(invalid)?;
    let length = u32::try_from(text.len()).map_err(invalid)?;
    to.write_all(&length.to_le_bytes())?;
    to.write_all(&text)
}

fn read_header<T: DeserializeOwned>(from: &mut dyn Read) -> Result<T> {
    let mut length = [0; 4];
    from.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length);
    if length > MAX_HEADER {
        return Err(invalid(format!("a header of {length} bytes")));
    }
    let mut text = vec![0; length as usize];
    from.read_exact(&mut text)?;
    serde_json::from_slice(&text).map_err(invalid)
}

/// Sends a request.
pub(super) fn ask(to: &mut dyn Write, request: &Request, bytes: &[u8]) -> Result<()> {
    write_header(to, request)?;
    to.write_all(bytes)?;
    to.flush()
}

/// The next request and the bytes of its file.
pub(super) fn request(from: &mut dyn Read) -> Result<(Request, Vec<u8>)> {
    let request: Request = read_header(from)?;
    let length = usize::try_from(request.num_bytes).map_err(invalid)?;
    let mut bytes = vec![0; length];
    from.read_exact(&mut bytes)?;
    Ok((request, bytes))
}

/// Sends an answer.
pub(super) fn answer(to: &mut dyn Write, decoded: Decoded) -> Result<()> {
    to.write_all(MAGIC)?;
    match decoded {
        Ok(RawFrame { header, samples }) => {
            let answer = Answer::Decoded {
                header: Box::new(header),
                integers: matches!(samples, Samples::Integer(_)),
                num_samples: samples.len() as u64,
            };
            write_header(to, &answer)?;
            match &samples {
                Samples::Integer(samples) => to.write_all(bytemuck::cast_slice(samples))?,
                Samples::Float(samples) => to.write_all(bytemuck::cast_slice(samples))?,
            }
        }
        Err((field, problem)) => write_header(to, &Answer::Refused { field, problem })?,
    }
    to.flush()
}

/// The answer to a request for `want`; field and problem if the file was refused.
pub(super) fn answered(from: &mut dyn Read, want: Want) -> Result<Decoded> {
    let mut magic = [0; MAGIC.len()];
    from.read_exact(&mut magic)?;
    if magic != *MAGIC {
        return Err(invalid("no answer of a decoder"));
    }
    let (header, integers, num_samples) = match read_header(from)? {
        Answer::Refused { field, problem } => return Ok(Err((field, problem))),
        Answer::Decoded {
            header,
            integers,
            num_samples,
        } => (*header, integers, num_samples),
    };
    let expected = match want {
        Want::Header => 0,
        // The size of a header is limited.
        Want::Samples => header.row_len() as u64 * u64::from(header.height),
    };
    if num_samples != expected {
        return Err(invalid(format!("{num_samples} of {expected} samples")));
    }
    let length = usize::try_from(num_samples).map_err(invalid)?;
    let samples = if integers {
        let mut samples = vec![0_u16; length];
        from.read_exact(bytemuck::cast_slice_mut(&mut samples))?;
        Samples::Integer(samples)
    } else {
        let mut samples = vec![0_f32; length];
        from.read_exact(bytemuck::cast_slice_mut(&mut samples))?;
        Samples::Float(samples)
    };
    Ok(Ok(RawFrame { header, samples }))
}
