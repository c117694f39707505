// Exclusive prefix sums of 32-bit counts in place, a block for each workgroup; sums of blocks go to the next level.

@group(0) @binding(0) var<uniform> scan: ScanParameters;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> block_sums: array<u32>;

var<workgroup> thread_sums: array<u32, SCAN_THREADS>;

// Replaces the sums of threads by the sums of all threads up to and including them (Hillis and Steele).
fn add_up_threads(thread: u32) {
    for (var step = 1u; step < SCAN_THREADS; step <<= 1u) {
        workgroupBarrier();
        let before = select(0u, thread_sums[max(thread, step) - step], thread >= step);
        workgroupBarrier();
        thread_sums[thread] += before;
    }
    workgroupBarrier();
}

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
        sum += values[i];
    }
    thread_sums[thread] = sum;
    add_up_threads(thread);
    var total = thread_sums[thread] - sum;
    for (var i = first; i < min(first + SCAN_PER_THREAD, scan.num_values); i++) {
        let value = values[i];
        values[i] = total;
        total += value;
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
        values[i] += before;
    }
}
