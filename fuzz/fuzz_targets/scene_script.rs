#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| eagpt_fuzz::scene_script(data));
