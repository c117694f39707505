//! Gaussians as few bytes: quantised, in columns of bytes, compressed (zlib).
//!
//! Gaussians that no ray can hit are left out; the rest is in Morton order of the centres, so that
//! neighbours in space are neighbours in the file. The columns, each with a byte for every
//! Gaussian; a word is two of them, low bytes first:
//!
//! | columns | content |
//! |---|---|
//! | 3 words | centre, fraction of the box of all centres, each the difference to the one before |
//! | 2 words | logarithm of the scales |
//! | 5 bytes | quaternion: three components of 12 bits without the largest, and which that is |
//! | 1 word | opacity |
//! | 3 words | logarithm of green radiance, differences of red and of blue to it |
//! | 1 byte | emission |
//! | 3 bytes | albedo |
//! | 1 byte | lamp, from 1; 0 is none |
//! | 24 words | harmonics, where there are any |
//!
//! Differences and harmonics have a sign: 0, −1, 1, −2, …

mod columns;
mod error_of;
mod quantise;

#[cfg(test)]
mod tests;

pub use error_of::PackError;
pub use quantise::Steps;

use crate::error::{Result, ViewerError};
use columns::{Reader, Writer};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_scene::lamps::EMISSION_THRESHOLD;
use eagpt_scene::{Gaussian, Gaussians, Harmonics, Lamps};
use eagpt_trace::model::MIN_ALPHA;
use glam::{Vec2, Vec3};
use quantise::{RotationCode, signed_from_code, signed_to_code};

/// Lamps that a byte can number.
const MAX_LAMPS: usize = 255;

/// A packed scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Pack {
    /// Number of Gaussians in it.
    pub num: usize,
    /// Whether it has harmonics.
    pub has_harmonics: bool,
    /// Sizes of the steps of quantities.
    pub steps: Steps,
    /// The columns, compressed.
    pub bytes: Vec<u8>,
    /// For each packed Gaussian its index in the scene, `[num]`.
    pub order: Vec<u32>,
}

impl Pack {
    /// Packs a scene; Gaussians that emit are given to the lamp that they are a part of.
    ///
    /// # Errors
    /// [`ViewerError::Unfit`] if no ray can hit any Gaussian, or there are more than 255 lamps.
    pub fn new(gaussians: &Gaussians, lamps: &Lamps) -> Result<Self> {
        if lamps.lamps.len() > MAX_LAMPS {
            let num = lamps.lamps.len();
            let problem = format!("{num} lamps, a page has at most {MAX_LAMPS}");
            return Err(ViewerError::Unfit(problem));
        }
        let steps = Steps::of(gaussians)
            .ok_or_else(|| ViewerError::Unfit("no Gaussian that a ray can hit".to_owned()))?;
        let order = quantise::morton_order(gaussians, &steps);
        let rows: Vec<Gaussian> = order.iter().map(|&i| gaussians.get(i as usize)).collect();
        let has_harmonics = !gaussians.harmonics.is_empty();
        let mut columns = Writer::new(rows.len());
        write_geometry(&mut columns, &rows, &steps);
        write_light(&mut columns, &rows, &steps);
        columns.bytes(rows.iter().map(|g| lamp_of(lamps, g)));
        if has_harmonics {
            for k in 0..NUM_COEFFICIENTS {
                let code = |g: &Gaussian| steps.harmonic_code(g.harmonics.0[k]);
                columns.words(rows.iter().map(|g| signed_to_code(code(g))));
            }
        }
        Ok(Self {
            num: rows.len(),
            has_harmonics,
            steps,
            bytes: columns.compressed()?,
            order,
        })
    }

