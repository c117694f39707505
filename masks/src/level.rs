//! A level of radiance between lit surfaces and lights, found in all views of a scene together.
//!
//! Reflected light spans a wide range of radiances; emitted light lies far above it and is
//! concentrated. In the histogram of log radiance over all pixels of all views, lamps are peaks at
//! the bright end, separated from the rest by little but borders and glossy reflections. The level
//! lies in the valley below the dimmest peak that counts as a lamp's:
//!
//! 1. The histogram, sixteen bins a stop, is smoothed by a Gaussian of a quarter of a stop.
//! 2. A peak counts if the deepest valley on either side, up to a higher peak, is at most a quarter
//!    as high, if it is at least two stops above the median, and if at most three tenths of all
//!    pixels lie above the valley below it.
//! 3. The level is half the lamp's peak, kept within that part of the valley where the histogram is
//!    at most twice its minimum: a pixel less than half covered by a lamp is not a lamp, nor is a
//!    surface lit by a lamp close by.
//! 4. A lamp that is little brighter than the brightest surfaces is a peak only with less
//!    smoothing, where the shine around a bright lamp has peaks as well. It counts if there are
//!    regions of its pixels that nothing brighter is part of ([`Dimmer`]).
//!
//! One level serves a whole scene: exposures are aligned, and a lamp behind the camera of one view
//! causes the reflections of the next. The level decides which pixels are emitters; their borders
//! follow [`crate::Border`].

mod dimmer;

pub(crate) use dimmer::Dimmer;

/// Bins a stop.
const BINS_PER_STOP: usize = 16;
/// Lowest level of the histogram, stops; darker pixels count in the first bin.
const LOWEST_STOP: i32 = -14;
/// Highest level, stops; brighter pixels count in the last bin.
const HIGHEST_STOP: i32 = 18;
const NUM_BINS: usize = (HIGHEST_STOP - LOWEST_STOP) as usize * BINS_PER_STOP;
/// Standard deviation of the smoothing, bins.
const SMOOTHING: f64 = BINS_PER_STOP as f64 / 4.0;
/// Least height of a peak above its valley.
const MIN_PROMINENCE: f64 = 4.0;
/// Least height of a lamp above the median, bins.
const MIN_ABOVE_MEDIAN: usize = 2 * BINS_PER_STOP;
/// Largest share of pixels that are lamps.
const MAX_SHARE: f64 = 0.3;
/// Height of a valley's bottom relative to its lowest point.
const BOTTOM: f64 = 2.0;
/// Pixels added to what a Gaussian covers, so that the ratio of heights is finite; a peak needs
/// several times as many.
const FLOOR: f64 = 5.0;

/// A histogram of log radiance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Histogram {
    counts: Vec<u64>,
}

/// A level and the valley it lies in, linear radiance.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Level {
    /// The level.
    pub level: f32,
    /// Where the bottom of the valley begins.
    pub valley_from: f32,
    /// Where it ends.
    pub valley_to: f32,
    /// The peak above it.
    pub lamp: f32,
    /// Share of all pixels above the level.
    pub share: f64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: vec![0; NUM_BINS],
        }
    }
}

impl Histogram {
    /// Counts the values of an image, linear and not negative.
    pub(crate) fn add(&mut self, values: impl Iterator<Item = f32>) {
        for value in values {
            self.counts[bin(value)] += 1;
        }
    }

    /// The level between lit surfaces and lights.
    ///
    /// # Errors
    /// The problem with the histogram if there is no level.
    pub(crate) fn level(&self) -> Result<Level, String> {
        let brightest = self.counts.iter().rposition(|&count| count > 0);
        let Some(brightest) = brightest else {
            return Err("there are no pixels".to_owned());
        };
        let (smooth, lamps) = self.lamps(SMOOTHING);
        let Some(lamp) = lamps.first() else {
            return Err(format!(
                "radiances show no gap between lit surfaces and lights (median {:.3}, largest {:.3})",
                radiance(self.median() as f64 + 0.5),
                radiance(brightest as f64 + 1.0),
            ));
        };
        Ok(self.level_below(lamp, &smooth))
    }

    /// The histogram smoothed by `deviation` bins, and its peaks that may be lamps, the dimmest
    /// first.
    fn lamps(&self, deviation: f64) -> (Vec<f64>, Vec<Lamp>) {
        let lowest = self.first_bin_with_share_above(MAX_SHARE);
        let smooth = self.smoothed(deviation);
        let mut lamps = lamps(&smooth, self.median());
        lamps.retain(|lamp| lamp.valley > lowest);
        (smooth, lamps)
    }

    fn median(&self) -> usize {
        self.first_bin_with_share_above(0.5)
    }

    /// The level in the valley below a lamp.
    fn level_below(&self, &Lamp { peak, valley }: &Lamp, smooth: &[f64]) -> Level {
        let is_bottom = |&bin: &usize| smooth[bin] <= BOTTOM * smooth[valley];
        let from = (0..valley).rev().take_while(is_bottom).last();
        let to = (valley..peak).take_while(is_bottom).last();
        let (from, to) = (from.unwrap_or(valley), to.unwrap_or(valley) + 1);
        let half = peak.saturating_sub(BINS_PER_STOP);
        let level = half.clamp(from, to);
        let above: u64 = self.counts[level..].iter().sum();
        let total: u64 = self.counts.iter().sum();
        Level {
            level: radiance(level as f64),
            valley_from: radiance(from as f64),
            valley_to: radiance(to as f64),
            lamp: radiance(peak as f64 + 0.5),
            share: above as f64 / total as f64,
        }
    }

