//! Buffers of a frame whose size depends on what the device finds.
//!
//! Nobody knows beforehand how many entries the lists of tiles have, nor how many hits pixels
//! blend. Kernels count what they need whether it fits or not, and write what does ([`Counters`]);
//! one for which something does not fit sets the overflow flag. The host reads the counters, grows
//! the buffers ([`super::views::Views::grow`]) and records the frame again. Who waits for each
//! frame uses the loop of [`super::views::Views::retry`]; a queue of frames reads the counters of
//! the first when others are recorded behind it, and its kernels change nothing while the flag is
//! set.

use super::declarations::camera::{CHUNK_WORDS, Counters, PIXEL_WORDS, TILE};
use super::device::Device;
use super::error::GpuError;

/// Chunks of the record for each pixel beside its own, at first.
const CHUNKS_PER_PIXEL: u32 = 1;

/// Capacities of the buffers of a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Capacity {
    /// Entries of the lists of tiles.
    pub entries: u32,
    /// Chunks of the record of hits beside one for each pixel.
    pub chunks: u32,
    /// Rows of pixels that are recorded at once, whole rows of tiles.
    pub(super) rows: u32,
}

impl Capacity {
    /// The usual one for cameras of `width` × `height` pixels; lists have more entries where the
    /// scene has many Gaussians.
    pub(super) fn usual((width, height): (u32, u32)) -> Self {
        Self {
            entries: 0,
            chunks: width
                .saturating_mul(height)
                .saturating_mul(CHUNKS_PER_PIXEL),
            rows: height.next_multiple_of(TILE),
        }
    }

    /// Whether a frame that needs `needed` fits.
    pub fn holds(&self, needed: &Counters) -> bool {
        needed.entries <= self.entries && needed.chunks <= self.chunks
    }

    /// A larger one, after a frame has needed `needed`, and half more: the next view needs another
    /// number. Lists that are incomplete say nothing about the hits on them.
    pub(super) fn grown(&self, needed: &Counters) -> Self {
        let and_half_more = |needed: u32| needed.saturating_add(needed / 2);
        let mut grown = *self;
        if needed.entries > self.entries {
            grown.entries = and_half_more(needed.entries);
        } else if needed.chunks > self.chunks {
            grown.chunks = and_half_more(needed.chunks);
        }
        grown
    }

    /// Fewer rows, as many as fit into a buffer of `device` if they need as many chunks each.
    pub(super) fn within(mut self, device: &Device, width: u32) -> Result<Self, GpuError> {
        let limit = device.max_bytes();
        while self.record_bytes(width) > limit {
            if self.rows == TILE {
                return Err(GpuError::Limit {
                    device: device.adapter().name.clone(),
                    what: format!("hits of {TILE} rows of {width} pixels"),
                    needed: self.record_bytes(width),
                    limit,
                });
            }
            let rows = (self.rows / 2).next_multiple_of(TILE);
            let chunks = u64::from(self.chunks) * u64::from(rows) / u64::from(self.rows);
            self.chunks = u32::try_from(chunks).unwrap_or(u32::MAX);
            self.rows = rows;
        }
        Ok(self)
    }

    /// Word of the record that chunks beside the pixels' own begin with.
    pub(super) fn first_chunk(&self, width: u32) -> u32 {
        PIXEL_WORDS * width * self.rows
    }

    /// Bytes of the record.
    pub(super) fn record_bytes(&self, width: u32) -> u64 {
        let pixels = u64::from(width) * u64::from(self.rows) * u64::from(PIXEL_WORDS);
        4 * (pixels + u64::from(self.chunks) * u64::from(CHUNK_WORDS))
    }
}

/// Why a frame is not complete.
#[derive(Debug)]
pub(super) enum Incomplete {
    /// Buffers have to grow.
    Overflow(Counters),
    /// The device failed.
    Failed(GpuError),
}

impl From<GpuError> for Incomplete {
    fn from(error: GpuError) -> Self {
        Self::Failed(error)
    }
}
