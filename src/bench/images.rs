//! Stages of images and files: metrics, EXR, PNG, PLY, and the merging of brackets.

use super::inputs::Bench;
use super::scene;
use super::sheet::{Sheet, Unit};
use anyhow::{Context, Result};
use eagpt_eval::{FlipOptions, flip_hdr, flip_ldr, psnr_pq, psnr_srgb, srgb_clipped, ssim};
use eagpt_ingest::{IngestOptions, IngestRequest, ingest};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Image, Shard, files, ply};
use eagpt_synth::capture::Parts;
use eagpt_synth::{SynthOptions, simulate};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Bytes of a channel of a pixel in half precision.
const HALF_BYTES: f64 = 2.0;
/// Bytes of a Gaussian in a file.
const GAUSSIAN_BYTES: f64 = 17.0 * 4.0;

/// A wall in uneven light with a lamp of 16 in every 64 × 64 pixels, and the same with noise: seven
/// exposures of HDR-FLIP.
fn pair([width, height]: [u32; 2]) -> [Image<3>; 2] {
    let mut reference = Image::filled(width, height, [0.0; 3]);
    let mut test = reference.clone();
    let both = reference.pixels_mut().iter_mut().zip(test.pixels_mut());
    for (index, (reference, test)) in both.enumerate() {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let lamp = if x % 64 < 8 && y % 64 < 8 { 16.0 } else { 0.0 };
        for c in 0..3 {
            let wave = ((x * 7 + y * 3 + c * 11) % 256) as f32 / 1024.0;
            let noise = ((x * 37 + y * 91 + c * 53) % 17) as f32 / 256.0;
            reference[c as usize] = 0.02 + wave + lamp;
            test[c as usize] = 0.02 + wave + lamp + noise;
        }
    }
    [reference, test]
}

fn num_pixels(bench: &Bench<'_>) -> f64 {
    let [width, height] = bench.image;
    f64::from(width) * f64::from(height)
}

/// Metrics of a pair of images.
pub(super) fn metrics(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let [reference, test] = pair(bench.image);
    let srgb = [&reference, &test].map(srgb_clipped);
    let options = FlipOptions::default();
    let pixels = num_pixels(bench);
    sheet.measure("HDR-FLIP", Unit::Pixels, pixels, || {
        Ok(flip_hdr(&reference, &test, &options)?)
    })?;
    sheet.measure("LDR-FLIP", Unit::Pixels, pixels, || {
        Ok(flip_ldr(&srgb[0], &srgb[1], options.ppd)?)
    })?;
    sheet.measure("SSIM", Unit::Pixels, pixels, || {
        Ok(ssim(&srgb[0], &srgb[1]))
    })?;
    sheet.measure("PSNR, PQ", Unit::Pixels, pixels, || {
        Ok(psnr_pq(&reference, &test))
    })?;
    sheet.measure("PSNR, sRGB", Unit::Pixels, pixels, || {
        Ok(psnr_srgb(&reference, &test))
    })
}

/// An EXR image written and read: half precision, ZIP. The bytes are those of the samples.
pub(super) fn exr_files(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let [_, image] = pair(bench.image);
    let bytes = num_pixels(bench) * 3.0 * HALF_BYTES;
    let path = bench.work.join("image.exr");
    sheet.measure("write", Unit::Bytes, bytes, || {
        Ok(exr::write_rgb(&path, &image, Precision::Half)?)
    })?;
    sheet.measure("read", Unit::Bytes, bytes, || Ok(exr::read_rgb(&path)?))
}

/// A scene written and read.
pub(super) fn ply_files(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let bytes = bench.gaussians.len() as f64 * GAUSSIAN_BYTES;
    let path = bench.work.join("scene.ply");
    sheet.measure("write", Unit::Bytes, bytes, || {
        Ok(ply::write_gaussians(&path, bench.gaussians)?)
    })?;
    sheet.measure("read", Unit::Bytes, bytes, || {
        Ok(ply::read_gaussians(&path)?)
    })
}

/// A bracket of the embedded room, as large as the views of the dataset times the oversampling of
/// its sensor: from DNG files to EXR, preview and report. The pixels are those of all shots.
pub(super) fn merging(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let folder = bench.work.join("capture");
    let script = scene::room_script()?;
    let camera = &bench.views[0].camera;
    let options = SynthOptions {
        parts: Parts::Capture,
        size: Some([camera.width, camera.height].map(|side| side.clamp(8, 16_384))),
        num_views: Some(1),
        num_samples: 1,
        ..SynthOptions::default()
    };
    let made = simulate(&script, &folder, &options, &mut |_| ())?;
    let condition = script.conditions.first().map_or("", String::as_str);
    let capture = folder.join(condition);
    let out = bench.work.join("ingested");
    let oversampling = f64::from(script.rig.oversampling);
    let shots = made.num_shots as f64 / script.conditions.len().max(1) as f64;
    let pixels = shots * camera.num_pixels() as f64 * oversampling * oversampling;
    sheet.measure("a bracket, files to files", Unit::Pixels, pixels, || {
        files::remove_if_there(&out)?;
        merge(&capture, &out)
    })
}

fn merge(capture: &Path, out: &Path) -> Result<()> {
    let request = IngestRequest {
        capture: capture.to_owned(),
        out: out.to_owned(),
        options: IngestOptions::default(),
        start_over: true,
        shard: Shard::WHOLE,
        decoding: crate::decode::in_processes()?,
        stop: Arc::new(AtomicBool::new(false)),
    };
    ingest(&request, &mut |_| ()).context("ingest")?;
    Ok(())
}
