//! The light of a scene by its lamps: what each Gaussian reflects of each of them.
//!
//! Light is linear in its causes. Once what Gaussians reflect of every lamp alone is known, any mix
//! of powers and colours is a sum, without a ray: the radiance of Gaussian i is
//! `Σ factorₖ · reflected[k, i]` over the lights k. A light is a lamp of the scene, or all that
//! emits and belongs to none ([`REST`]); its factor, of each channel, is 1 for the light that it
//! had when the basis was made ([`LightGroups`] says what belongs to which). Gaussians that emit
//! send out their own light, too, times the factor of their light. Glossy Gaussians have the
//! highlights of each light as harmonics, of which those of a mix are made (`highlights`).
//!
//! The file, [`lights_file_beside`] a scene, has half floats with a power of two for each light:
//! values are within 2⁻¹¹ of what was solved, from the brightest down to 2⁻²⁹ of it. Sums are of
//! these values, in f32 and in the order of the lights, the same everywhere.

mod file;
mod groups;
mod highlights;

#[cfg(test)]
mod tests;

pub use file::lights_file_beside;
pub use groups::{LightGroups, NO_LIGHT, REST};

use crate::files::{Key, digest};
use crate::gaussians::Gaussians;
use crate::harmonics::Harmonics;
use crate::lamps::{self, EMISSION_THRESHOLD};
use glam::Vec3;
use half::f16;
use half::slice::HalfFloatSliceExt;
use highlights::Highlights;
use rayon::prelude::*;

/// Exponent of the brightest value of a light in its half floats, which end below 2^16.
const TOP_EXPONENT: i32 = 15;
/// Share of its radiance that an emitter reflects at most: rounded to half floats it is no more than
/// all of it.
const MAX_REFLECTED: f32 = 1.0 - 1.0 / 1024.0;
/// Share of its radiance by which the light of an emitter may differ: the sum of what it reflects and
/// sends out, of some hundred lights at most, is rounded in f32.
const ROUNDING: f32 = 1e-5;
/// Gaussians that are summed together.
const TOGETHER: usize = 1024;

/// A lamp, or the rest, and how it shines now.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Name that no other light has.
    pub name: String,
    /// Its light as parts of that when the basis was made, by channel, not negative.
    pub factor: Vec3,
}

/// A Gaussian that emits.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Emitter {
    /// Index of the Gaussian.
    index: u32,
    /// Index of its light.
    light: u32,
    /// The part of its radiance that it does not reflect, at the factor 1.
    radiance: Vec3,
}

/// Reflected light of each Gaussian of a scene, light by light.
#[derive(Debug, Clone, PartialEq)]
pub struct LightBasis {
    lights: Vec<Light>,
    num_gaussians: usize,
    /// In the order of their indices.
    emitters: Vec<Emitter>,
    /// Powers of two, `[lights]`: half floats times these are radiances.
    scales: Vec<f32>,
    /// Reflected radiance at the factor 1 in units of `scales`, `[lights, n, 3]`.
    reflected: Vec<f16>,
    highlights: Highlights,
    /// Digests of what it depends on: parts "geometry", "albedos" and, of glossy scenes, "gloss".
    key: Key,
}

/// Digest of all that rays meet: positions, scales, rotations, opacities, and what emits.
pub fn geometry_digest(scene: &Gaussians) -> String {
    let mut bytes = Vec::with_capacity(41 * scene.len());
    for g in scene.iter() {
        let numbers = g.position.to_array().into_iter().chain(g.scale.to_array());
        let numbers = numbers.chain(g.rotation.to_array()).chain([g.opacity]);
        numbers.for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
        bytes.push(u8::from(g.emission > EMISSION_THRESHOLD));
    }
    digest::of_bytes(&bytes)
}

/// Everything that the basis of a scene depends on, but for its light.
fn key(scene: &Gaussians) -> Key {
    let albedos = scene.albedos.iter().flat_map(Vec3::to_array);
    let albedos: Vec<u8> = albedos.flat_map(f32::to_le_bytes).collect();
    let key = Key::new()
        .with("geometry", geometry_digest(scene))
        .with("albedos", digest::of_bytes(&albedos));
    if !scene.is_glossy() {
        return key;
    }
    let gloss = (scene.gloss.iter())
        .flat_map(|g| [g.specular.to_array().as_slice(), &[g.roughness]].concat());
    let gloss: Vec<u8> = gloss.flat_map(f32::to_le_bytes).collect();
    key.with("gloss", digest::of_bytes(&gloss))
}

