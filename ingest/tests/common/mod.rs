//! A virtual camera that takes brackets of a computed scene with known radiance.

#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use eagpt_ingest::{
    Decoding, IngestOptions, IngestProgress, IngestRequest, IngestSummary, Problem, ingest,
};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Image, Shard};
use eagpt_synth::dng::{self, DngInfo, Mosaic, RGGB};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub(crate) const WIDTH: u32 = 240;
pub(crate) const HEIGHT: u32 = 160;
/// A bracket two stops apart.
pub(crate) const EXPOSURES: [f64; 5] = [0.0025, 0.01, 0.04, 0.16, 0.64];
pub(crate) const BLACK: f32 = 512.0;
pub(crate) const WHITE: f32 = 16_383.0;
/// Coefficients of the virtual lens.
pub(crate) const VIGNETTING: [f32; 3] = [-0.22, 0.05, -0.01];
/// Electrons of a full well, and of read noise.
const FULL_WELL: f32 = 40_000.0;
const READ_NOISE: f32 = 4.0;
/// Exposure at which a camera value of 1 saturates.
const SATURATION_S: f64 = 0.4;

/// Camera from XYZ under D65, and what a neutral surface under D65 looks like to it, green 1.
pub(crate) const CAMERA_FROM_XYZ: [[f64; 3]; 3] = [
    [0.7374, -0.2389, -0.0551],
    [-0.5435, 1.3162, 0.2519],
    [-0.1006, 0.1795, 0.6552],
];
const XYZ_FROM_REC709: [[f64; 3]; 3] = [
    [0.412_456_4, 0.357_576_1, 0.180_437_5],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9, 0.119_192_0, 0.950_304_1],
];

fn times(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

pub(crate) fn neutral() -> [f64; 3] {
    let [r, g, b] = times(&CAMERA_FROM_XYZ, times(&XYZ_FROM_REC709, [1.0; 3]));
    [r / g, 1.0, b / g]
}

/// Subject of the virtual camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Subject {
    /// Soft coloured waves, and a lamp a thousand times as bright with a hard edge.
    Room {
        /// Turns the waves: another position of the camera.
        phase: f32,
    },
    /// An evenly lit white wall.
    Wall,
}

impl Subject {
    /// Linear Rec.709 of a pixel.
    pub(crate) fn light(self, x: u32, y: u32) -> [f32; 3] {
        let Self::Room { phase } = self else {
            return [0.3; 3];
        };
        let (u, v) = (x as f32 / 40.0 + phase, y as f32 / 30.0);
        // The lens blurs its edge over two pixels.
        let edge = ((x as f32 - 60.0).hypot(y as f32 - 50.0) - 14.5) / 2.0 + 0.5;
        let lamp = 1.0 - edge.clamp(0.0, 1.0);
        let wave = 0.5 + 0.4 * u.sin() * v.cos();
        let tint = 0.5 + 0.4 * (u * 0.7 + 1.0).cos();
        let wall = [
            0.05 + 0.3 * wave,
            0.1 + 0.25 * wave * tint,
            0.06 + 0.2 * tint,
        ];
        let shade = [14.0, 13.0, 11.0];
        [0, 1, 2].map(|c| wall[c] + lamp * (shade[c] - wall[c]))
    }

    pub(crate) fn truth(self) -> Image<3> {
        let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| self.light(x, y)));
        Image::from_pixels(WIDTH, HEIGHT, pixels.collect()).unwrap()
    }
}

/// A shot to take.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shot {
    pub(crate) subject: Subject,
    /// True exposure time.
    pub(crate) exposure_s: f64,
    /// Exposure time stated by the file.
    pub(crate) stated_s: Option<f64>,
    pub(crate) taken_ms: u64,
    pub(crate) model: &'static str,
    pub(crate) focal_mm: f64,
    pub(crate) f_number: f64,
    pub(crate) seed: u64,
}

