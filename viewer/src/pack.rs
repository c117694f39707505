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
//! | 3 bytes | square root of albedo |
//! | 1 byte | lamp, from 1; 0 is none |
//! | 24 words | harmonics, where there are any |
//! | 3 words for each light | radiance by that light alone, where there is a basis of light |
//!
//! Differences and harmonics have a sign: 0, −1, 1, −2, …

mod columns;
mod error_of;
mod quantise;

#[cfg(test)]
mod tests;

pub use error_of::PackError;
pub(crate) use quantise::Steps;

use crate::error::{Result, ViewerError};
use columns::{Reader, Writer};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_scene::lamps::EMISSION_THRESHOLD;
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics, Lamps, LightBasis};
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
    /// Names of the lights whose light alone is in it, in order; none without a basis of light.
    pub lights: Vec<String>,
    /// Sizes of the steps of quantities.
    pub(crate) steps: Steps,
    /// The columns, compressed.
    pub bytes: Vec<u8>,
    /// For each packed Gaussian its index in the scene, `[num]`.
    pub order: Vec<u32>,
}

impl Pack {
    /// Packs a scene; Gaussians that emit are given to the lamp that they are a part of. With the
    /// `basis` of its light, which fits it ([`LightBasis::check`]), the light of each lamp alone is
    /// packed as well.
    ///
    /// # Errors
    /// [`ViewerError::Unfit`] if no ray can hit any Gaussian, or there are more than 255 lamps.
    pub fn new(gaussians: &Gaussians, lamps: &Lamps, basis: Option<&LightBasis>) -> Result<Self> {
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
        write_radiances(&mut columns, &rows.iter().map(|g| g.radiance), &steps);
        write_material(&mut columns, &rows);
        columns.bytes(rows.iter().map(|g| lamp_of(lamps, g)));
        if has_harmonics {
            for k in 0..NUM_COEFFICIENTS {
                let code = |g: &Gaussian| steps.harmonic_code(g.harmonics.0[k]);
                columns.words(rows.iter().map(|g| signed_to_code(code(g))));
            }
        }
        let lights = basis.map(LightBasis::lights).unwrap_or_default();
        for alone in (basis.iter()).flat_map(|basis| (0..lights.len()).map(|k| basis.alone(k))) {
            let packed = order.iter().map(|&i| alone[i as usize]);
            write_radiances(&mut columns, &packed, &steps);
        }
        Ok(Self {
            num: rows.len(),
            has_harmonics,
            lights: lights.iter().map(|light| light.name.clone()).collect(),
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
        let mut columns =
            Reader::new(&self.bytes, self.num, self.has_harmonics, self.lights.len())?;
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
        let radiance = read_radiances(&mut columns, steps);
        let emission = columns.bytes();
        let albedo = [columns.bytes(), columns.bytes(), columns.bytes()];
        let lamps = columns.bytes();
        let harmonics: Vec<Vec<u16>> = (0..NUM_COEFFICIENTS * usize::from(self.has_harmonics))
            .map(|_| columns.words())
            .collect();
        let gaussian = |i: usize| {
            let mut coefficients = [0.0; NUM_COEFFICIENTS];
            for (value, codes) in coefficients.iter_mut().zip(&harmonics) {
                *value = steps.harmonic(signed_from_code(codes[i]));
            }
            Gaussian {
                position: Vec3::new(position[0][i], position[1][i], position[2][i]),
                scale: Vec2::new(steps.scale(scale[0][i]), steps.scale(scale[1][i])),
                rotation: RotationCode(rotation.each_ref().map(|column| column[i])).rotation(),
                opacity: steps.opacity(opacity[i]),
                radiance: radiance[i],
                harmonics: Harmonics(coefficients),
                gloss: Gloss::NONE,
                emission: f32::from(emission[i]) / 255.0,
                albedo: Vec3::from(albedo.each_ref().map(|column| Steps::albedo(column[i]))),
            }
        };
        Ok(((0..self.num).map(gaussian).collect(), lamps))
    }

    /// Radiances of the packed Gaussians by light `index` alone, `[num]`, as a browser unpacks
    /// them.
    ///
    /// # Errors
    /// As [`Self::unpack`].
    ///
    /// # Panics
    /// If there is no such light.
    pub fn unpack_light(&self, index: usize) -> Result<Vec<Vec3>> {
        assert!(index < self.lights.len(), "light {index} is not there");
        let mut columns =
            Reader::new(&self.bytes, self.num, self.has_harmonics, self.lights.len())?;
        columns.skip_to_light(index);
        Ok(read_radiances(&mut columns, &self.steps))
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

/// The logarithm of green, and the differences of red and of blue to it.
fn write_radiances(
    columns: &mut Writer,
    radiances: &(impl Iterator<Item = Vec3> + Clone),
    steps: &Steps,
) {
    let code = |radiance: Vec3, channel: usize| steps.radiance_code(radiance[channel]);
    columns.words(radiances.clone().map(|radiance| code(radiance, 1) as u16));
    for channel in [0, 2] {
        let difference = |radiance| (code(radiance, channel) - code(radiance, 1)) as i16;
        columns.words(
            radiances
                .clone()
                .map(|radiance| signed_to_code(difference(radiance))),
        );
    }
}

fn read_radiances(columns: &mut Reader, steps: &Steps) -> Vec<Vec3> {
    let [green, red, blue] = [columns.words(), columns.words(), columns.words()];
    let radiance = |((&green, red), blue): ((&u16, u16), u16)| {
        let green = i32::from(green);
        let beside = |code| steps.radiance(green + i32::from(signed_from_code(code)));
        Vec3::new(beside(red), steps.radiance(green), beside(blue))
    };
    green.iter().zip(red).zip(blue).map(radiance).collect()
}

fn write_material(columns: &mut Writer, rows: &[Gaussian]) {
    let unit = |value: f32| (value * 255.0).round() as u8;
    columns.bytes(rows.iter().map(|g| unit(g.emission)));
    for channel in 0..3 {
        columns.bytes(rows.iter().map(|g| Steps::albedo_code(g.albedo[channel])));
    }
}
