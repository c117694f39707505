// Sums over all pixels in a fixed order: each thread adds a run of pixels, each workgroup those
// of its threads, and one workgroup all.

#import training
#import workgroup
#import loss

@group(0) @binding(8) var<storage, read_write> group_sums: array<Terms>;
@group(0) @binding(9) var<storage, read_write> report: array<u32>;

var<workgroup> image_sums: array<vec4f, ADD_THREADS>;
var<workgroup> surface_sums: array<vec4f, ADD_THREADS>;
var<workgroup> depth_sums: array<f32, ADD_THREADS>;

// Of pixels.
fn num_groups() -> u32 {
    let size = ADD_THREADS * ADD_PER_THREAD;
    return (loss.num_pixels + size - 1u) / size;
}

fn plus(a: Terms, b: Terms) -> Terms {
    return Terms(a.image + b.image, a.surface + b.surface, a.depth + b.depth);
}

fn add_up_threads(thread: u32, sum: Terms) {
    image_sums[thread] = sum.image;
    surface_sums[thread] = sum.surface;
    depth_sums[thread] = sum.depth;
    for (var step = ADD_THREADS / 2u; step > 0u; step /= 2u) {
        workgroupBarrier();
        if thread < step {
            image_sums[thread] += image_sums[thread + step];
            surface_sums[thread] += surface_sums[thread + step];
            depth_sums[thread] += depth_sums[thread + step];
        }
    }
    workgroupBarrier();
}

@compute @workgroup_size(ADD_THREADS)
fn add_pixels(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let group = group_number(workgroup, workgroups);
    let start = (group * ADD_THREADS + thread) * ADD_PER_THREAD;
    var sum = Terms();
    for (var pixel = start; pixel < min(start + ADD_PER_THREAD, loss.num_pixels); pixel++) {
        sum = plus(sum, terms[pixel]);
    }
    add_up_threads(thread, sum);
    if thread == 0u && group < num_groups() {
        group_sums[group] = Terms(image_sums[0], surface_sums[0], depth_sums[0]);
    }
}

@compute @workgroup_size(ADD_THREADS)
fn add_groups(@builtin(local_invocation_index) thread: u32) {
    var sum = Terms();
    for (var group = thread; group < num_groups(); group += ADD_THREADS) {
        sum = plus(sum, group_sums[group]);
    }
    add_up_threads(thread, sum);
    if thread == 0u {
        report[REPORT_TERMS + 8u] = bitcast<u32>(depth_sums[0]);
    }
    if thread < 4u {
        report[REPORT_TERMS + thread] = bitcast<u32>(image_sums[0][thread]);
        report[REPORT_TERMS + 4u + thread] = bitcast<u32>(surface_sums[0][thread]);
    }
}
