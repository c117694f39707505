//! The lights of a scene on the device: see [`crate::params::lights`]. Values of all of them stay
//! there, and kernels exchange those of the light that is shown, for views of several lights follow
//! one another at nearly every step.

use super::kernels;
use super::rows::ResidentRows;
use super::structures::ExchangeParameters;
use crate::error::Result;
use crate::params::{LightParameters, Lights, NUM_OF_LIGHT, NUM_PARAMETERS, RADIANCE};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_trace::gpu::Device;
use eagpt_trace::gpu::kernel::{Pass, groups};

/// [`LightParameters`] on a device.
#[derive(Debug)]
struct ResidentLight {
    light: ResidentRows<NUM_OF_LIGHT>,
    harmonics: Option<ResidentRows<NUM_COEFFICIENTS>>,
}

/// [`Lights`] on a device.
#[derive(Debug)]
pub(super) struct ResidentLights {
    pub(super) current: usize,
    /// Those of the current one are out of date.
    stored: Vec<ResidentLight>,
}

impl ResidentLights {
    /// Brings `lights` to the device.
    pub(super) fn new(device: &Device, lights: &Lights) -> Result<Self> {
        let stored = |stored: &LightParameters| {
            let harmonics = Some(&stored.harmonics).filter(|rows| !rows.is_empty());
            Ok(ResidentLight {
                light: ResidentRows::upload(device, &stored.light)?,
                harmonics: harmonics
                    .map(|rows| ResidentRows::upload(device, rows))
                    .transpose()?,
            })
        };
        Ok(Self {
            current: lights.current,
            stored: lights.stored.iter().map(stored).collect::<Result<_>>()?,
        })
    }

    /// Number of lights, at least 1.
    pub(super) fn num(&self) -> usize {
        self.stored.len().max(1)
    }

    /// The passes after which the values of `light` are in the place of the current ones, in `raw`
    /// and `harmonics` of `num_gaussians`.
    ///
    /// # Panics
    /// If there is no such light.
    pub(super) fn show(
        &mut self,
        device: &Device,
        light: usize,
        num_gaussians: usize,
        (raw, harmonics): (
            &ResidentRows<NUM_PARAMETERS>,
            Option<&mut ResidentRows<NUM_COEFFICIENTS>>,
        ),
    ) -> Vec<Pass> {
        assert!(light < self.num(), "no light {light}");
        let before = std::mem::replace(&mut self.current, light);
        if light == before {
            return Vec::new();
        }
        let each_gaussian = groups(num_gaussians as u32);
        let lanes = |row, first_lane, num_lanes| {
            let parameters = ExchangeParameters {
                num_rows: num_gaussians as u32,
                row: row as u32,
                first_lane: first_lane as u32,
                num_lanes: num_lanes as u32,
            };
            device.uniform("exchanged lanes", &parameters)
        };
        let of_light = lanes(NUM_PARAMETERS, RADIANCE, NUM_OF_LIGHT);
        let exchange = |stored: &ResidentLight| {
            let [a, b, c] = raw.buffers();
            let [d, e, f] = stored.light.buffers();
            device.pass(
                &kernels::EXCHANGE,
                &[&of_light, a, b, c, d, e, f],
                each_gaussian,
            )
        };
        // First the current ones go back to their place.
        let mut passes: Vec<Pass> = [before, light]
            .iter()
            .map(|&place| exchange(&self.stored[place]))
            .collect();
        if let Some(harmonics) = harmonics {
            let of_harmonics = lanes(NUM_COEFFICIENTS, 0, NUM_COEFFICIENTS);
            for place in [before, light] {
                if let Some(stored) = &mut self.stored[place].harmonics {
                    let [a, b, c] = harmonics.buffers();
                    let [d, e, f] = stored.buffers();
                    let buffers = [&of_harmonics, a, b, c, d, e, f];
                    passes.push(device.pass(&kernels::EXCHANGE, &buffers, each_gaussian));
                    std::mem::swap(&mut harmonics.num_steps, &mut stored.num_steps);
                }
            }
        }
        passes
    }

    /// Read back.
    pub(super) fn lights(&self, device: &Device, num_rows: usize) -> Result<Lights> {
        let stored = |stored: &ResidentLight| {
            let harmonics = stored.harmonics.as_ref();
            Ok(LightParameters {
                light: stored.light.learned(device, num_rows)?,
                harmonics: harmonics
                    .map(|rows| rows.learned(device, num_rows))
                    .transpose()?
                    .unwrap_or_default(),
            })
        };
        Ok(Lights {
            current: self.current,
            stored: self.stored.iter().map(stored).collect::<Result<_>>()?,
        })
    }
}
