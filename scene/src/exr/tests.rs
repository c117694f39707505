mod channels;
mod refused;
mod samples;

use crate::image::Image;
use ::exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Layer, LayerAttributes};
use std::path::PathBuf;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// A 3x2 layer whose channel number k holds 10 k, 10 k + 1, … 10 k + 5.
fn layer(part: &str, names: &[&str]) -> Layer<AnyChannels<FlatSamples>> {
    let channels = names.iter().enumerate().map(|(k, name)| {
        let samples = (0..6).map(|i| (10 * k + i) as f32).collect();
        AnyChannel::new(*name, FlatSamples::F32(samples))
    });
    let attributes = if part.is_empty() {
        LayerAttributes::default()
    } else {
        LayerAttributes::named(part)
    };
    Layer::new(
        (3, 2),
        attributes,
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    )
}

fn gradient(width: u32, height: u32) -> Image<3> {
    let pixels = (0..width * height).map(|i| {
        let x = i as f32;
        [x * 0.37, 1.0 / (1.0 + x), (x * 0.01).sin().abs() * 900.0]
    });
    Image::from_pixels(width, height, pixels.collect()).unwrap()
}
