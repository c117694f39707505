// Last stage of binning: lists of tiles from entries sorted by tile.

#import declarations
#import workgroup
#import view

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> sorted_tiles: array<u32>;
@group(0) @binding(3) var<storage, read> sorted_entries: array<u32>;
@group(0) @binding(4) var<storage, read> entry_surfels: array<u32>;
// Gaussian and tile of each place in the lists.
@group(0) @binding(5) var<storage, read_write> listed: array<vec2u>;
// Place in the lists of each entry before it was sorted.
@group(0) @binding(6) var<storage, read_write> places: array<u32>;
// First place of each tile, one more at the end. All zeros before.
@group(0) @binding(7) var<storage, read_write> list_starts: array<u32>;

@compute @workgroup_size(GROUP_SIZE)
fn list(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let place = invocation_number(workgroup, workgroups, thread);
    let num_entries = min(counters[COUNTER_ENTRIES], arrayLength(&listed));
    if place >= num_entries {
        return;
    }
    let tile = sorted_tiles[place];
    let entry = sorted_entries[place];
    listed[place] = vec2u(entry_surfels[entry], tile);
    places[entry] = place;
    // Tiles without a list begin where the next one does.
    var first = 0u;
    if place > 0u {
        first = sorted_tiles[place - 1u] + 1u;
    }
    for (var t = first; t <= tile; t++) {
        list_starts[t] = place;
    }
    if place + 1u == num_entries {
        for (var t = tile + 1u; t <= view.tiles_x * view.tiles_y; t++) {
            list_starts[t] = num_entries;
        }
    }
}
