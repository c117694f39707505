// First stage of binning: what each Gaussian covers, and how near it may be.

#import declarations
#import workgroup
#import surfel
#import view
#import tile_rect

@group(0) @binding(1) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(2) var<storage, read_write> seen_surfels: array<Seen>;
@group(0) @binding(3) var<storage, read_write> rects: array<vec2u>;
@group(0) @binding(4) var<storage, read_write> keys: array<u32>;
@group(0) @binding(5) var<storage, read_write> values: array<u32>;

@compute @workgroup_size(GROUP_SIZE)
fn project(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = invocation_number(workgroup, workgroups, thread);
    if index >= view.num_surfels {
        return;
    }
    let surfel = surfels[index];
    var seen = seen_from(surfel, view.origin);
    var rect = EMPTY_RECT;
    // Gaussians outside of the view come last.
    var key = FARTHEST_KEY;
    if surfel.cut2 >= 0.0 {
        let radius = sqrt(surfel.cut2);
        let a = extent(surfel.axis_u, radius);
        let b = extent(surfel.axis_v, radius);
        rect = tile_rect(surfel, a, b);
        if num_tiles_of(rect) > 0u {
            let reach = max(length(a), length(b));
            // A few roundings' worth lower, so that it is a bound for computed distances, too; then
            // truncated to the width of a key.
            let nearest = max((distance(surfel.position, view.origin) - reach) * (1.0 - 1e-5), 0.0);
            key = bitcast<u32>(nearest) >> KEY_SHIFT;
            seen.nearest = bitcast<f32>(key << KEY_SHIFT);
        }
    }
    seen_surfels[index] = seen;
    rects[index] = rect;
    keys[index] = key;
    values[index] = index;
}
