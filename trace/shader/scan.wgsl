// Exclusive prefix sums of 32-bit counts in place, one block or a few for each workgroup; sums of
// workgroups go to the next level.

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
    let group = group_number(workgroup, workgroups);
    // Of the blocks before.
    var before = 0u;
    for (var block = 0u; block < scan.num_of_group; block += SCAN_BLOCK) {
        let first = group * scan.num_of_group + block + thread * SCAN_PER_THREAD;
        let end = min(first + SCAN_PER_THREAD, scan.num_values);
        var sum = 0u;
        for (var i = first; i < end; i++) {
            sum = saturating_add(sum, values[i]);
        }
        var total = saturating_add(before, sum_before(thread, sum));
        for (var i = first; i < end; i++) {
            let value = values[i];
            values[i] = total;
            total = saturating_add(total, value);
        }
        before = saturating_add(before, thread_sums[SCAN_THREADS - 1u]);
        workgroupBarrier();
    }
    if thread == 0u && group * scan.num_of_group < scan.num_values {
        block_sums[group] = before;
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
