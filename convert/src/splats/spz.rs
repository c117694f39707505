//! SPZ (Niantic): Gaussians in 8 to 24 bits for each number, compressed as a whole by gzip.
//!
//! Header: magic, version and count as u32, degree, fractional bits, flags, 0. Then arrays, each
//! for all Gaussians: positions, opacities, colours, scales, rotations, harmonics. Its axes are x
//! right, y up, z back; the PLY that such files are made of has y down and z forward, and so has
//! what is returned here, as the format's own tools have it.

use crate::error::{ConvertError, Result};
use eagpt_scene::ply::{NUM_SPLAT_FUNCTIONS, Splat, Splats};
use eagpt_scene::{SceneError, files};
use flate2::read::GzDecoder;
use glam::{Quat, Vec3};
use std::io::Read;
use std::path::Path;

/// First bytes of a gzip file.
const GZIP: [u8; 2] = [0x1f, 0x8b];
/// "NGSP", little endian.
const MAGIC: u32 = 0x5053_474e;
const HEADER_BYTES: usize = 16;
/// Most bytes that deflate makes of one.
const MAX_GROWTH: usize = 1032;
/// Colours are stored as 0.5 + 0.15 c, c the coefficient of degree 0.
const COLOR_SCALE: f32 = 0.15;
/// Signs that turn the file's axes into those of PLY: a half turn about x.
const AXES: [f32; 3] = [1.0, -1.0, -1.0];
/// The signs of the functions of degrees 1 and 2 under that turn: y z x, xy yz zz xz xx.
const FUNCTION_SIGNS: [f32; NUM_SPLAT_FUNCTIONS - 1] = [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0];

/// Whether a file is compressed as a whole, by its first bytes.
pub(super) fn is_spz(path: &Path) -> Result<bool> {
    let mut first = Vec::new();
    files::open(path)?
        .take(GZIP.len() as u64)
        .read_to_end(&mut first)
        .map_err(|error| SceneError::io(path, "read", error))?;
    Ok(first == GZIP)
}