impl LightBasis {
    /// The basis of `scene` as it shines now. Of `groups.names` each Gaussian reflects `reflected`,
    /// `[n, lights]`; where it emits, the rest of its radiance is its own light.
    pub fn new(scene: &Gaussians, groups: &LightGroups, reflected: &[Vec3]) -> Self {
        let num = groups.names.len();
        let emitters = (0..scene.len() as u32).zip(&groups.of);
        let emitters = emitters.filter(|(_, light)| **light != NO_LIGHT);
        let mut basis = Self {
            lights: (groups.names.iter())
                .map(|name| Light {
                    name: name.clone(),
                    factor: Vec3::ONE,
                })
                .collect(),
            num_gaussians: scene.len(),
            emitters: emitters
                .map(|(index, &light)| Emitter {
                    index,
                    light,
                    radiance: scene.radiances[index as usize],
                })
                .collect(),
            scales: Vec::with_capacity(num),
            reflected: Vec::with_capacity(3 * num * scene.len()),
            highlights: Highlights::default(),
            key: key(scene),
        };
        let mut reflected = reflected.to_vec();
        for emitter in &basis.emitters {
            let mine = &mut reflected[num * emitter.index as usize..][..num];
            let all: Vec3 = mine.iter().sum();
            let most = MAX_REFLECTED * emitter.radiance;
            let share = Vec3::select(all.cmpgt(most), most / all, Vec3::ONE);
            mine.iter_mut().for_each(|light| *light *= share);
        }
        for k in 0..num {
            let mine = reflected.iter().skip(k).step_by(num);
            let brightest = mine.clone().fold(0.0, |most, l| l.max_element().max(most));
            let scale = unit(brightest);
            basis.scales.push(scale);
            let values = mine.flat_map(|light| (*light / scale).to_array());
            basis.reflected.extend(values.map(f16::from_f32));
        }
        for at in 0..basis.emitters.len() {
            let all = basis.reflected_by(&basis.emitters[at], &basis.scaled_factors());
            let own = &mut basis.emitters[at].radiance;
            *own = (*own - all).max(Vec3::ZERO);
        }
        basis
    }

    /// The basis with the highlights of `glossy` Gaussians, ascending, each with unit vectors to the
    /// eyes that see it. `of_light` has their harmonics in one light alone, `[glossy]`.
    ///
    /// # Errors
    /// Those of `of_light`.
    pub fn with_highlights<E>(
        mut self,
        glossy: &[(u32, Vec<Vec3>)],
        mut of_light: impl FnMut(&Self, usize) -> Result<Vec<Harmonics>, E>,
    ) -> Result<Self, E> {
        let mut highlights = Highlights::new(glossy);
        for light in 0..self.lights.len() {
            highlights.push(&of_light(&self, light)?);
        }
        self.highlights = highlights;
        Ok(self)
    }

    /// The lights, in order.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Number of Gaussians of the scene.
    pub fn num_gaussians(&self) -> usize {
        self.num_gaussians
    }

    /// Gaussians that emit and their lights, as indices, in order.
    pub fn emitters(&self) -> impl Iterator<Item = (usize, usize)> {
        let pair = |emitter: &Emitter| (emitter.index as usize, emitter.light as usize);
        self.emitters.iter().map(pair)
    }

    /// Indices of the lights whose name fits a pattern, in which `*` stands for any text.
    pub fn matching(&self, pattern: &str) -> Vec<usize> {
        let lights = self.lights.iter().enumerate();
        let fitting = lights.filter(|(_, light)| lamps::fits(&light.name, pattern));
        fitting.map(|(index, _)| index).collect()
    }

    /// Sets the factor of light `index`: by channel, not negative.
    ///
    /// # Panics
    /// If there is no such light.
    pub fn set_factor(&mut self, index: usize, factor: Vec3) {
        self.lights[index].factor = factor;
    }

    /// Whether it is the basis of `scene` in its present light.
    ///
    /// # Errors
    /// In words, how the scene differs: in another number of Gaussians, in geometry or albedos, or
    /// in the light of what emits.
    pub fn check(&self, scene: &Gaussians) -> Result<(), String> {
        let (here, there) = (self.num_gaussians, scene.len());
        if here != there {
            return Err(format!(
                "of a scene of {here} Gaussians, this one has {there}"
            ));
        }
        let key = key(scene);
        if key != self.key {
            return Err(format!(
                "of a scene with {}",
                key.differences_in_words(&self.key)
            ));
        }
        let factors = self.scaled_factors();
        let is_same = |e: &Emitter| {
            let now = self.own(e) + self.reflected_by(e, &factors);
            let there = scene.radiances[e.index as usize];
            (now - there).abs().max_element() <= ROUNDING * there.max_element()
        };
        if !self.emitters.iter().all(is_same) {
            return Err("of a scene whose emitters have another light".to_owned());
        }
        Ok(())
    }

