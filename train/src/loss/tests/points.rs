//! The depth term, of points about what is shown.

use super::*;
use crate::points::{Discs, NOTHING, PixelPoint, SeenPoints};
use std::sync::Arc;

/// Points before and behind what `frame` shows, and so far behind that it cannot be the same
/// surface.
pub(crate) fn points() -> SeenPoints {
    let shown = frame();
    let place = |i: u32| match i % 5 {
        0 => Some(0.95),
        2 => Some(1.06),
        3 => Some(1.2),
        _ => None,
    };
    let directions = directions(&camera());
    let mut discs = Discs {
        positions: Vec::new(),
        radii: Vec::new(),
        normals: Vec::new(),
    };
    let of_pixel = |pixel: u32| {
        let distance = place(pixel)? * shown.pixels[pixel as usize].mean_distance();
        discs.positions.push(directions[pixel as usize] * distance);
        discs.radii.push(0.1);
        // Those of every other one are known.
        let is_known = pixel.is_multiple_of(2);
        (discs.normals).push(if is_known { Vec3::NEG_Z } else { Vec3::ZERO });
        Some(discs.positions.len() as u32 - 1)
    };
    let of_pixels = (0..WIDTH * HEIGHT).map(of_pixel);
    SeenPoints {
        of_pixels: of_pixels.map(|point| point.unwrap_or(NOTHING)).collect(),
        discs: Arc::new(discs),
    }
}

#[test]
fn a_point_far_from_what_is_shown_moves_nothing() {
    let (view, seen) = (view(false), points().pixels(&camera()));
    let target = pq_image(&view.radiance);
    let weights = only("depth");
    let loss = |points: Option<&[PixelPoint]>| {
        radiance_loss(&frame(), &view, &target, points, &weights, NormalTerms::On)
    };
    let (terms, d) = loss(Some(&seen));
    let (mut num_nearer, mut num_farther) = (0, 0);
    for &PixelPoint { pixel, .. } in &seen {
        let slope = d[pixel as usize].0[lane::DISTANCE];
        match pixel % 5 {
            // The point lies before what is shown, which is to come nearer.
            0 => num_nearer += usize::from(slope > 0.0),
            2 => num_farther += usize::from(slope < 0.0),
            _ => assert_eq!(slope, 0.0),
        }
    }
    assert_eq!(num_nearer + num_farther, 73);
    // Of three points in a row 5 % / 0.95, 6 % / 1.06, and the most that an error may be.
    let wanted = (0.05 / 0.95 + 0.06 / 1.06 + f64::from(depth::MAX_DEPTH_ERROR)) / 3.0;
    assert!((terms.depth - wanted).abs() < 1e-3, "{}", terms.depth);
    assert_eq!(loss(None).0.depth, 0.0);
}
