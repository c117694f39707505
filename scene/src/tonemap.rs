//! Tone mapping: what a display shows of scene-referred light. Only pictures to look at go through it, never data.
//!
//! | curve | shown as white | colours brighter than the display |
//! |---|---|---|
//! | [`ToneMap::Srgb`] | 1 | each channel is cut: hues shift to the nearest primary or secondary |
//! | [`ToneMap::Filmic`] | 5.6 | each channel bends: hues shift less, bright colours pale |
//! | [`ToneMap::Aces`] | 12.1 | the same, with more contrast |
//! | [`ToneMap::Reinhard`] | never | hue and saturation stay until a channel is cut |
//! | [`ToneMap::Agx`] | 16.3 | hues stay about the same, bright colours pale towards white |
//!
//! The numbers are for grey light. Exposure comes first: [`Display`] has both.

use crate::color::luminance;
use crate::image::Image;
use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

/// Exposed values are cut here: every tone curve is flat long before, and squares still fit in f32.
const BRIGHTEST: f32 = 1e15;
/// What the automatic exposure shows the mean luminance as: the middle grey of Reinhard et al. 2002.
const MIDDLE_GREY: f64 = 0.18;
/// Automatic exposures are a whole number of these, in stops, so that a person can state the same one.
const EXPOSURE_STEP: f64 = 0.01;
/// Dimmer than this is nothing, not dark: pixels that hit nothing would pull a mean of logarithms down without end.
const DARKEST: f32 = 1e-6;

/// The rational tone curves, which HDR-FLIP uses as well (Andersson et al. 2021).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ToneMapper {
    /// The rational fit to the ACES filmic curve by Narkowicz 2016, without its pre-exposure.
    #[default]
    Aces,
    /// The filmic curve of Hable 2010 ("Uncharted 2"), with its exposure bias of 2 and its white of 11.2.
    Hable,
    /// Y / (1 + Y) on luminance, Reinhard et al. 2002.
    Reinhard,
}

impl ToneMapper {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Aces => "aces",
            Self::Hable => "hable",
            Self::Reinhard => "reinhard",
        }
    }

    /// (a x² + b x + c) / (d x² + e x + f).
    fn coefficients(self) -> [f32; 6] {
        // ACES is published for light that was multiplied by 0.6 before.
        const PRE: f32 = 0.6;
        match self {
            Self::Aces => [
                PRE * PRE * 2.51,
                PRE * 0.03,
                0.0,
                PRE * PRE * 2.43,
                PRE * 0.59,
                0.14,
            ],
            Self::Hable => [0.231_683, 0.013_791, 0.0, 0.18, 0.3, 0.018],
            Self::Reinhard => [0.0, 1.0, 0.0, 0.0, 1.0, 1.0],
        }
    }

    /// Grey light that is shown as `target`, above 0 and below 1.
    pub fn light_shown_as(self, target: f32) -> f32 {
        let [a, b, c, d, e, f] = self.coefficients();
        let (a, b, c) = (a - target * d, b - target * e, c - target * f);
        if a == 0.0 {
            return -c / b;
        }
        let half = -0.5 * (b / a);
        half + (half * half - c / a).sqrt()
    }

    /// What the display shows of exposed light of 0 and more: linear, 0 to 1.
    #[inline(always)]
    pub fn shown(self, light: [f32; 3]) -> [f32; 3] {
        let light = light.map(|v| v.min(BRIGHTEST));
        let shown = if self == Self::Reinhard {
            let scale = 1.0 / (1.0 + luminance(light));
            light.map(|v| v * scale)
        } else {
            let [a, b, c, d, e, f] = self.coefficients();
            light.map(|v| (v * v * a + v * b + c) / (v * v * d + v * e + f))
        };
        shown.map(|v| v.clamp(0.0, 1.0))
    }
}

/// How light becomes a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ToneMap {
    /// As it is, cut at 1.
    #[default]
    Srgb,
    /// [`ToneMapper::Hable`].
    Filmic,
    /// [`ToneMapper::Aces`].
    Aces,
    /// [`ToneMapper::Reinhard`].
    Reinhard,
    /// AgX by Troy Sobotka, base look: a sigmoid in log2 of light whose primaries were moved towards white.
    Agx,
}

impl ToneMap {
    /// All of them with their names in options and files.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Srgb, "srgb"),
        (Self::Filmic, "filmic"),
        (Self::Aces, "aces"),
        (Self::Reinhard, "reinhard"),
        (Self::Agx, "agx"),
    ];

    /// What the display shows of exposed light: linear, 0 to 1. Negative light and NaN are shown as 0.
    pub fn shown(self, light: [f32; 3]) -> [f32; 3] {
        // Not `clamp`, which keeps NaN.
        let light = light.map(|v| v.max(0.0).min(BRIGHTEST));
        match self {
            Self::Srgb => light.map(|v| v.min(1.0)),
            Self::Filmic => ToneMapper::Hable.shown(light),
            Self::Aces => ToneMapper::Aces.shown(light),
            Self::Reinhard => ToneMapper::Reinhard.shown(light),
            Self::Agx => agx::shown(light),
        }
    }
}

