//! Merging a bracket where the sensor measured it, before any colour is interpolated.
//!
//! A shot of exposure t sees the radiance E as x = t·E with the variance of [`Noise`]. The most
//! likely E, given the unclipped samples, is Σ w x / Σ w t with w = t / variance(t·E); since the
//! weights need E, they are found with Σ x / Σ t, the answer for pure photon noise (Hasinoff,
//! Durand and Freeman, "Noise-optimal capture for high dynamic range photography", CVPR 2010).
//! Samples below black count as they are: to cut them off would make the dark too bright.

use crate::noise::Noise;
use crate::stack::Shot;
use rayon::prelude::*;

/// Set in [`Merged::flags`] where a sample is clipped in all shots: the value is the least that it
/// can be.
pub(crate) const CLIPPED: u8 = 1;
/// Set in [`Merged::flags`] where a sample does not stand out from the read noise in any shot.
pub(crate) const DARK: u8 = 2;

/// Standard deviations of read noise below which a sample of the longest shot counts as dark.
const DARK_SIGMAS: f32 = 2.0;

/// A merged bracket, sample by sample as the sensor has them.
#[derive(Debug, Clone)]
pub(crate) struct Merged {
    /// Radiance in fractions of the range per exposure, `[height, row_len]`.
    pub radiance: Vec<f32>,
    /// [`CLIPPED`] and [`DARK`] for each sample.
    pub flags: Vec<u8>,
}

/// Numbers of clipped and dark samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct MergeCounts {
    /// Clipped in all shots.
    pub clipped: u64,
    /// Dark in all shots.
    pub dark: u64,
}

impl Merged {
    /// Counts the flags.
    pub(crate) fn counts(&self) -> MergeCounts {
        let count = |flag| self.flags.iter().filter(|flags| *flags & flag != 0).count() as u64;
        MergeCounts {
            clipped: count(CLIPPED),
            dark: count(DARK),
        }
    }
}

/// Merges shots of one size and layout, sorted by exposure. A sample counts where it is below
/// `clip`, a fraction of the range.
pub(crate) fn merge(shots: &[Shot<'_>], noise: &Noise, clip: f32) -> Merged {
    let Some(first) = shots.first() else {
        return Merged {
            radiance: Vec::new(),
            flags: Vec::new(),
        };
    };
    let header = &first.frame.header;
    let (row_len, rows) = (header.row_len(), header.height as usize);
    let mut radiance = vec![0.0_f32; row_len * rows];
    let mut flags = vec![0_u8; row_len * rows];
    let exposures: Vec<f32> = shots.iter().map(|shot| shot.exposure as f32).collect();
    let scratch = || vec![0.0_f32; row_len * shots.len()];
    radiance
        .par_chunks_mut(row_len)
        .zip(flags.par_chunks_mut(row_len))
        .enumerate()
        .with_min_len(8)
        .for_each_init(scratch, |scaled, (row, (radiance, flags))| {
            for (shot, scaled) in shots.iter().zip(scaled.chunks_mut(row_len)) {
                shot.frame.scaled_row(row, scaled);
            }
            merge_row(scaled, &exposures, noise, clip, (radiance, flags));
        });
    Merged { radiance, flags }
}

/// Merges a row: `scaled` is `[shots, row_len]`.
fn merge_row(
    scaled: &[f32],
    exposures: &[f32],
    noise: &Noise,
    clip: f32,
    (radiance, flags): (&mut [f32], &mut [u8]),
) {
    let row_len = radiance.len();
    let longest = exposures.iter().copied().fold(0.0, f32::max);
    let shortest = exposures.first().copied().unwrap_or(1.0);
    let dark = DARK_SIGMAS * noise.read.sqrt() / longest;
    let (mut sum, mut exposure) = (vec![0.0_f32; row_len], vec![0.0_f32; row_len]);
    for (x, &t) in scaled.chunks(row_len).zip(exposures) {
        for i in 0..row_len {
            let taken = if x[i] < clip { 1.0 } else { 0.0 };
            sum[i] += taken * x[i];
            exposure[i] += taken * t;
        }
    }
    // `sum` becomes the first estimate, then both are used again for the second.
    for i in 0..row_len {
        sum[i] = (sum[i] / exposure[i].max(f32::MIN_POSITIVE)).max(0.0);
    }
    let (mut weighted, mut weights) = (vec![0.0_f32; row_len], vec![0.0_f32; row_len]);
    for (x, &t) in scaled.chunks(row_len).zip(exposures) {
        for i in 0..row_len {
            let weight = t / (noise.gain * t * sum[i] + noise.read);
            let weight = if x[i] < clip { weight } else { 0.0 };
            weighted[i] += weight * x[i];
            weights[i] += weight * t;
        }
    }
    for i in 0..row_len {
        if exposure[i] == 0.0 {
            radiance[i] = scaled[i].max(clip) / shortest;
            flags[i] = CLIPPED;
        } else {
            let value = weighted[i] / weights[i];
            radiance[i] = value;
            flags[i] = if value < dark { DARK } else { 0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::NoiseSource;
    use crate::raw::{Black, CameraColor, Header, Layout, Metadata, RawFrame, Samples};

    /// A row of samples with a black level of 100 and white at 1100.
    fn frame(samples: &[u16]) -> RawFrame {
        RawFrame {
            header: Header {
                width: samples.len() as u32,
                height: 1,
                layout: Layout::Mosaic {
                    columns: 2,
                    rows: 2,
                    channels: vec![0, 1, 1, 2],
                },
                black: Black {
                    columns: 1,
                    rows: 1,
                    levels: vec![100.0],
                },
                white: [1100.0; 3],
                color: CameraColor::default(),
                display: None,
                metadata: Metadata::default(),
            },
            samples: Samples::Integer(samples.to_vec()),
        }
    }

    fn merged(short: &[u16], long: &[u16], noise: &Noise) -> Merged {
        let frames = [frame(short), frame(long)];
        let shots = [0, 1].map(|index| Shot {
            frame: &frames[index],
            exposure: [1.0, 4.0][index],
        });
        merge(&shots, noise, 0.95)
    }

    const PHOTONS: Noise = Noise {
        gain: 1e-3,
        read: 1e-30,
        source: NoiseSource::Assumed,
    };

    #[test]
    fn photon_noise_alone_means_sums_over_sums() {
        // 0.1 + 0.42 over 1 + 4; the second clips in the long shot, the third in both.
        let merged = merged(&[200, 400, 1100], &[520, 1060, 1100], &PHOTONS);
        assert!((merged.radiance[0] - 0.104).abs() < 1e-6, "{merged:?}");
        assert!((merged.radiance[1] - 0.3).abs() < 1e-6, "{merged:?}");
        assert_eq!(merged.radiance[2], 1.0);
        assert_eq!(merged.flags, [0, 0, CLIPPED]);
        let counts = merged.counts();
        assert_eq!((counts.clipped, counts.dark), (1, 0));
    }

    #[test]
    fn read_noise_alone_means_least_squares_and_keeps_what_is_below_black() {
        let read = Noise {
            gain: 1e-12,
            read: 1e-4,
            source: NoiseSource::Assumed,
        };
        // (0.1·1 + 0.44·4) / (1 + 16); then −0.01 and −0.005, dark.
        let merged = merged(&[200, 90], &[540, 95], &read);
        assert!(
            (merged.radiance[0] - 1.86 / 17.0).abs() < 1e-6,
            "{merged:?}"
        );
        assert!(
            (merged.radiance[1] + 0.03 / 17.0).abs() < 1e-6,
            "{merged:?}"
        );
        assert_eq!(merged.flags, [0, DARK]);
    }
}
