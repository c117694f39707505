//! A process that decodes photographs for another one, until its standard input ends.

use super::message::{self, MAGIC};
use super::{EXIT_TIME, MEMORY_BYTES, time_limit_s};
use crate::allocator;
use crate::error::IngestError;
use crate::raw;
use std::io::{ErrorKind, Read, Result, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Ticks of the watch in a second.
const TICKS_PER_S: u64 = 10;

/// Ticks that are left to the request under way; 0: there is none.
static TICKS_LEFT: AtomicU64 = AtomicU64::new(0);

/// Decodes photographs for [`crate::Decoding::by_program`] until standard input ends.
///
/// Ends the process if a file takes too long, and has it end if [`crate::LimitedAllocator`] is its
/// allocator and a file takes too much memory. Panics are not printed.
///
/// # Errors
/// If standard input or output fail.
pub fn serve_decoding() -> Result<()> {
    // Those of other threads, which the decoders start, would be printed as well.
    std::panic::set_hook(Box::new(|_| {}));
    allocator::limit(MEMORY_BYTES);
    std::thread::Builder::new().spawn(|| {
        // Ticks rather than a clock: they stop when the process is stopped.
        loop {
            std::thread::sleep(Duration::from_millis(1000 / TICKS_PER_S));
            let left = |ticks: u64| ticks.checked_sub(1);
            let before = TICKS_LEFT.fetch_update(Ordering::Relaxed, Ordering::Relaxed, left);
            if before == Ok(1) {
                std::process::exit(EXIT_TIME);
            }
        }
    })?;
    let (mut input, mut output) = (std::io::stdin().lock(), std::io::stdout().lock());
    serve(&mut input, &mut output)
}

fn serve(input: &mut dyn Read, output: &mut dyn Write) -> Result<()> {
    output.write_all(MAGIC)?;
    output.flush()?;
    loop {
        let (request, bytes) = match message::request(input) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(()),
            other => other?,
        };
        let ticks = TICKS_PER_S * time_limit_s(bytes.len() as u64);
        TICKS_LEFT.store(ticks, Ordering::Relaxed);
        // The one that asks knows the name of the file.
        let path = Path::new("photograph").with_extension(&request.extension);
        let decoded = raw::decode(&path, &Arc::new(bytes), request.want);
        TICKS_LEFT.store(0, Ordering::Relaxed);
        let decoded = decoded.map_err(|error| match error {
            IngestError::Photograph { field, problem, .. } => (field.into_owned(), problem),
            other => ("content".to_owned(), other.to_string()),
        });
        message::answer(output, decoded)?;
    }
}

#[cfg(test)]
mod tests {
    use super::super::message::{Request, answered, ask};
    use super::*;
    use crate::raw::{Samples, Want};

    #[test]
    fn files_are_decoded_one_after_the_other() {
        let mut png = Vec::new();
        let pixels: Vec<u8> = (0..36).collect();
        let encoder = image::codecs::png::PngEncoder::new(&mut png);
        image::ImageEncoder::write_image(encoder, &pixels, 3, 2, image::ExtendedColorType::Rgb16)
            .unwrap();
        let mut requests = Vec::new();
        for (bytes, want) in [
            (&png[..], Want::Header),
            (&png[..40], Want::Samples),
            (&png[..], Want::Samples),
        ] {
            let request = Request {
                extension: "png".to_owned(),
                want,
                num_bytes: bytes.len() as u64,
            };
            ask(&mut requests, &request, bytes).unwrap();
        }
        let mut answers = Vec::new();
        serve(&mut &requests[..], &mut answers).unwrap();
        let mut answers = answers.strip_prefix(MAGIC).unwrap();
        let header = answered(&mut answers, Want::Header)
            .unwrap()
            .unwrap()
            .header;
        assert_eq!((header.width, header.height), (3, 2));
        let (field, _) = answered(&mut answers, Want::Samples).unwrap().unwrap_err();
        assert_eq!(field, "PNG");
        let frame = answered(&mut answers, Want::Samples).unwrap().unwrap();
        assert_eq!(frame.header, header);
        let expected: Vec<u16> = (0..36).step_by(2).map(|b| b << 8 | (b + 1)).collect();
        let native: Vec<u16> = pixels
            .chunks_exact(2)
            .map(|pair| u16::from_ne_bytes([pair[0], pair[1]]))
            .collect();
        assert!(frame.samples == Samples::Integer(native), "{expected:?}");
        assert!(answers.is_empty());
    }

    #[test]
    fn what_is_no_answer_is_an_error() {
        for bytes in [
            &b"eagpt"[..],
            b"something else",
            b"eagptraw\xff\xff\xff\xff",
        ] {
            answered(&mut &bytes[..], Want::Header).unwrap_err();
        }
    }
}
