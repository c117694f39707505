//! How much of each cell of the hull surfaces see past all others.

use super::hull::Hull;
use crate::alike::{Compared, Row};
use eagpt_scene::Camera;
use eagpt_scene::rng::RandomKey;
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::sampling::cosine_direction;
use eagpt_trace::{Ray, TraceError, Tracer};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Directions from each receiver.
const NUM_DIRECTIONS: u32 = 64;
/// Opacity along a ray from which on it has met something.
const MET: f32 = 0.9;
/// Mean share of their cosine-weighted directions in which receivers see a cell, at least, for
/// anything to be known of it.
const LEAST_SEEN: f64 = 3e-4;
/// Pixels of all views that look past a cell, at most, for it to be unseen.
const MAX_PASSED: usize = 8;
/// Rays that are traced together.
const RAYS_AT_ONCE: usize = 1 << 18;

/// For each receiver, the numbers of cells that it sees past all surfaces, with the shares of
/// its cosine-weighted directions, ascending; `[receivers]`. Shares are means over neighbours:
/// with the noise of single receivers, light would seem to depend less on them. What `cameras`
/// look past is left out: photographs show it.
///
/// # Errors
/// If the device fails.
pub(super) fn seen_by(
    hull: &Hull,
    tracer: &dyn Tracer,
    compared: &Compared,
    cameras: &[Camera],
    key: RandomKey,
) -> Result<Vec<Row>, TraceError> {
    let mut rows = traced(hull, tracer, &compared.receivers, key)?;
    leave_out_unknown(&mut rows, hull.num_cells());
    if rows.iter().all(Vec::is_empty) {
        return Ok(rows);
    }
    let passed = passed_by(hull, tracer, cameras)?;
    for row in &mut rows {
        row.retain(|(cell, _)| passed[*cell] <= MAX_PASSED);
    }
    let around = |i: usize| {
        let near = compared
            .smoothing
            .neighbours(i)
            .iter()
            .map(|(j, _)| *j as usize);
        mean(&rows, near.chain([i]))
    };
    Ok((0..rows.len()).into_par_iter().map(around).collect())
}

/// Number of pixels of `cameras` that show what is beyond each cell or nothing, `[cells]`.
///
/// # Errors
/// If the device fails.
fn passed_by(
    hull: &Hull,
    tracer: &dyn Tracer,
    cameras: &[Camera],
) -> Result<Vec<usize>, TraceError> {
    let mut passed = vec![0; hull.num_cells()];
    for camera in cameras {
        let frame = camera.ray_frame();
        for (pixel, met) in (0..).zip(&tracer.gbuffer(camera)?.pixels) {
            let (x, y) = (pixel % camera.width, pixel / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let place = frame.origin + direction * met.mean_distance();
            if met.alpha() < MET || !hull.holds(place) {
                passed[hull.number(hull.left_at(frame.origin, direction))] += 1;
            }
        }
    }
    Ok(passed)
}

/// Those of single receivers.
fn traced(
    hull: &Hull,
    tracer: &dyn Tracer,
    receivers: &[Receiver],
    key: RandomKey,
) -> Result<Vec<Row>, TraceError> {
    let mut rows = Vec::with_capacity(receivers.len());
    for some in receivers.chunks(RAYS_AT_ONCE / NUM_DIRECTIONS as usize) {
        let rays: Vec<Ray> = (some.iter())
            .flat_map(|(i, surface)| {
                let points = Points::new(key, *i);
                (0..NUM_DIRECTIONS).map(move |sample| {
                    let [a, b, ..] = points.block(sample, 0);
                    surface.ray(cosine_direction(surface.normal, a, b))
                })
            })
            .collect();
        let met = tracer.trace_rays(&rays)?;
        let num = NUM_DIRECTIONS as usize;
        for (rays, met) in rays.chunks(num).zip(met.chunks(num)) {
            let mut row = BTreeMap::new();
            for (ray, met) in rays.iter().zip(met).filter(|(_, met)| met.alpha() < MET) {
                let [origin, direction] = [ray.origin, ray.direction].map(Vec3::from_array);
                let number = hull.number(hull.left_at(origin, direction));
                *row.entry(number).or_insert(0.0) += f64::from(1.0 - met.alpha()) / num as f64;
            }
            rows.push(row.into_iter().collect());
        }
    }
    Ok(rows)
}

/// Takes cells out of all rows of which too little is seen.
fn leave_out_unknown(rows: &mut [Row], num_cells: usize) {
    let mut sums = vec![0.0; num_cells];
    for (cell, share) in rows.iter().flatten() {
        sums[*cell] += share;
    }
    let least = LEAST_SEEN * rows.len() as f64;
    for row in rows {
        row.retain(|(cell, _)| sums[*cell] >= least);
    }
}

/// The mean of some rows, at least one.
fn mean(rows: &[Row], of: impl Iterator<Item = usize> + Clone) -> Row {
    let num = of.clone().count() as f64;
    let mut sums = BTreeMap::new();
    for (cell, share) in of.flat_map(|i| &rows[i]) {
        *sums.entry(*cell).or_insert(0.0) += share / num;
    }
    sums.into_iter().collect()
}
