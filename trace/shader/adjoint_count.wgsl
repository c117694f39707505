// Number of pixels that blended the Gaussian at each place in the lists; added up, where their hits
// begin.

#import declarations
#import workgroup

@group(0) @binding(2) var<storage, read> masks: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> hit_starts: array<u32>;

@compute @workgroup_size(GROUP_SIZE)
fn count_hits(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let place = invocation_number(workgroup, workgroups, thread);
    if place < min(arrayLength(&hit_starts), arrayLength(&masks)) {
        hit_starts[place] = countOneBits(masks[place].x) + countOneBits(masks[place].y);
    }
}
