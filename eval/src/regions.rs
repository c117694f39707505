//! The error of relit renders by region: emitters, lit surfaces, and shadows.
//!
//! The references define the regions. A pixel belongs to
//!
//! | region | if |
//! |---|---|
//! | `emitter` | its emission is above [`EMITTER_THRESHOLD`](crate::scene_metrics::EMITTER_THRESHOLD) |
//! | `lit` | else, its luminance relative to that under the earlier light is above that of all such pixels together |
//! | `shadow` | else |
//! | `surface` | it does not emit, and the earlier light is not known |
//!
//! Unlike a threshold on brightness, the ratio of two lightings does not depend on albedo: a white
//! wall in the shadow stays shadow. It is compared with the overall change, since a new light may
//! be weaker than the earlier one everywhere; the exposures of the two references need not agree
//! either.

#[cfg(test)]
mod tests;

use crate::encode::assert_comparable;
use crate::pair::decibels;
use crate::psnr::mean_db;
use crate::scene_metrics::emits;
use eagpt_scene::Image;
use eagpt_scene::color::{luminance, srgb_from_linear};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A part of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// Light sources.
    Emitter,
    /// Surfaces that have gained light relative to the whole condition.
    Lit,
    /// Surfaces that have lost light relative to the whole condition.
    Shadow,
    /// Surfaces without an earlier light to compare with.
    Surface,
}

impl Region {
    /// Its name, as in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Emitter => "emitter",
            Self::Lit => "lit",
            Self::Shadow => "shadow",
            Self::Surface => "surface",
        }
    }
}

/// A reference under the new light and its optional companions, all of one size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lights<'a> {
    /// Linear radiance under the new light.
    pub after: &'a Image<3>,
    /// Emission under the new light, if known.
    pub emission: Option<&'a Image<1>>,
    /// The same view under the earlier light, if known.
    pub before: Option<Before<'a>>,
}

/// A view under the earlier light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Before<'a> {
    /// Linear radiance.
    pub radiance: &'a Image<3>,
    /// Emission, if known.
    pub emission: Option<&'a Image<1>>,
}

/// Change of light of a condition: sums of luminance over the pixels of all views that emit neither
/// before nor after.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LightChange {
    before: f64,
    after: f64,
}

impl LightChange {
    /// Adds a view; nothing if its earlier light is not known.
    ///
    /// # Panics
    /// If the sizes differ or the images have no pixels.
    pub(crate) fn add(&mut self, lights: &Lights<'_>) {
        let Some(before) = lights.before else { return };
        assert_comparable(lights.after, before.radiance);
        let pairs = before.radiance.pixels().iter().zip(lights.after.pixels());
        for (i, (b, a)) in pairs.enumerate() {
            if !emits(before.emission, i) && !emits(lights.emission, i) {
                self.before += f64::from(luminance(*b));
                self.after += f64::from(luminance(*a));
            }
        }
    }

    /// Light after over light before; `None` where nothing was lit before.
    pub(crate) fn ratio(&self) -> Option<f64> {
        (self.before > 0.0).then(|| self.after / self.before)
    }
}

/// The error of a region.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RegionMetrics {
    /// Number of pixels, at least 1.
    pub num_pixels: u64,
    /// Their share of all pixels, above 0 to 1.
    pub share: f64,
    /// Mean squared errors of R, G, B in sRGB clipped to [0, 1].
    pub mse_srgb: [f64; 3],
    /// Mean squared errors of R, G, B in linear light.
    pub mse_linear: [f64; 3],
    /// Mean over channels of the decibels of `mse_srgb`; infinite for equal pixels, which is `null`
    /// in JSON.
    #[serde(with = "decibels")]
    pub psnr_srgb_db: f64,
    /// Mean over channels of the decibels of `mse_linear`; infinite for equal pixels, which is
    /// `null` in JSON.
    #[serde(with = "decibels")]
    pub psnr_linear_db: f64,
    /// Mean luminance of the reference.
    pub luminance_reference: f64,
    /// Mean luminance of the render: above that of the reference where light leaks in.
    pub luminance_render: f64,
}

