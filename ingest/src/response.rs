//! The response of a camera whose pictures are meant for display: which light a code stands for.

use crate::raw::{RawFrame, Samples};
use eagpt_scene::words::counted;
use serde::Serialize;

pub(crate) mod recovery;
mod solve;

/// Codes of 8 bits.
pub(crate) const NUM_CODES: usize = 256;
/// Lowest and highest code that tells the light: below, cameras cut off what is black; above, JPEG
/// rings around what is clipped.
pub(crate) const USABLE: std::ops::RangeInclusive<u16> = 4..=250;

/// The response of a camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Response {
    /// Light of the codes 0 to 255 of R, G and B over that at which codes clip; 1 where they do.
    pub light: [Vec<f32>; 3],
    /// Stacks that it was recovered from.
    pub num_stacks: usize,
    /// Pixels of them, in a channel at least.
    pub num_pixels: usize,
    /// Root mean square of what the shots disagree, in stops.
    pub error_stops: f64,
}

impl Response {
    /// A frame of codes as one of light, where 1 is clipped: all channels of a pixel, or none.
    pub(crate) fn linearised(&self, mut frame: RawFrame) -> RawFrame {
        if let Samples::Integer(codes) = &frame.samples {
            let light = codes.chunks_exact(3).flat_map(|pixel| {
                let clipped = clips(pixel);
                [0, 1, 2].map(|channel| {
                    let code = usize::from(pixel[channel]).min(NUM_CODES - 1);
                    if clipped {
                        1.0
                    } else {
                        self.light[channel][code]
                    }
                })
            });
            frame.samples = Samples::Float(light.collect());
            frame.header.white = [1.0; 3];
        }
        frame
    }

    /// One line for the reader; `profile` names the primaries.
    pub(crate) fn note(&self, profile: &str) -> String {
        format!(
            "pictures for display: the camera's response is recovered from {} pixels of {}, which agree within {:.3} stops; primaries are {profile}, white balance is the camera's",
            self.num_pixels,
            counted(self.num_stacks, "stack"),
            self.error_stops
        )
    }
}

/// Whether a pixel has clipped: cameras mix channels after they clip, so that one spoils all.
fn clips(codes: &[u16]) -> bool {
    codes.iter().any(|code| code > USABLE.end())
}
