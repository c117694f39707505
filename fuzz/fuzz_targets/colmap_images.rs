#![no_main]

use eagpt_colmap::model::Part;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| eagpt_fuzz::colmap_part(Part::Images, data));