    /// Light of its own of a Gaussian that emits.
    fn own(&self, emitter: &Emitter) -> Vec3 {
        emitter.radiance * self.lights[emitter.light as usize].factor
    }

    /// Gives `scene`, whose basis it is, the lights at their factors: radiances, and harmonics where
    /// highlights are known.
    pub fn light(&self, scene: &mut Gaussians) {
        let factors = self.scaled_factors();
        let reflected = |i: usize, k: usize| factors[k] * self.reflected_at(i, k);
        let harmonics = self.highlights.mixed(self.lights.len(), reflected);
        scene.radiances = self.radiances();
        self.set_harmonics(scene, &harmonics);
    }

    /// Gives `scene`, whose basis it is, light `index` alone at the factor 1.
    ///
    /// # Panics
    /// If there is no such light.
    pub fn light_alone(&self, scene: &mut Gaussians, index: usize) {
        let all = 0..self.highlights.gaussians.len();
        let harmonics: Vec<Harmonics> = all.map(|m| self.highlights.alone(m, index)).collect();
        scene.radiances = self.alone(index);
        self.set_harmonics(scene, &harmonics);
    }

    /// Sets the harmonics of Gaussians with highlights, `[m]`.
    fn set_harmonics(&self, scene: &mut Gaussians, harmonics: &[Harmonics]) {
        if harmonics.is_empty() {
            return;
        }
        scene.harmonics.resize(scene.len(), Harmonics::NONE);
        for (i, harmonics) in self.highlights.gaussians.iter().zip(harmonics) {
            scene.harmonics[*i as usize] = *harmonics;
        }
    }

    /// Factors of the lights times the units of their half floats, `[lights]`.
    fn scaled_factors(&self) -> Vec<Vec3> {
        let lights = self.lights.iter().zip(&self.scales);
        lights.map(|(light, scale)| light.factor * *scale).collect()
    }

    /// Light `k` that Gaussian `i` reflects, in the unit of the light.
    fn reflected_at(&self, i: usize, k: usize) -> Vec3 {
        let first = 3 * (k * self.num_gaussians + i);
        Vec3::from(std::array::from_fn(|c| self.reflected[first + c].to_f32()))
    }

    /// Radiance that a Gaussian which emits reflects, with these [`Self::scaled_factors`].
    fn reflected_by(&self, emitter: &Emitter, factors: &[Vec3]) -> Vec3 {
        let lights = factors.iter().enumerate();
        let of_light =
            |(k, factor): (usize, &Vec3)| *factor * self.reflected_at(emitter.index as usize, k);
        lights.map(of_light).sum()
    }

    /// Radiances of all Gaussians, `[n]`, with the lights at their factors.
    pub fn radiances(&self) -> Vec<Vec3> {
        let factors = self.scaled_factors();
        let mut radiances = vec![Vec3::ZERO; self.num_gaussians];
        let pieces = radiances.par_chunks_mut(TOGETHER).enumerate();
        pieces.for_each(|(piece, radiances)| {
            let mut values = [0.0; 3 * TOGETHER];
            let values = &mut values[..3 * radiances.len()];
            for (k, &factor) in factors.iter().enumerate() {
                let first = 3 * (k * self.num_gaussians + piece * TOGETHER);
                self.reflected[first..][..values.len()].convert_to_f32_slice(values);
                let (lights, _) = values.as_chunks();
                for (radiance, light) in radiances.iter_mut().zip(lights) {
                    *radiance += factor * Vec3::from_array(*light);
                }
            }
        });
        for emitter in &self.emitters {
            radiances[emitter.index as usize] += self.own(emitter);
        }
        radiances
    }

    /// Radiances of all Gaussians, `[n]`, with light `index` alone at the factor 1.
    ///
    /// # Panics
    /// If there is no such light.
    pub fn alone(&self, index: usize) -> Vec<Vec3> {
        let first = 3 * index * self.num_gaussians;
        let values = self.reflected[first..][..3 * self.num_gaussians].to_f32_vec();
        let (lights, _) = values.as_chunks();
        let scale = self.scales[index];
        let mut radiances: Vec<Vec3> = (lights.iter())
            .map(|light| Vec3::from_array(*light) * scale)
            .collect();
        for emitter in self.emitters.iter().filter(|e| e.light as usize == index) {
            radiances[emitter.index as usize] += emitter.radiance;
        }
        radiances
    }
}

/// The power of two in whose units `brightest` is between 2^14 and 2^15; 1 if that is none.
fn unit(brightest: f32) -> f32 {
    if brightest < f32::MIN_POSITIVE {
        return 1.0;
    }
    let exponent = brightest.log2().floor() as i32 + 1;
    // Both ends are f32 that are not subnormal.
    f32::exp2((exponent - TOP_EXPONENT).clamp(-126, 127) as f32)
}
