//! The file of a basis: a [`SealedFormat`] whose header lists lights and arrays.
//!
//! Arrays are, one after the other, each listed with type, shape and the bytes before it:
//! `emitters` (u32, indices of Gaussians that emit), `emitter_lights` (u32, of each its light),
//! `emitter_radiances` (f32, `[m, 3]`) and `reflected` (f16, `[lights, n, 3]`). Of a glossy scene,
//! `glossy` (u32, indices of Gaussians with highlights), `to_eyes` (f16, `[g, 16, 3]`) and
//! `highlights` (f16, `[lights, g, 24]`) follow.

use super::highlights::{Highlights, NUM_EYES};
use super::{Emitter, Light, LightBasis};
use crate::error::{Result, SceneError};
use crate::files::{Key, SealedFormat};
use crate::harmonics::NUM_COEFFICIENTS;
use glam::Vec3;
use half::f16;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const FORMAT: SealedFormat = SealedFormat {
    magic: b"EAGPTLIT",
    version: 1,
    noun: "light basis",
};

#[derive(Serialize, Deserialize)]
struct Header {
    num_gaussians: usize,
    lights: Vec<LightKeys>,
    arrays: Arrays,
    key: Key,
}

#[derive(Serialize, Deserialize)]
struct LightKeys {
    name: String,
    factor: [f32; 3],
    scale: f32,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Arrays {
    emitters: Array,
    emitter_lights: Array,
    emitter_radiances: Array,
    reflected: Array,
    /// None where nothing is glossy.
    #[serde(flatten)]
    highlights: Option<HighlightArrays>,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct HighlightArrays {
    glossy: Array,
    to_eyes: Array,
    highlights: Array,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Array {
    #[serde(rename = "type")]
    kind: Kind,
    shape: Vec<usize>,
    /// Bytes of the arrays before it.
    offset: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    U32,
    F32,
    F16,
}

impl Array {
    fn new(kind: Kind, shape: &[usize], offset: usize) -> Self {
        Self {
            kind,
            shape: shape.to_vec(),
            offset,
        }
    }

    /// Bytes of the arrays up to its end; `None` if no file is that large.
    fn end(&self) -> Option<usize> {
        let size = match self.kind {
            Kind::U32 | Kind::F32 => 4,
            Kind::F16 => 2,
        };
        let num = (self.shape.iter()).try_fold(1_usize, |num, side| num.checked_mul(*side))?;
        self.offset.checked_add(num.checked_mul(size)?)
    }
}

impl Arrays {
    /// Those of so many lights, Gaussians, emitters and glossy Gaussians; `None` if no file is that
    /// large.
    fn new(
        num_lights: usize,
        num_gaussians: usize,
        num_emitters: usize,
        num_glossy: usize,
    ) -> Option<Self> {
        let emitters = Array::new(Kind::U32, &[num_emitters], 0);
        let emitter_lights = Array::new(Kind::U32, &[num_emitters], emitters.end()?);
        let emitter_radiances = Array::new(Kind::F32, &[num_emitters, 3], emitter_lights.end()?);
        let shape = [num_lights, num_gaussians, 3];
        let reflected = Array::new(Kind::F16, &shape, emitter_radiances.end()?);
        let highlights = match num_glossy {
            0 => None,
            num => {
                let glossy = Array::new(Kind::U32, &[num], reflected.end()?);
                let to_eyes = Array::new(Kind::F16, &[num, NUM_EYES, 3], glossy.end()?);
                let shape = [num_lights, num, NUM_COEFFICIENTS];
                let highlights = Array::new(Kind::F16, &shape, to_eyes.end()?);
                Some(HighlightArrays {
                    glossy,
                    to_eyes,
                    highlights,
                })
            }
        };
        Some(Self {
            emitters,
            emitter_lights,
            emitter_radiances,
            reflected,
            highlights,
        })
    }

    /// Bytes of all; `None` if no file is that large.
    fn end(&self) -> Option<usize> {
        let last = self.highlights.as_ref().map(|h| &h.highlights);
        last.unwrap_or(&self.reflected).end()
    }
}

/// The file of the basis of a scene: `SCENE.lights` beside `SCENE.ply`.
pub fn lights_file_beside(scene: &Path) -> PathBuf {
    scene.with_extension("lights")
}

impl LightBasis {
    /// Writes the file at `path`, atomically.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let num = self.emitters.len();
        let num_glossy = self.highlights.gaussians.len();
        let arrays = Arrays::new(self.lights.len(), self.num_gaussians, num, num_glossy)
            .expect("a basis in memory has a size");
        let lights = self.lights.iter().zip(&self.scales);
        let header = Header {
            num_gaussians: self.num_gaussians,
            lights: lights
                .map(|(light, &scale)| LightKeys {
                    name: light.name.clone(),
                    factor: light.factor.to_array(),
                    scale,
                })
                .collect(),
            arrays,
            key: self.key.clone(),
        };
        let all = || self.emitters.iter();
        let mut bytes: Vec<u8> = (all().flat_map(|e| e.index.to_le_bytes()))
            .chain(all().flat_map(|e| e.light.to_le_bytes()))
            .chain(all().flat_map(|e| {
                e.radiance
                    .to_array()
                    .map(f32::to_le_bytes)
                    .into_iter()
                    .flatten()
            }))
            .collect();
        let halves = |values: &[f16]| {
            values
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<_>>()
        };
        bytes.extend(halves(&self.reflected));
        let glossy = self.highlights.gaussians.iter();
        bytes.extend(glossy.flat_map(|index| index.to_le_bytes()));
        bytes.extend(halves(&self.highlights.to_eyes));
        bytes.extend(halves(&self.highlights.harmonics));
        FORMAT.write_bytes(path, &header, &bytes)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`SceneError`] naming the file and the field: it cannot be read, is damaged or of another
    /// version, has a factor that is negative or not finite, or a name that two lights have.
    pub fn read(path: &Path) -> Result<Self> {
        let (header, bytes): (Header, Vec<u8>) = FORMAT.read_bytes(path)?;
        let num_emitters = header.arrays.emitters.shape.iter().product();
        let of_glossy = header.arrays.highlights.as_ref();
        let num_glossy = of_glossy.map_or(0, |h| h.glossy.shape.iter().product());
        let num_lights = header.lights.len();
        let expected = Arrays::new(num_lights, header.num_gaussians, num_emitters, num_glossy);
        let expected = expected.filter(|arrays| arrays.end() == Some(bytes.len()));
        if expected.as_ref() != Some(&header.arrays) {
            return Err(FORMAT.damaged(path, "arrays"));
        }
        check_lights(path, &header.lights)?;
        let from = |array: &Array| &bytes[array.offset..array.end().unwrap_or(array.offset)];
        let words = |array| {
            from(array)
                .as_chunks()
                .0
                .iter()
                .map(|word| u32::from_le_bytes(*word))
        };
        let arrays = &header.arrays;
        let radiances: Vec<f32> = words(&arrays.emitter_radiances)
            .map(f32::from_bits)
            .collect();
        let emitters: Vec<Emitter> = words(&arrays.emitters)
            .zip(words(&arrays.emitter_lights))
            .zip(radiances.as_chunks().0)
            .map(|((index, light), radiance)| Emitter {
                index,
                light,
                radiance: Vec3::from_array(*radiance),
            })
            .collect();
        let is_there = |e: &Emitter| {
            (e.index as usize) < header.num_gaussians && (e.light as usize) < header.lights.len()
        };
        if !emitters.iter().all(is_there) {
            return Err(FORMAT.damaged(path, "emitters"));
        }
        let halves = |array: &Array| -> Vec<f16> {
            let values = from(array).as_chunks().0.iter();
            values.map(|value| f16::from_le_bytes(*value)).collect()
        };
        let highlights =
            (arrays.highlights.as_ref()).map_or_else(Highlights::default, |h| Highlights {
                gaussians: words(&h.glossy).collect(),
                to_eyes: halves(&h.to_eyes),
                harmonics: halves(&h.highlights),
            });
        let is_there = |index: &u32| (*index as usize) < header.num_gaussians;
        if !highlights.gaussians.iter().all(is_there) {
            return Err(FORMAT.damaged(path, "glossy"));
        }
        let reflected = halves(&arrays.reflected);
        let scales = header.lights.iter().map(|light| light.scale).collect();
        let lights = header.lights.into_iter().map(|light| Light {
            name: light.name,
            factor: light.factor.into(),
        });
        Ok(Self {
            lights: lights.collect(),
            num_gaussians: header.num_gaussians,
            emitters,
            scales,
            reflected,
            highlights,
            key: header.key,
        })
    }
}

fn check_lights(path: &Path, lights: &[LightKeys]) -> Result<()> {
    let mut names = BTreeSet::new();
    for (index, light) in lights.iter().enumerate() {
        let invalid = |field: &str, problem: String| {
            SceneError::invalid(path, format!("lights[{index}].{field}"), problem)
        };
        let numbers = light.factor.into_iter().chain([light.scale]);
        if let Some(value) = { numbers }.find(|v| !(v.is_finite() && *v >= 0.0)) {
            let problem = format!("{value:?} is not a number of at least 0");
            return Err(invalid("factor", problem));
        }
        if !names.insert(&light.name) {
            let problem = format!("`{}` is the name of an earlier light too", light.name);
            return Err(invalid("name", problem));
        }
    }
    Ok(())
}
