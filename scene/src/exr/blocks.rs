//! Blocks of an EXR file: decompressed, their samples made floats, and put at their place.

use super::channels::Selection;
use crate::error::{Result, SceneError};
use crate::image::Image;
use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::Chunk;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::SampleType;
use ::exr::meta::header::Header;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::Path;

/// Decoded samples of one block at its place in the data window.
struct Block<const C: usize> {
    x: usize,
    y: usize,
    width: usize,
    pixels: Vec<[f32; C]>,
}

/// Decodes the blocks of `batch`, on all cores, and empties it.
pub(super) fn decode_batch<const C: usize>(
    meta: &MetaData,
    selection: &Selection<C>,
    batch: &mut Vec<Chunk>,
    blocks: &mut BlockPlacer<'_, C>,
) -> ::exr::error::Result<()> {
    let decoded: Vec<_> = std::mem::take(batch)
        .into_par_iter()
        .map(|chunk| {
            UncompressedBlock::decompress_chunk(chunk, meta, false)
                .map(|block| convert(&block, &meta.headers[selection.header], selection))
        })
        .collect();
    for block in decoded {
        // Smaller levels of a mip map come back as `None`.
        if let Some(block) = block? {
            blocks.place(&block);
        }
    }
    Ok(())
}

fn convert<const C: usize>(
    block: &UncompressedBlock,
    header: &Header,
    selection: &Selection<C>,
) -> Option<Block<C>> {
    let level = block.index.level;
    if (level.x(), level.y()) != (0, 0) {
        return None;
    }
    let (corner, width) = (block.index.pixel_position, block.index.pixel_size.width());
    let mut pixels = vec![[0.0; C]; width * block.index.pixel_size.height()];
    let mut samples = vec![0.0_f32; width];
    let mut halves = vec![f16::ZERO; width];
    for line in block.lines(&header.channels) {
        let channel = line.location.channel;
        if !selection.channels.contains(&channel) {
            continue;
        }
        match header.channels.list[channel].sample_type {
            SampleType::F16 => {
                for (half, bytes) in halves.iter_mut().zip(line.value.as_chunks().0) {
                    *half = f16::from_ne_bytes(*bytes);
                }
                halves.convert_to_f32_slice(&mut samples);
            }
            SampleType::F32 => {
                for (sample, bytes) in samples.iter_mut().zip(line.value.as_chunks().0) {
                    *sample = f32::from_ne_bytes(*bytes);
                }
            }
            SampleType::U32 => {
                for (sample, bytes) in samples.iter_mut().zip(line.value.as_chunks().0) {
                    *sample = u32::from_ne_bytes(*bytes) as f32;
                }
            }
        }
        let row = line.location.position.y() - corner.y();
        let row = &mut pixels[row * width..][..width];
        for (slot, _) in (0..C)
            .zip(selection.channels)
            .filter(|(_, c)| *c == channel)
        {
            for (pixel, sample) in row.iter_mut().zip(&samples) {
                pixel[slot] = *sample;
            }
        }
    }
    Some(Block {
        x: corner.x(),
        y: corner.y(),
        width,
        pixels,
    })
}

/// Copies blocks to their place in the image and remembers which have come.
pub(super) struct BlockPlacer<'a, const C: usize> {
    image: &'a mut Image<C>,
    /// Data window relative to the display window.
    offset_x: i64,
    offset_y: i64,
    num_wanted: usize,
    num_placed: usize,
    seen: HashSet<(usize, usize)>,
}

impl<'a, const C: usize> BlockPlacer<'a, C> {
    pub(super) fn new(header: &Header, image: &'a mut Image<C>) -> Self {
        let data = header.own_attributes.layer_position;
        let display = header.shared_attributes.display_window.position;
        Self {
            image,
            offset_x: i64::from(data.x()) - i64::from(display.x()),
            offset_y: i64::from(data.y()) - i64::from(display.y()),
            num_wanted: header.layer_size.area(),
            num_placed: 0,
            seen: HashSet::new(),
        }
    }

    fn place(&mut self, block: &Block<C>) {
        if !self.seen.insert((block.x, block.y)) {
            return;
        }
        self.num_placed += block.pixels.len();
        let (width, height) = (
            i64::from(self.image.width()),
            i64::from(self.image.height()),
        );
        let left = self.offset_x + block.x as i64;
        let from = left.clamp(0, width);
        let to = (left + block.width as i64).clamp(0, width);
        if from == to {
            return;
        }
        for (row, line) in block.pixels.chunks_exact(block.width).enumerate() {
            let y = self.offset_y + (block.y + row) as i64;
            if (0..height).contains(&y) {
                let target = (y * width + from) as usize..(y * width + to) as usize;
                let source = (from - left) as usize..(to - left) as usize;
                self.image.pixels_mut()[target].copy_from_slice(&line[source]);
            }
        }
    }

    pub(super) fn check_complete(&self, path: &Path) -> Result<()> {
        if self.num_placed == self.num_wanted {
            return Ok(());
        }
        Err(SceneError::invalid(
            path,
            "content",
            format!(
                "truncated or corrupt: {} of {} pixels present",
                self.num_placed, self.num_wanted
            ),
        ))
    }
}