impl fmt::Display for ToneMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL[*self as usize].1)
    }
}

impl FromStr for ToneMap {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, name)| *name == text);
        found
            .map(|(map, _)| *map)
            .ok_or_else(|| format!("`{text}` is none of srgb, filmic, aces, reinhard, agx"))
    }
}

/// AgX from its parameters: an inset of the primaries, log2, a sigmoid with a straight part, and back.
mod agx {
    use super::{LazyLock, Mat3, Vec3};

    /// Stops about middle grey that the sigmoid covers, plus those of middle grey itself: log2(0.18).
    const LOG2_GREY: f32 = -2.473_931_2;
    const FIRST_STOP: f32 = LOG2_GREY - 10.0;
    const LAST_STOP: f32 = LOG2_GREY + 6.5;
    /// Where middle grey is on the scale of stops, and what is shown of it, display-encoded.
    const PIVOT: [f32; 2] = [10.0 / 16.5, 0.5];
    const SLOPE: f32 = 2.0;
    const TOE_POWER: f32 = 3.0;
    const SHOULDER_POWER: f32 = 3.25;
    /// The encoding of the display that the curve was made for.
    const GAMMA: f32 = 2.2;

    /// Rec.709 primaries rotated and moved towards white; rows sum to 1, so grey stays grey.
    static INSET: LazyLock<Mat3> = LazyLock::new(|| {
        Mat3::from_cols_array_2d(&[
            [0.842_401_1, 0.042_401_07, 0.042_401_07],
            [0.078_436_5, 0.878_436_5, 0.078_436_5],
            [0.079_162_43, 0.079_162_43, 0.879_162_4],
        ])
    });
    static OUTSET: LazyLock<Mat3> = LazyLock::new(|| INSET.inverse());

    pub(super) fn shown(light: [f32; 3]) -> [f32; 3] {
        let inset = *INSET * Vec3::from(light);
        let encoded = Vec3::from(inset.to_array().map(|v| {
            let stops = v.log2().clamp(FIRST_STOP, LAST_STOP);
            sigmoid((stops - FIRST_STOP) / (LAST_STOP - FIRST_STOP))
        }));
        let outset = (*OUTSET * encoded).clamp(Vec3::ZERO, Vec3::ONE);
        outset.to_array().map(|v| v.powf(GAMMA))
    }

    /// 0 to 1 onto 0 to 1: straight about the pivot, with a toe and a shoulder that bend as x / (1 + xᵖ)^(1/p) does.
    fn sigmoid(x: f32) -> f32 {
        let [px, py] = PIVOT;
        let (width, height, power) = if x < px {
            (px, py, TOE_POWER)
        } else {
            (1.0 - px, 1.0 - py, SHOULDER_POWER)
        };
        // How far the straight line would go beyond the end decides how much it has to bend.
        let bend = (SLOPE * width / height).powf(power) - 1.0;
        let along = (x - px).abs() / width;
        let rise = SLOPE * (x - px) / (1.0 + bend * along.powf(power)).powf(1.0 / power);
        py + rise
    }
}

/// Exposure and tone map of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Display {
    /// Stops: light is multiplied by 2 to this power.
    #[serde(rename = "exposure_stops")]
    pub stops: f32,
    /// What follows.
    pub tone_map: ToneMap,
}

impl Display {
    /// What the display shows of a picture: linear, 0 to 1.
    pub fn shown(&self, image: &Image<3>) -> Image<3> {
        let factor = self.stops.exp2();
        image.map(|pixel| self.tone_map.shown(pixel.map(|v| v * factor)))
    }
}

/// Finds one exposure for many pictures: the one that shows the mean of the logarithm of all their luminances as middle
/// grey, 0.18 (Reinhard et al. 2002, equations 1 and 2). Pixels without light are left out.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExposureMeter {
    sum_log2: f64,
    num_pixels: u64,
}

impl ExposureMeter {
    /// Looks at a picture as well.
    pub fn add(&mut self, image: &Image<3>) {
        for pixel in image.pixels() {
            let luminance = luminance(*pixel);
            if luminance.is_finite() && luminance > DARKEST {
                self.sum_log2 += f64::from(luminance).log2();
                self.num_pixels += 1;
            }
        }
    }

