#![no_main]

use eagpt_convert::SourceFormat;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| eagpt_fuzz::source(SourceFormat::Fipt, data));
