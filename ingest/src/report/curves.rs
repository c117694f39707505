//! The response of a camera as a plot: light in stops against codes.

use crate::response::{Response, USABLE};
use serde::Serialize;

/// Stops below the light that clips down to which the plot reaches.
const STOPS: f64 = 12.0;
/// Colours of the channels, on light and dark ground.
const COLORS: [&str; 3] = ["#c0392b", "#2e8b57", "#3d6fb4"];

/// A plot of three curves.
#[derive(Debug, Serialize)]
pub(super) struct Plot {
    pub(super) width: f64,
    pub(super) height: f64,
    stops: f64,
    curves: Vec<Curve>,
    num_pixels: usize,
    num_stacks: usize,
    error_stops: String,
    first: u16,
    last: u16,
}

#[derive(Debug, Serialize)]
struct Curve {
    color: &'static str,
    /// Points of a polyline.
    points: String,
}

impl Plot {
    pub(super) fn new(response: &Response) -> Self {
        const WIDTH: f64 = 512.0;
        const HEIGHT: f64 = 240.0;
        let curve = |(light, color): (&Vec<f32>, &'static str)| {
            let usable = usize::from(*USABLE.start())..=usize::from(*USABLE.end());
            let points = usable.map(|code| {
                let stops = f64::from(light[code]).log2().max(-STOPS);
                let (x, y) = (code as f64 / 255.0 * WIDTH, -stops / STOPS * HEIGHT);
                format!("{x:.1},{y:.1}")
            });
            Curve {
                color,
                points: points.collect::<Vec<_>>().join(" "),
            }
        };
        Self {
            width: WIDTH,
            height: HEIGHT,
            stops: STOPS,
            curves: response.light.iter().zip(COLORS).map(curve).collect(),
            num_pixels: response.num_pixels,
            num_stacks: response.num_stacks,
            error_stops: format!("{:.3}", response.error_stops),
            first: *USABLE.start(),
            last: *USABLE.end(),
        }
    }
}
