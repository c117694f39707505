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

// The last Gaussian whose entries begin at `entry` or before: those that have none begin where the
// next one does.
fn owner_of(entry: u32) -> u32 {
    var low = 0u;
    var high = view.num_surfels;
    while low + 1u < high {
        let middle = (low + high) / 2u;
        if starts[middle] <= entry {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// An invocation for each entry: the nearest Gaussians have thousands.
@compute @workgroup_size(GROUP_SIZE)
fn expand(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let entry = invocation_number(workgroup, workgroups, thread);
    let capacity = min(arrayLength(&keys), arrayLength(&entry_surfels));
    let num_entries = starts[view.num_surfels];
    if entry == 0u {
        counters[COUNTER_ENTRIES] = num_entries;
        if num_entries > capacity {
            counters[COUNTER_FAILED] = 1u;
        }
    }
    if entry >= min(num_entries, capacity) {
        return;
    }
    let at = owner_of(entry);
    let index = order[at];
    let rect = unpack_rect(rects[index]);
    let within = entry - starts[at];
    let num_columns = rect.columns.y - rect.columns.x + 1u;
    let row = rect.rows.x + within / num_columns;
    let column = rect.columns.x + within % num_columns;
    keys[entry] = row * view.tiles_x + column;
    values[entry] = entry;
    entry_surfels[entry] = index;
}