    /// The exposure in stops, to a hundredth; 0 if all was black.
    pub fn stops(&self) -> f32 {
        if self.num_pixels == 0 {
            return 0.0;
        }
        let stops = MIDDLE_GREY.log2() - self.sum_log2 / self.num_pixels as f64;
        ((stops / EXPOSURE_STEP).round() * EXPOSURE_STEP) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Luminances from 2⁻¹⁴ to 2¹⁴.
    fn lights() -> impl Iterator<Item = f32> {
        (-1400..=1400).map(|i| (i as f32 / 100.0).exp2())
    }

    #[test]
    fn every_rational_curve_shows_its_target() {
        for mapper in [ToneMapper::Aces, ToneMapper::Hable, ToneMapper::Reinhard] {
            let [shown, _, _] = mapper.shown([mapper.light_shown_as(0.85); 3]);
            assert!((shown - 0.85).abs() < 1e-5, "{mapper:?} {shown}");
            assert_eq!(mapper.shown([0.0; 3]), [0.0; 3]);
            assert!(mapper.shown([f32::MAX; 3])[0] > 0.99);
        }
        // Reinhard: x / (1 + x) = 0.85.
        assert!((ToneMapper::Reinhard.light_shown_as(0.85) - 0.85 / 0.15).abs() < 1e-5);
    }

    #[test]
    fn every_map_grows_from_black_to_white_and_keeps_grey() {
        for (map, name) in ToneMap::ALL {
            assert_eq!((name.parse(), map.to_string().as_str()), (Ok(map), name));
            let black = map.shown([0.0, -1.0, f32::NAN]);
            assert!(
                black.iter().all(|v| (0.0..1e-6).contains(v)),
                "{map}: {black:?}"
            );
            let mut before = 0.0;
            for light in lights() {
                let [r, g, b] = map.shown([light; 3]);
                assert!(
                    (0.0..=1.0).contains(&r) && r + 1e-6 >= before,
                    "{map} at {light}: {r}"
                );
                assert!(
                    (r - g).abs() < 1e-4 && (r - b).abs() < 1e-4,
                    "{map} at {light}"
                );
                before = r;
            }
            assert!(map.shown([f32::INFINITY; 3])[0] > 0.999, "{map}");
        }
    }

    #[test]
    fn white_is_where_the_table_says() {
        for (map, white) in [
            (ToneMap::Srgb, 1.0),
            (ToneMap::Filmic, 5.6),
            (ToneMap::Aces, 12.1),
            (ToneMap::Agx, 16.3),
        ] {
            let [at, below] = [1.005, 0.97].map(|factor| map.shown([white * factor; 3])[0]);
            assert!(at > 0.9999 && below < 0.9999, "{map}: {below} {at}");
        }
        // Middle grey: 0.5^2.2 for AgX; by hand for ACES, x = 0.6·0.18: x(2.51x + 0.03) / (x(2.43x + 0.59) + 0.14).
        assert!((ToneMap::Agx.shown([0.18; 3])[0] - 0.217_64).abs() < 1e-4);
        assert!((ToneMap::Aces.shown([0.18; 3])[0] - 0.140_12).abs() < 1e-4);
    }

    #[test]
    fn hues_do_what_the_table_says() {
        // A bright orange: red : green is 4 : 1.
        let orange = [8.0, 2.0, 0.2];
        let shown = |map: ToneMap| map.shown(orange);
        assert_eq!(shown(ToneMap::Srgb), [1.0, 1.0, 0.2]);
        let [r, g, b] = ToneMap::Reinhard.shown([0.8, 0.2, 0.02]);
        assert!((r / g - 4.0).abs() < 1e-4 && (r / b - 40.0).abs() < 1e-3);
        // Blue, which srgb leaves alone, is lifted towards white by AgX.
        assert!(shown(ToneMap::Agx)[2] > 2.0 * shown(ToneMap::Srgb)[2]);
        for map in [ToneMap::Filmic, ToneMap::Aces, ToneMap::Agx] {
            let [r, g, b] = shown(map);
            assert!(r > g && g > b, "{map}: {:?}", [r, g, b]);
        }
    }

    #[test]
    fn the_sigmoid_of_agx_is_steepest_at_grey_and_hits_both_ends() {
        let shown = |stops: f32| ToneMap::Agx.shown([0.18 * stops.exp2(); 3])[0].powf(1.0 / 2.2);
        assert!(shown(-10.0) < 1e-3 && shown(6.5) > 0.999);
        // Encoded values rise by 2 for a scale of 16.5 stops.
        let slope = (shown(0.1) - shown(-0.1)) / 0.2;
        assert!((slope - 2.0 / 16.5).abs() < 1e-3, "{slope}");
    }

    #[test]
    fn the_meter_shows_the_geometric_mean_as_middle_grey() {
        let mut meter = ExposureMeter::default();
        assert_eq!(meter.stops(), 0.0);
        let picture =
            |values: [f32; 2]| Image::from_pixels(2, 1, values.map(|v| [v; 3]).to_vec()).unwrap();
        // Mean of logarithms: (0.09 · 1.44)^(1/2) = 0.36, one stop above 0.18; black does not count.
        meter.add(&picture([0.09, 1.44]));
        meter.add(&picture([0.0, f32::NAN]));
        assert!((meter.stops() + 1.0).abs() < 1e-6, "{}", meter.stops());
        let display = Display {
            stops: meter.stops(),
            tone_map: ToneMap::Srgb,
        };
        let shown = display.shown(&picture([0.36, 9.0]));
        assert!((shown.get(0, 0)[0] - 0.18).abs() < 1e-6);
        assert_eq!(shown.get(1, 0), [1.0; 3]);
    }
}
