//! Writes a small synthetic room as a dataset to train on: `cargo run --release --example room --
//! out/room`.
//!
//! The room is path-traced from closed-form shapes: linear radiance, emission masks, normals,
//! depths, albedos, and a noisy point cloud. It needs no download and takes half a minute on two
//! cores.

use clap::Parser;
use eagpt_testkit::room::{self, RoomOptions};
use indicatif::ProgressBar;
use std::path::PathBuf;

/// Write a synthetic room as a dataset
#[derive(Parser)]
struct Args {
    /// Folder to write; files in it are replaced
    out: PathBuf,
    /// Number of views; every eighth is for testing
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u16).range(2..))]
    views: u16,
    /// Width of the images, pixels; they are three quarters as high
    #[arg(long, default_value_t = 160, value_parser = clap::value_parser!(u32).range(8..=4096))]
    width: u32,
    /// Light samples per pixel
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
}

fn main() -> eagpt_scene::Result<()> {
    let args = Args::parse();
    let options = RoomOptions {
        num_views: args.views.into(),
        width: args.width,
        height: args.width * 3 / 4,
        num_samples: args.spp,
        ..RoomOptions::default()
    };
    let bar = ProgressBar::new(args.views.into());
    room::write(&args.out, &options, |done| bar.set_position(done as u64))?;
    bar.finish();
    Ok(())
}
