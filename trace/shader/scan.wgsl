// Exclusive prefix sums of 32-bit counts in place, a block for each workgroup; sums of blocks go to
// the next level.

#import declarations
#import workgroup
#import prefix_sum

@group(0) @binding(0) var<uniform> scan: ScanParameters;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> block_sums: array<u32>;

@compute @workgroup_size(SCAN_THREADS)
fn scan_blocks(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let block = group_number(workgroup, workgroups);
    let first = block * SCAN_BLOCK + thread * SCAN_PER_THREAD;
    var sum = 0u;
    for (var i = first; i < min(first + SCAN_PER_THREAD, scan.num_values); i++) {
        sum = saturating_add(sum, values[i]);
    }
    var total = sum_before(thread, sum);
    for (var i = first; i < min(first + SCAN_PER_THREAD, scan.num_values); i++) {
        let value = values[i];
        values[i] = total;
        total = saturating_add(total, value);
    }
    if thread == SCAN_THREADS - 1u && block * SCAN_BLOCK < scan.num_values {
        block_sums[block] = total;
    }
}

@compute @workgroup_size(SCAN_THREADS)
fn scan_add(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let block = group_number(workgroup, workgroups);
    let first = block * SCAN_BLOCK + thread * SCAN_PER_THREAD;
    if first >= scan.num_values {
        return;
    }
    let before = block_sums[block];
    for (var i = first; i < min(first + SCAN_PER_THREAD, scan.num_values); i++) {
        values[i] = saturating_add(values[i], before);
    }
}