impl Shot {
    pub(crate) fn new(subject: Subject, exposure_s: f64) -> Self {
        Self {
            subject,
            exposure_s,
            stated_s: Some(exposure_s),
            taken_ms: 1_700_000_000_000,
            model: "Test Rig",
            focal_mm: 16.0,
            f_number: 8.0,
            seed: (1e6 * exposure_s) as u64,
        }
    }

    /// Takes the shot.
    pub(crate) fn write(&self, path: &Path) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let key = RandomKey::new(self.seed, Purpose::Render, 0);
        let neutral = neutral();
        let samples = (0..WIDTH * HEIGHT).map(|index| {
            let (x, y) = (index % WIDTH, index / WIDTH);
            let rgb = self.subject.light(x, y).map(f64::from);
            let camera = times(&CAMERA_FROM_XYZ, times(&XYZ_FROM_REC709, rgb));
            let channel = [[0, 1], [1, 2]][(y % 2) as usize][(x % 2) as usize];
            // Scaled so that green of white is 1 at an exposure of SATURATION_S.
            let green = times(&CAMERA_FROM_XYZ, times(&XYZ_FROM_REC709, [1.0; 3]))[1];
            let signal = camera[channel] / green * self.exposure_s / SATURATION_S;
            let signal = signal as f32 * falloff(x, y);
            let [a, b, ..] = key.stream(index, 0).next_uniforms();
            // Box and Muller.
            let normal = (-2.0 * (1.0 - a).ln()).sqrt() * (std::f32::consts::TAU * b).cos();
            let electrons = signal * FULL_WELL;
            let noisy = electrons + normal * (electrons.max(0.0) + READ_NOISE * READ_NOISE).sqrt();
            (BLACK + noisy / FULL_WELL * (WHITE - BLACK))
                .round()
                .clamp(0.0, WHITE) as u16
        });
        let mosaic = Mosaic {
            width: WIDTH,
            height: HEIGHT,
            samples: samples.collect(),
        };
        let info = DngInfo {
            make: "Virtual".to_owned(),
            model: self.model.to_owned(),
            cfa: RGGB,
            black: [BLACK as u16; 4],
            white: WHITE as u16,
            as_shot_neutral: neutral,
            camera_from_xyz: CAMERA_FROM_XYZ,
            exposure_s: self.stated_s,
            iso: 100,
            f_number: self.f_number,
            focal_length_mm: self.focal_mm,
            taken_ms: self.taken_ms,
        };
        dng::write(path, &mosaic, &info).unwrap();
    }
}

fn falloff(x: u32, y: u32) -> f32 {
    let (cx, cy) = (WIDTH as f32 / 2.0, HEIGHT as f32 / 2.0);
    let (dx, dy) = (x as f32 + 0.5 - cx, y as f32 + 0.5 - cy);
    let r2 = (dx * dx + dy * dy) / (cx * cx + cy * cy);
    let [a, b, c] = VIGNETTING;
    1.0 + r2 * (a + r2 * (b + r2 * c))
}

pub(crate) fn room(position: usize) -> Subject {
    Subject::Room {
        phase: position as f32,
    }
}

