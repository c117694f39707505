// Last stage of the adjoint: the rows of each Gaussian are added in a fixed order, so that sums
// come out the same in every run without an atomic addition of floats.
//
// Most Gaussians are on a few tiles, some on thousands: a thread adds the rows of a Gaussian of its
// own, the workgroup together those of a large one.

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

// Most rows that a thread adds alone.
const OWN_ROWS = 16u;

// Threads of this workgroup whose Gaussian is large, in any order.
var<workgroup> large: array<u32, GROUP_SIZE>;
var<workgroup> num_large: atomic<u32>;
var<workgroup> num_large_found: u32;
var<workgroup> partial: array<Row, GROUP_SIZE>;

// The sum of `before` and the rows of every `step`th of the entries `first` to `end`.
fn add_entries(before: Row, first: u32, end: u32, step: u32) -> Row {
    var sum = before;
    for (var entry = first; entry < end; entry += step) {
        let place = places[entry];
        if place < band.first_place || place - band.first_place >= arrayLength(&rows) {
            continue;
        }
        if any(masks[place] != vec2u()) {
            sum = add_row(sum, rows[place - band.first_place]);
        }
    }
    return sum;
}

// Gaussian of a thread. Those that follow one another in distance go to different workgroups: the
// nearest have the most rows.
fn at_of(group: u32, num_groups: u32, thread: u32) -> u32 {
    return thread * num_groups + group;
}

fn end_of(at: u32) -> u32 {
    return min(entry_starts[at + 1u], arrayLength(&places));
}

@compute @workgroup_size(GROUP_SIZE)
fn gather_rows(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let group = group_number(workgroup, workgroups);
    let num_groups = (view.num_surfels + GROUP_SIZE - 1u) / GROUP_SIZE;
    if thread == 0u {
        atomicStore(&num_large, 0u);
    }
    workgroupBarrier();
    let at = at_of(group, num_groups, thread);
    if group < num_groups && at < view.num_surfels {
        let first = entry_starts[at];
        let end = end_of(at);
        if first + OWN_ROWS < end {
            large[atomicAdd(&num_large, 1u)] = thread;
        } else if first < end {
            let index = order[at];
            gathered[index] = add_entries(gathered[index], first, end, 1u);
        }
    }
    workgroupBarrier();
    if thread == 0u {
        num_large_found = atomicLoad(&num_large);
    }
    let num = workgroupUniformLoad(&num_large_found);
    for (var i = 0u; i < num; i++) {
        let at = at_of(group, num_groups, large[i]);
        let index = order[at];
        let first = entry_starts[at] + thread;
        partial[thread] = add_entries(empty_row(index), first, end_of(at), GROUP_SIZE);
        for (var half = GROUP_SIZE / 2u; half > 0u; half /= 2u) {
            workgroupBarrier();
            if thread < half {
                partial[thread] = add_row(partial[thread], partial[thread + half]);
            }
        }
        if thread == 0u {
            gathered[index] = add_row(gathered[index], partial[0]);
        }
        workgroupBarrier();
    }
}
