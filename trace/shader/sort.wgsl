// One pass of a stable radix sort. Neither subgroups nor the order of atomics matter: a thread owns
// a run of consecutive elements and a column of counters, which are added up thread by thread.

#import declarations
#import workgroup

@group(0) @binding(0) var<uniform> sort: SortParameters;
// The number of elements is one of these.
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<u32>;
// Elements of each digit in each block, digits one after the other; then, added up, where they go.
@group(0) @binding(4) var<storage, read_write> places: array<u32>;
@group(0) @binding(5) var<storage, read_write> sorted_keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> sorted_values: array<u32>;

// Elements of each digit among those of each thread: pairs of digits one after the other, the first
// of a pair in the lower half of its words.
var<workgroup> counters: array<u32, SORT_COUNTERS>;

fn num_elements() -> u32 {
    return min(counts[sort.count], sort.capacity);
}

fn digit_of(key: u32) -> u32 {
    return (key >> sort.shift) % SORT_DIGITS;
}

fn counter_of(digit: u32, thread: u32) -> u32 {
    return digit / 2u * SORT_ROW + thread;
}

// Shift to the half of a digit.
fn half_of(digit: u32) -> u32 {
    return 16u * (digit % 2u);
}

fn count_digits(thread: u32, first: u32, end: u32) {
    for (var digit = 0u; digit < SORT_DIGITS; digit += 2u) {
        counters[counter_of(digit, thread)] = 0u;
    }
    for (var i = first; i < end; i++) {
        let digit = digit_of(keys[i]);
        counters[counter_of(digit, thread)] += 1u << half_of(digit);
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
            count += (counters[counter_of(thread, i)] >> half_of(thread)) & 0xffffu;
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
    // Elements of each digit before those of each thread, two digits at a time.
    if thread < SORT_DIGITS / 2u {
        var sum = 0u;
        for (var i = 0u; i < SORT_THREADS; i++) {
            let at = counter_of(2u * thread, i);
            let count = counters[at];
            counters[at] = sum;
            sum += count;
        }
    }
    workgroupBarrier();
    for (var i = first; i < end; i++) {
        let key = keys[i];
        let digit = digit_of(key);
        let at = counter_of(digit, thread);
        let rank = (counters[at] >> half_of(digit)) & 0xffffu;
        counters[at] += 1u << half_of(digit);
        let place = places[digit * sort.num_blocks + block] + rank;
        sorted_keys[place] = key;
        sorted_values[place] = values[i];
    }
}
