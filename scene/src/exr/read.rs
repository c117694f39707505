//! Reading EXR files.

use super::blocks::{BlockPlacer, decode_batch};
use super::channels::{Selection, select_rgb, select_single};
use crate::color::Chromaticities;
use crate::error::{Result, SceneError};
use crate::files;
use crate::image::Image;
use ::exr::block::chunk::Chunk;
use ::exr::compression::Compression;
use ::exr::meta::MetaData;
use ::exr::meta::header::Header;
use glam::{DVec2, DVec3};
use std::io::{BufReader, Cursor};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Most pixels an image may have: 16,384 squared, an order of magnitude above the largest
/// photographs.
const MAX_PIXELS: u64 = 1 << 28;
/// Most bytes of samples that one byte of file can stand for: deflate reaches 1,032, run lengths
/// and PIZ less. DCT codecs have no such bound.
const MAX_COMPRESSION_RATIO: u64 = 1100;
/// Compressed blocks decoded at a time: enough for all cores, few enough to keep the memory near
/// that of the image.
const BLOCKS_PER_BATCH: usize = 64;

/// Reads colours as linear Rec.709 light: as they are stored, or converted where the attribute
/// `chromaticities` names other primaries, then cut at 0 where Rec.709 does not reach.
///
/// # Errors
/// [`SceneError`] naming the file: unreadable, truncated or corrupt, without three channels (those
/// found are listed), deep, subsampled, larger than 2^28 pixels, or of primaries that span no
/// colours. NaN and infinities are returned, not refused.
pub fn read_rgb(path: &Path) -> Result<Image<3>> {
    let (mut image, converted) = read_colors(path)?;
    if converted {
        for pixel in image.pixels_mut() {
            *pixel = pixel.map(|value| if value < 0.0 { 0.0 } else { value });
        }
    }
    Ok(image)
}

/// As [`read_rgb`], negative where Rec.709 does not reach.
///
/// # Errors
/// As [`read_rgb`].
pub fn read_rgb_unclipped(path: &Path) -> Result<Image<3>> {
    Ok(read_colors(path)?.0)
}

/// Reads vectors, as the x, y, z of normals, as they are stored.
///
/// # Errors
/// As [`read_rgb`], whatever the primaries.
pub fn read_vectors(path: &Path) -> Result<Image<3>> {
    Ok(read(path, select_rgb)?.image)
}

/// Colours as linear Rec.709, and whether they are converted.
fn read_colors(path: &Path) -> Result<(Image<3>, bool)> {
    let Decoded {
        mut image,
        selection,
        chromaticities,
    } = read(path, select_rgb)?;
    let Some(stated) = chromaticities.filter(|stated| !stated.is_rec709()) else {
        return Ok((image, false));
    };
    // A matrix leaves grey as it is, but for rounding.
    if selection.is_grey() {
        return Ok((image, false));
    }
    let matrix = stated.rec709_from_rgb().ok_or_else(|| {
        let problem = format!(
            "{:?} with the white {} span no colours",
            stated.primaries, stated.white
        );
        SceneError::invalid(path, "chromaticities", problem)
    })?;
    for pixel in image.pixels_mut() {
        let light = matrix * DVec3::from(pixel.map(f64::from));
        *pixel = light.as_vec3().to_array();
    }
    Ok((image, true))
}

/// Reads a mask, opacity or depth.
///
/// # Errors
/// As [`read_rgb`].
pub fn read_single(path: &Path) -> Result<Image<1>> {
    Ok(read(path, select_single)?.image)
}

/// Reads `(width, height)` from the header alone.
///
/// # Errors
/// [`SceneError`] naming the file: unreadable, not an EXR file, or larger than 2^28 pixels.
pub fn read_size(path: &Path) -> Result<(u32, u32)> {
    let file = files::open(path)?;
    let meta = guarded(path, || {
        MetaData::read_from_buffered(BufReader::new(file), false).map_err(|e| exr_error(path, e))
    })?;
    let header = meta
        .headers
        .first()
        .ok_or_else(|| SceneError::invalid(path, "header", "missing"))?;
    window_size(path, header)
}

/// Channels of a file as they are stored.
struct Decoded<const C: usize> {
    image: Image<C>,
    selection: Selection<C>,
    chromaticities: Option<Chromaticities>,
}

fn read<const C: usize>(
    path: &Path,
    select: impl Fn(&Path, &[Header]) -> Result<Selection<C>>,
) -> Result<Decoded<C>> {
    let bytes = files::read(path)?;
    guarded(path, || decode(path, &bytes, select))
}

/// Runs the decoder so that an assertion of the EXR library on a corrupt file becomes an error like
/// any other.
pub(super) fn guarded<T>(path: &Path, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        Err(SceneError::invalid(
            path,
            "content",
            "corrupt: the decoder stopped on it",
        ))
    })
}

