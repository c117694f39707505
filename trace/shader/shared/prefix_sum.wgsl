// Prefix sums over the threads of a workgroup.

#import declarations

// Sums that do not fit into 32 bits stay at the largest number, so that too much is never taken
// for little.
fn saturating_add(a: u32, b: u32) -> u32 {
    let sum = a + b;
    return select(sum, 0xffffffffu, sum < a);
}

var<workgroup> thread_sums: array<u32, MAX_GROUP_SIZE>;

// The sum of `value` over all threads before this one (Hillis and Steele). `thread_sums` then has
// the sums up to and including each thread. Smaller workgroups take a turn more than they need.
fn sum_before(thread: u32, value: u32) -> u32 {
    thread_sums[thread] = value;
    for (var step = 1u; step < MAX_GROUP_SIZE; step <<= 1u) {
        workgroupBarrier();
        let before = select(0u, thread_sums[max(thread, step) - step], thread >= step);
        workgroupBarrier();
        thread_sums[thread] = saturating_add(thread_sums[thread], before);
    }
    workgroupBarrier();
    return thread_sums[thread] - value;
}
