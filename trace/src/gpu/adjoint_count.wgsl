// Number of pixels that blended the Gaussian at each place in the lists; added up, where their hits
// begin.

@group(0) @binding(2) var<storage, read> masks: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> hit_starts: array<u32>;

@compute @workgroup_size(64)
fn count_hits(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let place = group_number(workgroup, workgroups) * 64u + thread;
    if place < min(arrayLength(&hit_starts), arrayLength(&masks)) {
        hit_starts[place] = countOneBits(masks[place].x) + countOneBits(masks[place].y);
    }
}
