// Second stage of binning: an entry for each Gaussian and tile, Gaussians nearest first, and after
// sorting by tile the lists.

#import declarations
#import workgroup
#import view
#import tile_rect

@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> rects: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> starts: array<u32>;

// Number of entries of each Gaussian in the order of distances; one more at the end, which becomes
// their total.
@compute @workgroup_size(GROUP_SIZE)
fn count_entries(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let at = invocation_number(workgroup, workgroups, thread);
    if at < view.num_surfels {
        starts[at] = num_tiles_of(rects[order[at]]);
    } else if at == view.num_surfels {
        starts[at] = 0u;
    }
}

@group(0) @binding(4) var<storage, read_write> counters: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> values: array<u32>;
@group(0) @binding(7) var<storage, read_write> entry_surfels: array<u32>;

@compute @workgroup_size(GROUP_SIZE)
fn expand(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let at = invocation_number(workgroup, workgroups, thread);
    let capacity = min(arrayLength(&keys), arrayLength(&entry_surfels));
    if at == view.num_surfels {
        counters[COUNTER_ENTRIES] = starts[at];
        if starts[at] > capacity {
            counters[COUNTER_FAILED] = 1u;
        }
    }
    if at >= view.num_surfels {
        return;
    }
    let index = order[at];
    let packed = rects[index];
    if num_tiles_of(packed) == 0u {
        return;
    }
    let rect = unpack_rect(packed);
    var entry = starts[at];
    for (var row = rect.rows.x; row <= rect.rows.y; row++) {
        for (var column = rect.columns.x; column <= rect.columns.y; column++) {
            if entry < capacity {
                keys[entry] = row * view.tiles_x + column;
                values[entry] = entry;
                entry_surfels[entry] = index;
            }
            entry++;
        }
    }
}