    /// The first bin above which lies less than `share` of all pixels.
    fn first_bin_with_share_above(&self, share: f64) -> usize {
        let total: u64 = self.counts.iter().sum();
        let mut above = total;
        let found = self.counts.iter().position(|&count| {
            above -= count;
            (above as f64) < share * total as f64
        });
        found.unwrap_or(NUM_BINS - 1)
    }

    /// Means under a Gaussian of `deviation` bins.
    fn smoothed(&self, deviation: f64) -> Vec<f64> {
        let reach = (4.0 * deviation) as isize;
        let weights: Vec<f64> = (-reach..=reach)
            .map(|offset| (-0.5 * (offset as f64 / deviation).powi(2)).exp())
            .collect();
        let sum: f64 = weights.iter().sum();
        let at = |bin: isize| {
            let inside = usize::try_from(bin).ok();
            inside
                .and_then(|bin| self.counts.get(bin))
                .map_or(0, |&c| c)
        };
        (0..NUM_BINS as isize)
            .map(|bin| {
                let around = (-reach..=reach).zip(&weights);
                let counted: f64 = around.map(|(o, w)| w * at(bin + o) as f64).sum();
                (FLOOR + counted) / sum
            })
            .collect()
    }
}

/// A peak of the histogram and the valley below it, bins.
struct Lamp {
    peak: usize,
    valley: usize,
}

/// Peaks well above the median that stand out from the valleys on both sides, the dimmest first.
fn lamps(smooth: &[f64], median: usize) -> Vec<Lamp> {
    let is_peak = |&bin: &usize| {
        let above = smooth.get(bin + 1).copied().unwrap_or(0.0);
        bin > 0 && smooth[bin] >= smooth[bin - 1] && smooth[bin] > above
    };
    let stands_out = |peak: usize| {
        let height = smooth[peak];
        // The valley of a peak lies between it and a higher peak; beyond the last bin there is
        // none.
        let below = (median..peak).rev();
        let below = below.take_while(|&bin| smooth[bin] <= height);
        let above = (peak + 1..smooth.len()).take_while(|&bin| smooth[bin] <= height);
        let lowest = |a: usize, b: usize| if smooth[b] < smooth[a] { b } else { a };
        let valley = below.reduce(lowest)?;
        let is_last = above.clone().last() == Some(smooth.len() - 1);
        let other = above.reduce(lowest).filter(|_| !is_last);
        let deep = |bin: usize| smooth[bin] * MIN_PROMINENCE <= height;
        (deep(valley) && other.is_none_or(deep)).then_some(Lamp { peak, valley })
    };
    (median + MIN_ABOVE_MEDIAN..smooth.len())
        .filter(is_peak)
        .filter_map(stands_out)
        .collect()
}

/// The bin of a linear radiance.
fn bin(radiance: f32) -> usize {
    let stops = f64::from(radiance).log2() - f64::from(LOWEST_STOP);
    // A black pixel is at minus infinity: the cast saturates into the first bin.
    let bin = (stops * BINS_PER_STOP as f64) as usize;
    bin.min(NUM_BINS - 1)
}

/// Linear radiance at a place among the bins.
fn radiance(bin: f64) -> f32 {
    (bin / BINS_PER_STOP as f64 + f64::from(LOWEST_STOP)).exp2() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Walls from 0.05 to 0.8, evenly over the stops, 1,600 pixels.
    fn walls() -> Histogram {
        let mut histogram = Histogram::default();
        histogram.add((0..1600).map(|i| 0.05 * 16.0_f32.powf(i as f32 / 1600.0)));
        histogram
    }

    #[test]
    fn the_level_lies_between_walls_and_lamps() {
        let mut histogram = walls();
        histogram.add([12.0; 60].into_iter());
        let found = histogram.level().unwrap();
        assert!(
            found.valley_from > 0.8 && found.valley_to < 12.0,
            "{found:?}"
        );
        // A bin is 4 % wide, and the peak may be anywhere in its own.
        assert!((found.level / 6.0 - 1.0).abs() < 0.05, "{found:?}");
        assert!((found.share - 60.0 / 1660.0).abs() < 1e-12);
        assert!((found.lamp / 12.0 - 1.0).abs() < 0.05);
    }

    #[test]
    fn the_dimmest_lamp_counts() {
        let mut histogram = walls();
        histogram.add([12.0; 60].into_iter());
        histogram.add([4.0; 40].into_iter());
        let found = histogram.level().unwrap();
        assert!((0.8..4.0).contains(&found.level), "{found:?}");
        assert!((found.lamp / 4.0 - 1.0).abs() < 0.05);
    }

    #[test]
    fn borders_and_glints_in_the_valley_do_not_hide_it() {
        let mut histogram = walls();
        histogram.add([12.0; 300].into_iter());
        histogram.add((0..80).map(|i| 0.8 * 15.0_f32.powf(i as f32 / 80.0)));
        let found = histogram.level().unwrap();
        assert!((0.8..12.0).contains(&found.level), "{found:?}");
    }

    #[test]
    fn without_lamps_there_is_no_level() {
        let problem = walls().level().unwrap_err();
        assert!(problem.contains("no gap"), "{problem}");
        assert!(Histogram::default().level().is_err());
        // A bright wall is not a lamp: it covers more than three tenths of the pixels.
        let mut bright = walls();
        bright.add([12.0; 1600].into_iter());
        assert!(bright.level().is_err());
    }

    #[test]
    fn black_and_blinding_pixels_are_counted() {
        let mut histogram = walls();
        histogram.add([0.0, 1e-30, 1e30].into_iter());
        assert_eq!(histogram.counts[0], 2);
        assert_eq!(histogram.counts[NUM_BINS - 1], 1);
    }
}