/// Reads versions 1 to 3.
pub(super) fn read(path: &Path) -> Result<Splats> {
    let compressed = files::read(path)?;
    let most = compressed.len().saturating_mul(MAX_GROWTH);
    let mut stream = GzDecoder::new(compressed.as_slice());
    let mut exactly = |num: usize, part: &str| {
        let mut bytes = Vec::new();
        if num <= most {
            let read = (&mut stream).take(num as u64).read_to_end(&mut bytes);
            read.map_err(|error| ConvertError::invalid(path, part, error.to_string()))?;
        }
        if bytes.len() < num {
            let problem = format!("truncated: {} of {num} bytes are there", bytes.len());
            return Err(ConvertError::invalid(path, part, problem));
        }
        Ok(bytes)
    };
    let header = exactly(HEADER_BYTES, "header")?;
    let word = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| header[at + i]));
    let [degree, fractional_bits] = [header[12], header[13]];
    if word(0) != MAGIC {
        let problem = format!("{:#010x} is not that of SPZ", word(0));
        return Err(ConvertError::invalid(path, "magic", problem));
    }
    let version = word(4);
    if !(1..=3).contains(&version) {
        let problem = format!("{version}; versions 1 to 3 can be read");
        return Err(ConvertError::unsupported(path, "version", problem));
    }
    if degree > 4 || fractional_bits > 24 {
        let problem = format!("degree {degree}, {fractional_bits} fractional bits");
        return Err(ConvertError::invalid(path, "header", problem));
    }
    let num = word(8) as usize;
    let degree = u32::from(degree);
    let num_functions = (degree * (degree + 2)) as usize;
    let mut part = |name: &str, each: usize| exactly(num.saturating_mul(each), name);
    let position_bytes = if version == 1 { 6 } else { 9 };
    let positions = part("positions", position_bytes)?;
    let alphas = part("alphas", 1)?;
    let colors = part("colors", 3)?;
    let scales = part("scales", 3)?;
    let rotation_bytes = if version == 3 { 4 } else { 3 };
    let rotations = part("rotations", rotation_bytes)?;
    let harmonics = part("harmonics", 3 * num_functions)?;
    let list = (0..num).map(|i| {
        let of = |bytes: &[u8]| [0, 1, 2].map(|c| f32::from(bytes[3 * i + c]));
        let mut colour = [[0.0; 3]; NUM_SPLAT_FUNCTIONS];
        colour[0] = of(&colors).map(|value| (value / 255.0 - 0.5) / COLOR_SCALE);
        for k in 0..num_functions.min(NUM_SPLAT_FUNCTIONS - 1) {
            let at = 3 * (num_functions * i + k);
            colour[k + 1] = [0, 1, 2]
                .map(|c| FUNCTION_SIGNS[k] * (f32::from(harmonics[at + c]) - 128.0) / 128.0);
        }
        let at = &positions[position_bytes * i..][..position_bytes];
        let packed = &rotations[rotation_bytes * i..][..rotation_bytes];
        Splat {
            position: Vec3::from(position(at, fractional_bits)) * Vec3::from(AXES),
            scales: Vec3::from(of(&scales).map(|value| (value / 16.0 - 10.0).exp())),
            rotation: match *packed {
                [a, b, c, d] => smallest_three(u32::from_le_bytes([a, b, c, d])),
                _ => first_three([packed[0], packed[1], packed[2]]),
            },
            opacity: f32::from(alphas[i]) / 255.0,
            colour,
        }
    });
    let list: Vec<Splat> = list.collect();
    if let Some(index) = list.iter().position(|splat| !splat.position.is_finite()) {
        let problem = format!("{} is not finite", list[index].position);
        return Err(ConvertError::invalid(
            path,
            format!("positions[{index}]"),
            problem,
        ));
    }
    Ok(Splats {
        list,
        is_3d: true,
        degree,
    })
}

/// Three half-precision numbers, or three of 24 bits with a binary point.
fn position(bytes: &[u8], fractional_bits: u8) -> [f32; 3] {
    match bytes.len() {
        6 => [0, 2, 4].map(|at| half::f16::from_le_bytes([bytes[at], bytes[at + 1]]).to_f32()),
        _ => [0, 3, 6].map(|at| {
            // Shifted up and down, so that the sign fills the upper byte.
            let word = i32::from_le_bytes([0, bytes[at], bytes[at + 1], bytes[at + 2]]) >> 8;
            word as f32 / (1_u32 << fractional_bits) as f32
        }),
    }
}

/// x, y and z in 8 bits each; w is not negative and follows from the length.
fn first_three(bytes: [u8; 3]) -> Quat {
    let [x, y, z] = bytes.map(|byte| f32::from(byte) / 127.5 - 1.0);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    turned([x, y, z, w])
}

/// In the upper two bits which of x, y, z, w is largest, and not negative; then the others, the
/// last one lowest, as a sign and 9 bits of their size up to 1/√2.
fn smallest_three(mut word: u32) -> Quat {
    const MASK: u32 = (1 << 9) - 1;
    let largest = (word >> 30) as usize;
    let mut q = [0.0_f32; 4];
    for i in (0..4).rev().filter(|i| *i != largest) {
        let size = (word & MASK) as f32 / MASK as f32 * std::f32::consts::FRAC_1_SQRT_2;
        q[i] = if word & (MASK + 1) > 0 { -size } else { size };
        word >>= 10;
    }
    let others: f32 = q.iter().map(|value| value * value).sum();
    q[largest] = (1.0 - others).max(0.0).sqrt();
    turned(q)
}

/// In the axes of PLY, of x, y, z, w.
fn turned([x, y, z, w]: [f32; 4]) -> Quat {
    Quat::from_xyzw(AXES[0] * x, AXES[1] * y, AXES[2] * z, w)
}
