// One pass of a stable radix sort by four bits. Neither subgroups nor the order of atomics matter:
// a thread owns a run of consecutive elements and a column of counters, and counters are added up
// digit by digit, thread by thread.

#import declarations
#import workgroup
#import prefix_sum

@group(0) @binding(0) var<uniform> sort: SortParameters;
// The number of elements is one of these.
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<u32>;
// Elements of each digit in each block, digits one after the other; then, added up, where they go.
@group(0) @binding(4) var<storage, read_write> places: array<u32>;
@group(0) @binding(5) var<storage, read_write> sorted_keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> sorted_values: array<u32>;

var<workgroup> counters: array<u32, SORT_COUNTERS>;

fn num_elements() -> u32 {
    return min(counts[sort.count], sort.capacity);
}

fn digit_of(key: u32) -> u32 {
    return (key >> sort.shift) % SORT_DIGITS;
}

fn count_digits(thread: u32, first: u32, end: u32) {
    for (var digit = 0u; digit < SORT_DIGITS; digit++) {
        counters[digit * SORT_THREADS + thread] = 0u;
    }
    for (var i = first; i < end; i++) {
        counters[digit_of(keys[i]) * SORT_THREADS + thread] += 1u;
    }
}

@compute @workgroup_size(SORT_THREADS)
fn sort_count(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let block = group_number(workgroup, workgroups);
    let first = block * SORT_BLOCK + thread * SORT_PER_THREAD;
    count_digits(thread, first, min(first + SORT_PER_THREAD, num_elements()));
    workgroupBarrier();
    if thread < SORT_DIGITS && block < sort.num_blocks {
        var count = 0u;
        for (var i = 0u; i < SORT_THREADS; i++) {
            count += counters[thread * SORT_THREADS + i];
        }
        places[thread * sort.num_blocks + block] = count;
    }
}

@compute @workgroup_size(SORT_THREADS)
fn sort_scatter(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let block = group_number(workgroup, workgroups);
    let first = block * SORT_BLOCK + thread * SORT_PER_THREAD;
    let end = min(first + SORT_PER_THREAD, num_elements());
    count_digits(thread, first, end);
    workgroupBarrier();
    // Exclusive sums over all counters, in the order of digits, then threads: each thread adds a
    // run of as many as there are digits.
    var sum = 0u;
    for (var i = 0u; i < SORT_DIGITS; i++) {
        sum += counters[thread * SORT_DIGITS + i];
    }
    var total = sum_before(thread, sum);
    for (var i = 0u; i < SORT_DIGITS; i++) {
        let at = thread * SORT_DIGITS + i;
        let count = counters[at];
        counters[at] = total;
        total += count;
    }
    workgroupBarrier();
    // Where the digits of this block begin among its own.
    if thread < SORT_DIGITS {
        thread_sums[thread] = counters[thread * SORT_THREADS];
    }
    workgroupBarrier();
    for (var i = first; i < end; i++) {
        let key = keys[i];
        let digit = digit_of(key);
        let rank = counters[digit * SORT_THREADS + thread];
        counters[digit * SORT_THREADS + thread] = rank + 1u;
        let place = places[digit * sort.num_blocks + block] + rank - thread_sums[digit];
        sorted_keys[place] = key;
        sorted_values[place] = values[i];
    }
}