/// Sums over the pixels of a region.
#[derive(Debug, Clone, Copy, Default)]
struct RegionTotals {
    num_pixels: u64,
    squared_srgb: [f64; 3],
    squared_linear: [f64; 3],
    luminance_reference: f64,
    luminance_render: f64,
}

impl RegionTotals {
    fn add_pixel(&mut self, reference: [f32; 3], render: [f32; 3]) {
        let shown = |linear: f32| f64::from(srgb_from_linear(linear.clamp(0.0, 1.0)).min(1.0));
        self.num_pixels += 1;
        for (c, (r, t)) in reference.into_iter().zip(render).enumerate() {
            self.squared_srgb[c] += (shown(t) - shown(r)).powi(2);
            self.squared_linear[c] += (f64::from(t) - f64::from(r)).powi(2);
        }
        self.luminance_reference += f64::from(luminance(reference));
        self.luminance_render += f64::from(luminance(render));
    }

    /// Adds the pixels behind `metrics`.
    fn add(&mut self, metrics: &RegionMetrics) {
        let num = metrics.num_pixels as f64;
        self.num_pixels += metrics.num_pixels;
        for c in 0..3 {
            self.squared_srgb[c] += metrics.mse_srgb[c] * num;
            self.squared_linear[c] += metrics.mse_linear[c] * num;
        }
        self.luminance_reference += metrics.luminance_reference * num;
        self.luminance_render += metrics.luminance_render * num;
    }

    fn metrics(&self, num_pixels_of_all: u64) -> RegionMetrics {
        let num = self.num_pixels as f64;
        let mse_srgb = self.squared_srgb.map(|sum| sum / num);
        let mse_linear = self.squared_linear.map(|sum| sum / num);
        RegionMetrics {
            num_pixels: self.num_pixels,
            share: num / num_pixels_of_all as f64,
            mse_srgb,
            mse_linear,
            psnr_srgb_db: mean_db(mse_srgb),
            psnr_linear_db: mean_db(mse_linear),
            luminance_reference: self.luminance_reference / num,
            luminance_render: self.luminance_render / num,
        }
    }
}

/// Regions that have pixels, with their errors.
pub type Regions = BTreeMap<Region, RegionMetrics>;

/// Splits the error of a linear Rec.709 render; `change` is [`LightChange::ratio`] of the
/// condition. Empty where neither emission nor the earlier light is known.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub(crate) fn region_metrics(
    lights: &Lights<'_>,
    render: &Image<3>,
    change: Option<f64>,
) -> Regions {
    assert_comparable(lights.after, render);
    let change = change.filter(|_| lights.before.is_some());
    if lights.emission.is_none() && change.is_none() {
        return Regions::new();
    }
    let mut sums = BTreeMap::<Region, RegionTotals>::new();
    let pairs = lights.after.pixels().iter().zip(render.pixels());
    for (i, (reference, render)) in pairs.enumerate() {
        let region = region(lights, i, change);
        sums.entry(region)
            .or_default()
            .add_pixel(*reference, *render);
    }
    metrics(&sums)
}

fn region(lights: &Lights<'_>, pixel: usize, change: Option<f64>) -> Region {
    if emits(lights.emission, pixel) {
        return Region::Emitter;
    }
    let (Some(before), Some(change)) = (lights.before, change) else {
        return Region::Surface;
    };
    let of = |image: &Image<3>| f64::from(luminance(image.pixels()[pixel]));
    // Compared without a division: a surface that was black before and is no longer is lit.
    if of(lights.after) > change * of(before.radiance) {
        Region::Lit
    } else {
        Region::Shadow
    }
}

/// The regions of several views together, pixel by pixel.
pub(crate) fn pooled<'a>(views: impl Iterator<Item = &'a Regions>) -> Regions {
    let mut sums = BTreeMap::<Region, RegionTotals>::new();
    for (region, metrics) in views.flatten() {
        sums.entry(*region).or_default().add(metrics);
    }
    metrics(&sums)
}

fn metrics(sums: &BTreeMap<Region, RegionTotals>) -> Regions {
    let num_pixels = sums.values().map(|sums| sums.num_pixels).sum();
    sums.iter()
        .map(|(region, sums)| (*region, sums.metrics(num_pixels)))
        .collect()
}
