//! All passes of a frame, from the Gaussians of a scene to the features of every pixel of a camera
//! and back to gradients, in the order in which the device runs them.
//!
//! The CPU bins into tiles of 16×16 pixels that it keeps in caches, sorts all hits of a pixel, and
//! sums the adjoint in moments of each tile's Gaussians. Here tiles are 8×8, a list of a tile is
//! nearest first by two stable sorts, and the adjoint adds a row for each Gaussian and tile. The
//! blended hits are the same, sums are rounded in another order.

use super::bins::BinBuffers;
use super::declarations::camera::{Band, TILES_PER_DISPATCH};
use super::device::{Device, Pass};
use super::error::GpuError;
use super::kernels::{self, groups};
use super::record::RecordBuffers;
use super::scan::scan;
use super::scene_buffers::SceneBuffers;
use std::ops::Range;

/// Bins the Gaussians of `scene`: lists of those that each tile may see, nearest first.
pub(super) fn bin(
    device: &Device,
    scene: &SceneBuffers,
    bins: &BinBuffers,
) -> Result<Vec<Pass>, GpuError> {
    let BinBuffers {
        view,
        seen,
        rects,
        counters,
        entry_starts,
        entry_surfels,
        places,
        listed,
        list_starts,
        by_distance,
        by_tile,
        ..
    } = bins;
    let num_gaussians = scene.num_surfels();
    let each_gaussian = groups(num_gaussians);
    let each_gaussian_and_end = groups(num_gaussians + 1);
    let each_entry = groups(bins.capacity);
    let mut passes = Vec::new();

    // Which tiles a Gaussian may cover, and from which distance on it can be hit.
    let (distances, indices) = by_distance.unsorted();
    passes.push(device.pass(
        &kernels::PROJECT,
        &[view, &scene.surfels, seen, rects, distances, indices],
        each_gaussian,
    ));
    // Radiance towards the camera.
    if let Some(harmonics) = &scene.harmonics {
        passes.push(device.pass(
            &kernels::EVALUATE_HARMONICS,
            &[
                view,
                &scene.surfels,
                &scene.attributes,
                harmonics,
                &bins.attributes,
            ],
            each_gaussian,
        ));
    }
    passes.extend_from_slice(by_distance.passes());
    // An entry for each Gaussian and tile.
    let order = bins.order();
    passes.push(device.pass(
        &kernels::COUNT_ENTRIES,
        &[view, order, rects, entry_starts],
        each_gaussian_and_end,
    ));
    passes.extend(scan(device, entry_starts, num_gaussians + 1)?);
    let (tiles, entries) = by_tile.unsorted();
    passes.push(device.pass(
        &kernels::EXPAND,
        &[
            view,
            order,
            rects,
            entry_starts,
            counters,
            tiles,
            entries,
            entry_surfels,
        ],
        each_entry,
    ));
    passes.extend_from_slice(by_tile.passes());
    // The list of each tile.
    let (tiles, entries) = by_tile.sorted();
    passes.push(device.pass(
        &kernels::LIST,
        &[
            view,
            counters,
            tiles,
            entries,
            entry_surfels,
            listed,
            places,
            list_starts,
        ],
        each_entry,
    ));
    Ok(passes)
}

/// Composited features of the pixels of `band`.
pub(super) fn trace(
    device: &Device,
    bins: &BinBuffers,
    features: &wgpu::Buffer,
    band: Band,
) -> Vec<Pass> {
    let trace = |band: &wgpu::Buffer, split: &wgpu::Buffer, num_tiles| {
        let buffers = [
            &bins.view,
            band,
            &bins.list_starts,
            &bins.listed,
            &bins.seen,
            &bins.attributes,
            features,
            split,
        ];
        device.pass(&kernels::TRACE_TILES, &buffers, num_tiles)
    };
    each_tile(device, bins, band, trace)
}

/// The passes of a band whose hits are recorded.
#[derive(Debug)]
pub(super) struct RecordedBand {
    pub(super) pixels: Range<usize>,
    /// Features, with a record of the blended hits.
    pub(super) forward: Vec<Pass>,
    /// From the record and the derivatives by the features to gradients.
    pub(super) gradients: Vec<Pass>,
    /// From the record and the values of pixels to contributions.
    pub(super) contributions: Vec<Pass>,
}

