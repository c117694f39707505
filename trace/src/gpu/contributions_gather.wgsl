// The rows of each Gaussian together, in the order of its tiles.

@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> entry_starts: array<u32>;
@group(0) @binding(4) var<storage, read> places: array<u32>;
@group(0) @binding(5) var<storage, read> masks: array<vec2u>;
@group(0) @binding(6) var<storage, read> rows: array<Contribution>;
@group(0) @binding(7) var<storage, read_write> contributions: array<Contribution>;

@compute @workgroup_size(64)
fn gather_contributions(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let at = group_number(workgroup, workgroups) * 64u + thread;
    if at >= view.num_surfels {
        return;
    }
    let end = min(entry_starts[at + 1u], arrayLength(&places));
    let index = order[at];
    var sum = contributions[index];
    sum.gaussian = index;
    for (var entry = entry_starts[at]; entry < end; entry++) {
        let place = places[entry];
        if place < band.first_place || place - band.first_place >= arrayLength(&rows) {
            continue;
        }
        if any(masks[place] != vec2u()) {
            let row = rows[place - band.first_place];
            sum.weight += row.weight;
            sum.weighted_value += row.weighted_value;
            let is_first = row.largest_weight == sum.largest_weight && row.pixel < sum.pixel;
            if row.largest_weight > sum.largest_weight || is_first {
                sum.largest_weight = row.largest_weight;
                sum.pixel = row.pixel;
            }
        }
    }
    contributions[index] = sum;
}
