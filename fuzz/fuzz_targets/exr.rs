#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(init: eagpt_fuzz::allow_caught_panics(), |data: &[u8]| eagpt_fuzz::exr(data));
