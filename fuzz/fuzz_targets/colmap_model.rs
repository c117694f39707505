//! The parts of a text model after one another: whether they fit each other.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| eagpt_fuzz::colmap_model(data));
