//! The program as its users meet it: arguments in, files and exit codes out.
//!
//! All tests share one binary, since linking takes longer than most of them.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test ends with its first surprise; helpers outside of test functions do as well"
)]

mod bake;
mod bench;
mod camera_path;
mod colmap;
mod dataset;
mod demo;
mod denoise;
mod determinism;
mod device;
mod docs;
mod edit;
mod errors;
mod import;
mod ingest;
mod lamps;
mod light_basis;
mod machine;
mod masks;
mod mirrors;
mod misuse;
mod own_light;
mod paper;
mod pipeline;
mod relight;
mod run;
#[cfg(unix)]
mod server;
mod several_lights;
mod shards;
mod support;
mod synth;
mod view;
mod view_edit;
mod view_training;
mod workflow;
