// Last stage of the adjoint: the rows of each Gaussian are added in the order of its tiles, so that
// sums come out the same in every run without an atomic addition of floats.

#import declarations
#import workgroup
#import view
#import band

#ifdef contributions
#import contribution_row
#else
#import gradient_row
#endif

@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> entry_starts: array<u32>;
@group(0) @binding(4) var<storage, read> places: array<u32>;
@group(0) @binding(5) var<storage, read> masks: array<vec2u>;
@group(0) @binding(6) var<storage, read> rows: array<Row>;
@group(0) @binding(7) var<storage, read_write> gathered: array<Row>;

@compute @workgroup_size(GROUP_SIZE)
fn gather_rows(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let at = invocation_number(workgroup, workgroups, thread);
    if at >= view.num_surfels {
        return;
    }
    let end = min(entry_starts[at + 1u], arrayLength(&places));
    let index = order[at];
    var sum = gathered[index];
    var changed = false;
    for (var entry = entry_starts[at]; entry < end; entry++) {
        let place = places[entry];
        if place < band.first_place || place - band.first_place >= arrayLength(&rows) {
            continue;
        }
        if any(masks[place] != vec2u()) {
            sum = add_row(sum, rows[place - band.first_place]);
            changed = true;
        }
    }
    if changed {
        gathered[index] = sum;
    }
}
