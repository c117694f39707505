//! Columns of bytes, compressed as a whole.

use crate::error::{Result, ViewerError};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use std::io::{Read, Write};

/// Columns of a scene without harmonics, and what harmonics add.
const NUM_COLUMNS: usize = 28;
const NUM_HARMONIC_COLUMNS: usize = 2 * NUM_COEFFICIENTS;
/// Columns of a light.
const NUM_LIGHT_COLUMNS: usize = 6;

pub(super) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    pub(super) fn new(num: usize) -> Self {
        Self {
            bytes: Vec::with_capacity(num * (NUM_COLUMNS + NUM_HARMONIC_COLUMNS)),
        }
    }

    pub(super) fn bytes(&mut self, values: impl Iterator<Item = u8>) {
        self.bytes.extend(values);
    }

    /// Low bytes, then high bytes.
    pub(super) fn words(&mut self, values: impl Iterator<Item = u16>) {
        let words: Vec<[u8; 2]> = values.map(u16::to_le_bytes).collect();
        self.bytes.extend(words.iter().map(|word| word[0]));
        self.bytes.extend(words.iter().map(|word| word[1]));
    }

    pub(super) fn compressed(self) -> Result<Vec<u8>> {
        let failed = |e: std::io::Error| ViewerError::Packed(e.to_string());
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&self.bytes).map_err(failed)?;
        encoder.finish().map_err(failed)
    }
}

pub(super) struct Reader {
    bytes: Vec<u8>,
    num: usize,
    at: usize,
    num_lights: usize,
}

impl Reader {
    /// Decompresses the columns of `num` Gaussians.
    pub(super) fn new(
        compressed: &[u8],
        num: usize,
        has_harmonics: bool,
        num_lights: usize,
    ) -> Result<Self> {
        let columns = NUM_COLUMNS
            + NUM_HARMONIC_COLUMNS * usize::from(has_harmonics)
            + NUM_LIGHT_COLUMNS * num_lights;
        let expected = columns * num;
        let mut bytes = Vec::with_capacity(expected);
        // One byte more than there should be shows that there are too many.
        let mut limited = ZlibDecoder::new(compressed).take(expected as u64 + 1);
        limited
            .read_to_end(&mut bytes)
            .map_err(|e| ViewerError::Packed(e.to_string()))?;
        if bytes.len() != expected {
            let problem = format!("not the {expected} bytes of {num} Gaussians");
            return Err(ViewerError::Packed(problem));
        }
        Ok(Self {
            bytes,
            num,
            at: 0,
            num_lights,
        })
    }

    /// Goes on with the columns of a light.
    pub(super) fn skip_to_light(&mut self, index: usize) {
        let columns_from_there = NUM_LIGHT_COLUMNS * (self.num_lights - index);
        self.at = self.bytes.len() - self.num * columns_from_there;
    }

    pub(super) fn bytes(&mut self) -> Vec<u8> {
        let from = self.at;
        self.at += self.num;
        self.bytes[from..self.at].to_vec()
    }

    pub(super) fn words(&mut self) -> Vec<u16> {
        let (low, high) = (self.bytes(), self.bytes());
        let word = |(low, high)| u16::from_le_bytes([low, high]);
        low.into_iter().zip(high).map(word).collect()
    }
}
