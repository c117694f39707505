//! The reader that the environment variable `READER` names.

#![no_main]

use libfuzzer_sys::fuzz_target;
use std::sync::OnceLock;

static READER: OnceLock<eagpt_fuzz::Reader> = OnceLock::new();

fuzz_target!(
    init: {
        let name = std::env::var("READER").unwrap_or_default();
        READER.get_or_init(|| eagpt_fuzz::reader(&name));
    },
    |data: &[u8]| READER.get().expect("set above")(data)
);