/// The same with a record of the blended hits, and the way back from there.
pub(super) fn trace_and_go_back(
    device: &Device,
    scene: &SceneBuffers,
    bins: &BinBuffers,
    features: &wgpu::Buffer,
    record: &RecordBuffers,
    (pixels, band): (Range<usize>, Band),
) -> Result<RecordedBand, GpuError> {
    let BinBuffers {
        view,
        seen,
        listed,
        attributes,
        counters,
        places,
        ..
    } = bins;
    let RecordBuffers {
        chunks,
        masks,
        hit_starts,
        hits,
        rows,
        d_features,
        values,
        ..
    } = record;
    let each_entry = groups(bins.capacity);

    // Forward: every pixel keeps its blended hits, and every list the pixels that blended them.
    let trace = |band: &wgpu::Buffer, split: &wgpu::Buffer, num_tiles| {
        let lists = [view, band, &bins.list_starts, listed, seen, attributes];
        let buffers = [&lists[..], &[features, chunks, masks, counters, split]].concat();
        device.pass(&kernels::TRACE_AND_RECORD_TILES, &buffers, num_tiles)
    };
    let mut forward = each_tile(device, bins, band, trace);
    // Where the hits of a Gaussian in a tile begin.
    forward.push(device.pass(&kernels::COUNT_HITS, &[masks, hit_starts], each_entry));
    forward.extend(scan(device, hit_starts, bins.capacity)?);

    // Back: weight and dL/dα of each hit, its pixel's hits back to front.
    let weigh = |band: &wgpu::Buffer, split: &wgpu::Buffer, num_tiles| {
        let hits = [masks, hit_starts, hits, split];
        let buffers = [
            &[view, band, chunks, listed, seen, attributes, d_features],
            &hits[..],
        ]
        .concat();
        device.pass(&kernels::WEIGH_HITS, &buffers, num_tiles)
    };
    let mut gradients = each_tile(device, bins, band, weigh);
    let mut contributions = gradients.clone();
    // A row for each Gaussian and tile, then the sum of the rows of a Gaussian; as many rows at a
    // time as a buffer holds.
    for first_place in (0..bins.capacity).step_by(record.num_rows.max(1) as usize) {
        let band = &device.uniform(
            "band",
            &Band {
                first_place,
                ..band
            },
        );
        let each_row = groups(record.num_rows);
        let each_gaussian = groups(scene.num_surfels());
        let hits_of_tiles = [view, band, listed, masks, hit_starts, hits, rows];
        let rows_of_gaussians = [
            view,
            band,
            bins.order(),
            &bins.entry_starts,
            places,
            masks,
            rows,
        ];

        let buffers = [&hits_of_tiles[..], &[seen, d_features]].concat();
        gradients.push(device.pass(&kernels::ADD_GRADIENT_ROWS, &buffers, each_row));
        let buffers = [&rows_of_gaussians[..], &[&record.gradients]].concat();
        gradients.push(device.pass(&kernels::GATHER_GRADIENT_ROWS, &buffers, each_gaussian));

        let buffers = [&hits_of_tiles[..], &[values]].concat();
        contributions.push(device.pass(&kernels::ADD_CONTRIBUTION_ROWS, &buffers, each_row));
        let buffers = [&rows_of_gaussians[..], &[&record.contributions]].concat();
        contributions.push(device.pass(
            &kernels::GATHER_CONTRIBUTION_ROWS,
            &buffers,
            each_gaussian,
        ));
    }
    Ok(RecordedBand {
        pixels,
        forward,
        gradients,
        contributions,
    })
}

/// The passes that `pass` makes for all tiles of `band`, of parts of it, their split pixels and the
/// number of their tiles. A part is of one dispatch of all tiles of `bins`.
fn each_tile(
    device: &Device,
    bins: &BinBuffers,
    band: Band,
    pass: impl Fn(&wgpu::Buffer, &wgpu::Buffer, u32) -> Pass,
) -> Vec<Pass> {
    let dispatches = (0..).step_by(TILES_PER_DISPATCH as usize).zip(&bins.split);
    dispatches
        .filter_map(|(start, split)| {
            let first_tile = band.first_tile.max(start);
            let end_tile = band.end_tile.min(start + TILES_PER_DISPATCH);
            let part = Band {
                first_tile,
                end_tile,
                ..band
            };
            (first_tile < end_tile)
                .then(|| pass(&device.uniform("band", &part), split, end_tile - first_tile))
        })
        .collect()
}