    /// The Gaussians as a browser unpacks them, in packed order, and the lamp of each: from 1, 0 is
    /// none.
    ///
    /// # Errors
    /// [`ViewerError::Packed`] if the bytes are not those of a scene of this size.
    pub fn unpack(&self) -> Result<(Gaussians, Vec<u8>)> {
        let mut columns = Reader::new(&self.bytes, self.num, self.has_harmonics)?;
        let steps = &self.steps;
        let position = [0, 1, 2].map(|axis| {
            let mut at = 0_u16;
            let codes = columns.words().into_iter().map(move |difference| {
                at = at.wrapping_add(difference);
                steps.position(axis, at)
            });
            codes.collect::<Vec<f32>>()
        });
        let scale = [columns.words(), columns.words()];
        let rotation: [Vec<u8>; 5] = std::array::from_fn(|_| columns.bytes());
        let opacity = columns.words();
        let light = [columns.words(), columns.words(), columns.words()];
        let emission = columns.bytes();
        let albedo = [columns.bytes(), columns.bytes(), columns.bytes()];
        let lamps = columns.bytes();
        let harmonics: Vec<Vec<u16>> = (0..NUM_COEFFICIENTS * usize::from(self.has_harmonics))
            .map(|_| columns.words())
            .collect();
        let gaussian = |i: usize| {
            let green = i32::from(light[0][i]);
            let beside = |code: u16| steps.radiance(green + i32::from(signed_from_code(code)));
            let mut coefficients = [0.0; NUM_COEFFICIENTS];
            for (value, codes) in coefficients.iter_mut().zip(&harmonics) {
                *value = steps.harmonic(signed_from_code(codes[i]));
            }
            Gaussian {
                position: Vec3::new(position[0][i], position[1][i], position[2][i]),
                scale: Vec2::new(steps.scale(scale[0][i]), steps.scale(scale[1][i])),
                rotation: RotationCode(rotation.each_ref().map(|column| column[i])).rotation(),
                opacity: steps.opacity(opacity[i]),
                radiance: Vec3::new(
                    beside(light[1][i]),
                    steps.radiance(green),
                    beside(light[2][i]),
                ),
                harmonics: Harmonics(coefficients),
                emission: f32::from(emission[i]) / 255.0,
                albedo: Vec3::from(albedo.each_ref().map(|column| f32::from(column[i]) / 255.0)),
            }
        };
        Ok(((0..self.num).map(gaussian).collect(), lamps))
    }

    /// Largest differences of the packed scene to `gaussians`, which it was made of.
    ///
    /// # Errors
    /// As [`Self::unpack`].
    pub fn error(&self, gaussians: &Gaussians) -> Result<PackError> {
        let (packed, _) = self.unpack()?;
        let original = self.order.iter().map(|&i| gaussians.get(i as usize));
        Ok(PackError::between(original, packed.iter()))
    }
}

fn lamp_of(lamps: &Lamps, g: &Gaussian) -> u8 {
    if g.emission <= EMISSION_THRESHOLD {
        return 0;
    }
    // At most 255 of them.
    lamps.of(g.position).map_or(0, |index| index as u8 + 1)
}

/// Whether some ray can hit the Gaussian.
fn is_visible(opacity: f32) -> bool {
    opacity >= MIN_ALPHA
}

fn write_geometry(columns: &mut Writer, rows: &[Gaussian], steps: &Steps) {
    for axis in 0..3 {
        let mut before = 0_u16;
        columns.words(rows.iter().map(|g| {
            let code = steps.position_code(axis, g.position[axis]);
            let difference = code.wrapping_sub(before);
            before = code;
            difference
        }));
    }
    for axis in 0..2 {
        columns.words(rows.iter().map(|g| steps.scale_code(g.scale[axis])));
    }
    let codes: Vec<RotationCode> = rows.iter().map(|g| RotationCode::new(g.rotation)).collect();
    for k in 0..5 {
        columns.bytes(codes.iter().map(|code| code.0[k]));
    }
    columns.words(rows.iter().map(|g| steps.opacity_code(g.opacity)));
}

fn write_light(columns: &mut Writer, rows: &[Gaussian], steps: &Steps) {
    let code = |g: &Gaussian, channel: usize| steps.radiance_code(g.radiance[channel]);
    columns.words(rows.iter().map(|g| code(g, 1) as u16));
    for channel in [0, 2] {
        let difference = |g: &Gaussian| (code(g, channel) - code(g, 1)) as i16;
        columns.words(rows.iter().map(|g| signed_to_code(difference(g))));
    }
    let unit = |value: f32| (value * 255.0).round() as u8;
    columns.bytes(rows.iter().map(|g| unit(g.emission)));
    for channel in 0..3 {
        columns.bytes(rows.iter().map(|g| unit(g.albedo[channel])));
    }
}
