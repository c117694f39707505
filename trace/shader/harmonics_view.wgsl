// Attributes of Gaussians as a camera sees them: `evaluate_harmonics` on the device.

#import declarations
#import workgroup
#import features
#import exp
#import harmonics
#import view

@group(0) @binding(1) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(2) var<storage, read> attributes: array<Lanes>;
// [n, NUM_FUNCTIONS, 3]
@group(0) @binding(3) var<storage, read> harmonics: array<f32>;
@group(0) @binding(4) var<storage, read_write> seen_attributes: array<Lanes>;

@compute @workgroup_size(GROUP_SIZE)
fn evaluate_harmonics(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = invocation_number(workgroup, workgroups, thread);
    if index >= view.num_surfels {
        return;
    }
    var functions = harmonic_functions(view.origin, surfels[index].position);
    var sum = vec3f();
    for (var k = 0u; k < NUM_FUNCTIONS; k++) {
        let at = (index * NUM_FUNCTIONS + k) * 3u;
        sum += vec3f(harmonics[at], harmonics[at + 1u], harmonics[at + 2u]) * functions[k];
    }
    sum = clamp(sum, vec3f(-MAX_EXPONENT), vec3f(MAX_EXPONENT));
    let factor = vec3f(exp_of_negative(sum.x), exp_of_negative(sum.y), exp_of_negative(sum.z));
    var seen = attributes[index];
    seen.a = vec4f(seen.a.xyz * factor, seen.a.w);
    seen_attributes[index] = seen;
}