/// Folders of a test.
pub(crate) struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    pub(crate) fn new() -> Self {
        Self {
            dir: tempfile::tempdir().unwrap(),
        }
    }

    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.dir.path().join(relative)
    }

    /// Takes brackets `folder/p<position>_<index>.dng`, one every 20 s.
    pub(crate) fn capture(&self, folder: &str, positions: usize) {
        for position in 0..positions {
            for index in 0..EXPOSURES.len() {
                self.shot(position, index)
                    .write(&self.file(folder, position, index));
            }
        }
    }

    pub(crate) fn shot(&self, position: usize, index: usize) -> Shot {
        let shot = Shot::new(room(position), EXPOSURES[index]);
        Shot {
            taken_ms: shot.taken_ms + 20_000 * position as u64 + 1000 * index as u64,
            seed: shot.seed + 1_000_000_000 * position as u64,
            ..shot
        }
    }

    pub(crate) fn file(&self, folder: &str, position: usize, index: usize) -> PathBuf {
        self.path(folder).join(format!("p{position}_{index}.dng"))
    }

    pub(crate) fn request(
        &self,
        capture: &str,
        out: &str,
        options: IngestOptions,
    ) -> IngestRequest {
        IngestRequest {
            capture: self.path(capture),
            out: self.path(out),
            options,
            start_over: false,
            shard: Shard::WHOLE,
            decoding: Decoding::InProcess,
            stop: Arc::new(AtomicBool::new(false)),
        }
    }

    /// Ingests; returns the result and the reported problems.
    pub(crate) fn ingest(
        &self,
        capture: &str,
        out: &str,
        options: IngestOptions,
    ) -> (eagpt_ingest::Result<IngestSummary>, Vec<Problem>) {
        let mut problems = Vec::new();
        let outcome = ingest(&self.request(capture, out, options), &mut |message| {
            if let IngestProgress::Problem(problem) = message {
                problems.push(problem);
            }
        });
        let outcome = outcome.map(|summary| summary.expect("not a part of several"));
        (outcome, problems)
    }

    /// Ingests and expects success.
    #[track_caller]
    pub(crate) fn ingests(
        &self,
        capture: &str,
        out: &str,
        options: IngestOptions,
    ) -> IngestSummary {
        let (outcome, problems) = self.ingest(capture, out, options);
        outcome.unwrap_or_else(|error| panic!("{error}: {problems:?}"))
    }
}

/// Options with the lens of the camera, and images that are not rounded.
pub(crate) fn options() -> IngestOptions {
    IngestOptions {
        vignetting: eagpt_ingest::Vignetting::Polynomial(VIGNETTING),
        precision: eagpt_scene::exr::Precision::Float,
        ..IngestOptions::default()
    }
}

/// Agreement of an image with the truth after one factor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Agreement {
    /// The factor.
    pub(crate) scale: f32,
    /// Median of each channel over the truth, after the factor.
    pub(crate) channels: [f32; 3],
    /// Median relative error.
    pub(crate) median_error: f32,
    /// PSNR in PQ, dB.
    pub(crate) psnr_pq_db: f64,
}

pub(crate) fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Compares where `usable` says so.
pub(crate) fn agreement(
    image: &Image<3>,
    truth: &Image<3>,
    usable: impl Fn(usize) -> bool,
) -> Agreement {
    assert_eq!(image.size(), truth.size());
    let pairs: Vec<([f32; 3], [f32; 3])> = image
        .pixels()
        .iter()
        .zip(truth.pixels())
        .enumerate()
        .filter(|(index, _)| usable(*index))
        .map(|(_, (a, b))| (*a, *b))
        .collect();
    let quotients = |channel: usize| -> Vec<f32> {
        // Relative errors of what is almost black say nothing.
        let bright = pairs.iter().filter(|(_, t)| t[channel] > 0.02);
        bright.map(|(v, t)| v[channel] / t[channel]).collect()
    };
    let scale = median((0..3).flat_map(quotients).collect());
    let pq = eagpt_scene::color::pq_from_linear;
    let (mut square, mut errors) = (0.0_f64, Vec::new());
    for (value, truth) in &pairs {
        for channel in 0..3 {
            let (v, t) = (value[channel] / scale, truth[channel]);
            square += f64::from(pq(v) - pq(t)).powi(2);
            errors.push((v - t).abs() / t.max(1e-4));
        }
    }
    Agreement {
        scale,
        channels: [0, 1, 2].map(|channel| median(quotients(channel)) / scale),
        median_error: median(errors),
        psnr_pq_db: -10.0 * (square / (3 * pairs.len()) as f64).log10(),
    }
}