fn exr_error(path: &Path, error: ::exr::error::Error) -> SceneError {
    use ::exr::error::Error;
    match error {
        Error::Io(source) => SceneError::io(path, "read", source),
        Error::NotSupported(problem) => SceneError::unsupported(path, "content", problem),
        Error::Invalid(problem) => {
            SceneError::invalid(path, "content", format!("truncated or corrupt: {problem}"))
        }
        Error::Aborted => SceneError::invalid(path, "content", "reading was cancelled"),
    }
}

fn decode<const C: usize>(
    path: &Path,
    bytes: &[u8],
    select: impl Fn(&Path, &[Header]) -> Result<Selection<C>>,
) -> Result<Decoded<C>> {
    let reader = ::exr::block::read(Cursor::new(bytes), false).map_err(|e| exr_error(path, e))?;
    let selection = select(path, reader.headers())?;
    let header = reader.headers()[selection.header].clone();
    let (width, height) = window_size(path, &header)?;
    check_header(path, &header, bytes.len() as u64)?;

    let mut image = Image::filled(width, height, [0.0; C]);
    let meta = reader.meta_data().clone();
    let chunks = reader.all_chunks(false).map_err(|e| exr_error(path, e))?;
    let mut blocks = BlockPlacer::new(&header, &mut image);
    let mut batch: Vec<Chunk> = Vec::with_capacity(BLOCKS_PER_BATCH);
    for chunk in chunks {
        let chunk = chunk.map_err(|e| exr_error(path, e))?;
        if chunk.layer_index == selection.header {
            batch.push(chunk);
        }
        if batch.len() == BLOCKS_PER_BATCH {
            decode_batch(&meta, &selection, &mut batch, &mut blocks)
                .map_err(|e| exr_error(path, e))?;
        }
    }
    decode_batch(&meta, &selection, &mut batch, &mut blocks).map_err(|e| exr_error(path, e))?;
    blocks.check_complete(path)?;
    Ok(Decoded {
        image,
        selection,
        chromaticities: chromaticities(&header),
    })
}

/// Primaries and white that a file states.
fn chromaticities(header: &Header) -> Option<Chromaticities> {
    let stated = header.shared_attributes.chromaticities?;
    let xy = |at: ::exr::math::Vec2<f32>| DVec2::new(f64::from(at.x()), f64::from(at.y()));
    Some(Chromaticities {
        primaries: [stated.red, stated.green, stated.blue].map(xy),
        white: xy(stated.white),
    })
}

/// Size of the display window, which is the size of the image.
fn window_size(path: &Path, header: &Header) -> Result<(u32, u32)> {
    let size = header.shared_attributes.display_window.size;
    let (width, height) = (size.width() as u64, size.height() as u64);
    let problem = if width == 0 || height == 0 {
        "empty"
    } else if width.saturating_mul(height) > MAX_PIXELS {
        "larger than 2^28 pixels"
    } else {
        return match (u32::try_from(width), u32::try_from(height)) {
            (Ok(width), Ok(height)) => Ok((width, height)),
            _ => Err(SceneError::invalid(path, "displayWindow", "too large")),
        };
    };
    Err(SceneError::invalid(
        path,
        "displayWindow",
        format!("{width}x{height} is {problem}"),
    ))
}

/// Refuses features that the decoder lacks, and sizes that the file is too short for, before
/// anything is allocated.
fn check_header(path: &Path, header: &Header, num_file_bytes: u64) -> Result<()> {
    if header.deep {
        return Err(SceneError::unsupported(path, "type", "deep data"));
    }
    for channel in &header.channels.list {
        if (channel.sampling.x(), channel.sampling.y()) != (1, 1) {
            return Err(SceneError::unsupported(
                path,
                format!("channel {}", channel.name.to_string().escape_default()),
                "subsampled",
            ));
        }
    }
    let size = header.layer_size;
    let num_pixels = (size.width() as u64).saturating_mul(size.height() as u64);
    let num_bytes = num_pixels.saturating_mul(header.channels.bytes_per_pixel as u64);
    let ratio = match header.compression {
        Compression::Uncompressed => 1,
        Compression::DWAA(_) | Compression::DWAB(_) => u64::MAX,
        _ => MAX_COMPRESSION_RATIO,
    };
    if num_pixels > MAX_PIXELS || num_bytes > num_file_bytes.saturating_mul(ratio) {
        return Err(SceneError::invalid(
            path,
            "dataWindow",
            format!(
                "{}x{} cannot be held by a file of {num_file_bytes} bytes: truncated or corrupt",
                size.width(),
                size.height()
            ),
        ));
    }
    Ok(())
}
