//! AgX by Troy Sobotka (github.com/sobotka/AgX), base look, from its parameters rather than its
//! table: an inset of the primaries, log2, a sigmoid with a straight part, and back.

use glam::{Mat3, Vec3};
use std::sync::LazyLock;

/// Stops about middle grey that the sigmoid covers, plus those of middle grey itself: log2(0.18).
const LOG2_GREY: f32 = -2.473_931_2;
const FIRST_STOP: f32 = LOG2_GREY - 10.0;
const LAST_STOP: f32 = LOG2_GREY + 6.5;
/// Middle grey on the scale of stops, and its displayed value, display-encoded.
const PIVOT: [f32; 2] = [10.0 / 16.5, 0.5];
const SLOPE: f32 = 2.0;
const TOE_POWER: f32 = 3.0;
const SHOULDER_POWER: f32 = 3.25;
/// The encoding of the display that the curve was made for.
const GAMMA: f32 = 2.2;

/// Rec.709 primaries rotated and moved towards white; rows sum to 1, so grey stays grey.
static INSET: LazyLock<Mat3> = LazyLock::new(|| {
    Mat3::from_cols_array_2d(&[
        [0.842_401_1, 0.042_401_07, 0.042_401_07],
        [0.078_436_5, 0.878_436_5, 0.078_436_5],
        [0.079_162_43, 0.079_162_43, 0.879_162_4],
    ])
});
static OUTSET: LazyLock<Mat3> = LazyLock::new(|| INSET.inverse());

pub(super) fn shown(light: [f32; 3]) -> [f32; 3] {
    let inset = *INSET * Vec3::from(light);
    let encoded = Vec3::from(inset.to_array().map(|v| {
        let stops = v.log2().clamp(FIRST_STOP, LAST_STOP);
        sigmoid((stops - FIRST_STOP) / (LAST_STOP - FIRST_STOP))
    }));
    let outset = (*OUTSET * encoded).clamp(Vec3::ZERO, Vec3::ONE);
    outset.to_array().map(|v| v.powf(GAMMA))
}

/// 0 to 1 onto 0 to 1: straight about the pivot, with a toe and a shoulder that bend as x / (1 +
/// xᵖ)^(1/p) does.
fn sigmoid(x: f32) -> f32 {
    let [px, py] = PIVOT;
    let (width, height, power) = if x < px {
        (px, py, TOE_POWER)
    } else {
        (1.0 - px, 1.0 - py, SHOULDER_POWER)
    };
    // The overshoot of the straight line at the end gives the curvature.
    let bend = (SLOPE * width / height).powf(power) - 1.0;
    let along = (x - px).abs() / width;
    let rise = SLOPE * (x - px) / (1.0 + bend * along.powf(power)).powf(1.0 / power);
    py + rise
}
