// First stage of the adjoint: each pixel goes through its blended hits back to front. With Cᵢ, the
// value of everything from hit i on, dL/dαᵢ = Tᵢ₋₁ (cᵢ − Cᵢ₊₁); see blend.rs. What a hit has become
// goes to where its Gaussian and tile will look for it.

#import declarations
#import workgroup
#import features
#import surfel
#import blend
#import view
#import band
#import ray_grid

@group(0) @binding(2) var<storage, read> record: array<u32>;
@group(0) @binding(3) var<storage, read> listed: array<vec2u>;
@group(0) @binding(4) var<storage, read> seen_surfels: array<Seen>;
@group(0) @binding(5) var<storage, read> attributes: array<Lanes>;
@group(0) @binding(6) var<storage, read> d_features: array<Lanes>;
@group(0) @binding(7) var<storage, read> masks: array<vec2u>;
// First of the hits of each place in the lists.
@group(0) @binding(8) var<storage, read> hit_starts: array<u32>;
// Weight and dL/dα of each hit. A negative weight says that the ray passes through the middle of a
// pixel that is not split; see ray_grid.wgsl.
@group(0) @binding(9) var<storage, read_write> hits: array<vec2f>;

// Number of the tile's pixels before `thread` that blended a Gaussian.
fn rank_of(mask: vec2u, thread: u32) -> u32 {
    let below = (1u << (thread & 31u)) - 1u;
    if thread < 32u {
        return countOneBits(mask.x & below);
    }
    return countOneBits(mask.x) + countOneBits(mask.y & below);
}

@compute @workgroup_size(TILE_PIXELS)
fn weigh_hits(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = band.first_tile + group_number(workgroup, workgroups);
    let column = (tile % view.tiles_x) * TILE + thread % TILE;
    let row = (tile / view.tiles_x) * TILE + thread / TILE;
    if tile >= band.end_tile || column >= view.width || row >= view.height {
        return;
    }
    let offset = ray_offset(tile, thread);
    let direction = pixel_direction(f32(column) + offset, f32(row) + offset);
    let pixel = row * view.width + column - band.first_pixel;
    let d = d_features[pixel];
    let sign = select(1.0, -1.0, offset > 0.5);
    var chunk = record[PIXEL_WORDS * pixel];
    var behind = 0.0;
    for (var left = record[PIXEL_WORDS * pixel + 1u]; left > 0u; left--) {
        let within = (left - 1u) % CHUNK_HITS;
        let at = chunk + 1u + 3u * within;
        let place = record[at];
        let alpha = bitcast<f32>(record[at + 1u]);
        let before = bitcast<f32>(record[at + 2u]);
        let index = listed[place].x;
        let t = meet(seen_surfels[index], direction).t;
        let values = hit_values(attributes[index], direction, t);
        // Spread, size and first distance are not differentiated.
        let value = dot(d.a, values.a) + dot(d.b, values.b) + dot(d.c, values.c);
        let d_alpha = before * (value - behind);
        behind = alpha * value + (1.0 - alpha) * behind;
        hits[hit_starts[place] + rank_of(masks[place], thread)] = vec2f(sign * before * alpha, d_alpha);
        if within == 0u {
            chunk = record[chunk];
        }
    }
}
