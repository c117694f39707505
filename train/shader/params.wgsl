// One step of Adam on raw parameters, and the Gaussians that follow from them; see params.rs.

#import declarations
#import training
#import workgroup
#import features
#import exp_ln
#import harmonics

@group(0) @binding(0) var<uniform> adam: AdamParameters;
// [n, NUM_PARAMETERS] each.
@group(0) @binding(1) var<storage, read_write> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> first: array<f32>;
@group(0) @binding(3) var<storage, read_write> second: array<f32>;
// Gradients in the frame of each Gaussian, in the order of `grad_lane`.
@group(0) @binding(4) var<storage, read> gradients: array<Lanes>;
// Gradients by the raw parameters.
@group(0) @binding(5) var<storage, read_write> raw_gradients: array<f32>;
@group(0) @binding(6) var<storage, read_write> report: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> surfels: array<Surfel>;
// In `chain_rule` as the camera sees them.
@group(0) @binding(8) var<storage, read_write> attributes: array<Lanes>;
// Of the rays.
@group(0) @binding(9) var<storage, read_write> counters: array<atomic<u32>>;

struct Activated {
    position: vec3f,
    scale: vec2f,
    // x y z w
    rotation: vec4f,
    // Of the raw quaternion.
    length: f32,
    opacity: f32,
    radiance: vec3f,
    emission: f32,
    albedo: vec3f,
}

fn sigmoid(x: f32) -> f32 {
    return 1.0 / (1.0 + exp_of(-x));
}

fn value3(at: u32) -> vec3f {
    return vec3f(values[at], values[at + 1u], values[at + 2u]);
}

fn exp3(x: vec3f) -> vec3f {
    return vec3f(exp_of(x.x), exp_of(x.y), exp_of(x.z));
}

fn activated(at: u32) -> Activated {
    // w x y z
    let raw = vec4f(value3(at + ROTATION + 1u), values[at + ROTATION]);
    let norm = length(raw);
    let albedo = value3(at + ALBEDO);
    return Activated(
        value3(at + POSITION),
        vec2f(exp_of(values[at + SCALE]), exp_of(values[at + SCALE + 1u])),
        raw / norm,
        norm,
        sigmoid(values[at + OPACITY]),
        exp3(value3(at + RADIANCE)),
        sigmoid(values[at + EMISSION]),
        MAX_ALBEDO * vec3f(sigmoid(albedo.x), sigmoid(albedo.y), sigmoid(albedo.z)),
    );
}

// Columns t_u, t_v, n.
fn frame_of(q: vec4f) -> mat3x3f {
    let twice = q.xyz + q.xyz;
    let x = q.x * twice;
    let y = q.y * twice;
    let zz = q.z * twice.z;
    let w = q.w * twice;
    return mat3x3f(
        vec3f(1.0 - (y.y + zz), x.y + w.z, x.z - w.y),
        vec3f(x.y - w.z, 1.0 - (x.x + zz), y.z + w.x),
        vec3f(x.z + w.y, y.z - w.x, 1.0 - (x.x + y.y)),
    );
}

fn put(at: u32, value: f32) -> f32 {
    raw_gradients[at] = value;
    return value;
}

fn put3(at: u32, value: vec3f) -> f32 {
    raw_gradients[at] = value.x;
    raw_gradients[at + 1u] = value.y;
    raw_gradients[at + 2u] = value.z;
    return value.x + value.y + value.z;
}

// By bits: compilers may assume that no number is infinite or a NaN.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

// Leaves the gradients of a fixed Gaussian that move it, those of its radiance where it does not
// shine, and returns their sum.
fn keep_of_fixed(at: u32) -> f32 {
    let shines = values[at + EMISSION] > 0.0;
    var sum = 0.0;
    for (var k = 0u; k < NUM_PARAMETERS; k++) {
        if shines || k < RADIANCE || k >= EMISSION {
            raw_gradients[at + k] = 0.0;
        } else {
            sum += raw_gradients[at + k];
        }
    }
    return sum;
}

@compute @workgroup_size(GROUP_SIZE)
fn chain_rule(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = invocation_number(workgroup, workgroups, thread);
    // The gradients of the step that failed are still to be read.
    if index >= adam.num_gaussians || has_failed() {
        return;
    }
    let at = index * NUM_PARAMETERS;
    let g = activated(at);
    let d = gradients[index];
    var sum = put3(at + POSITION, frame_of(g.rotation) * d.a.xyz);
    sum += put(at + SCALE, d.a.w * g.scale.x) + put(at + SCALE + 1u, d.b.x * g.scale.y);
    // q⊗(0, turn) is tangent to the sphere: normalisation only divides by the length.
    let turn = d.b.yzw;
    let q = g.rotation;
    let factor = 2.0 / g.length;
    sum += put(at + ROTATION, -dot(q.xyz, turn) * factor);
    sum += put3(at + ROTATION + 1u, (q.w * turn + cross(q.xyz, turn)) * factor);
    sum += put(at + OPACITY, d.c.x * g.opacity * (1.0 - g.opacity));
    sum += put3(at + RADIANCE, d.c.yzw * attributes[index].a.xyz);
    sum += put(at + EMISSION, d.d.x * g.emission * (1.0 - g.emission));
    sum += put3(at + ALBEDO, d.d.yzw * g.albedo * (1.0 - g.albedo / MAX_ALBEDO));
    if index >= adam.first_fixed {
        sum = keep_of_fixed(at);
    }
    // A sum is not finite if one of its terms is not.
    if !is_finite(sum) {
        atomicMin(&report[REPORT_BAD], index);
    }
}

fn surfel_of(g: Activated, frame: mat3x3f) -> Surfel {
    return Surfel(
        g.position,
        g.opacity,
        frame[0] / g.scale.x,
        min(2.0 * ln_of(g.opacity / MIN_ALPHA), MAX_RADIUS * MAX_RADIUS),
        frame[1] / g.scale.y,
        sqrt(g.scale.x * g.scale.y),
        frame[2],
        0.0,
    );
}

// Whether this step or one before it did not fit, or one before it had a gradient that is no
// number.
fn has_failed() -> bool {
    return atomicLoad(&counters[COUNTER_FAILED]) != 0u;
}

// Otherwise nothing changes.
fn gradients_are_good() -> bool {
    return !has_failed() && atomicLoad(&report[REPORT_BAD]) == NOTHING_BAD;
}

fn move_value(at: u32, gradient: f32, size: f32, decay: f32, corrections: vec2f) {
    let mean = BETA_1 * first[at] + (1.0 - BETA_1) * gradient;
    let square = BETA_2 * second[at] + (1.0 - BETA_2) * gradient * gradient;
    first[at] = mean;
    second[at] = square;
    let root = sqrt(square * corrections.y) + EPSILON;
    values[at] = (1.0 - size * decay) * values[at] - size * mean * corrections.x / root;
}

// Moves the coefficients of harmonics, one function of a Gaussian for each invocation: neighbours
// then move neighbours in memory. `values`, `first` and `second` are [n, NUM_FUNCTIONS, 3] each.
@compute @workgroup_size(GROUP_SIZE)
fn harmonics_step(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let row = invocation_number(workgroup, workgroups, thread);
    let index = row / NUM_FUNCTIONS;
    if index >= adam.num_gaussians || !gradients_are_good() {
        return;
    }
    let k = row % NUM_FUNCTIONS;
    let corrections = vec2f(adam.harmonics_correction_1, adam.harmonics_correction_2);
    var functions = harmonic_functions(adam.eye, surfels[index].position);
    let size = adam.harmonics[k / 4u][k % 4u];
    for (var channel = 0u; channel < 3u; channel++) {
        // By the logarithm of radiance.
        let gradient = raw_gradients[index * NUM_PARAMETERS + RADIANCE + channel];
        move_value(3u * row + channel, gradient * functions[k], size, adam.harmonics_decay, corrections);
    }
}

// Moves the raw parameters, one for each invocation; `activate` follows.
@compute @workgroup_size(GROUP_SIZE)
fn adam_step(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let at = invocation_number(workgroup, workgroups, thread);
    if at == 0u {
        if atomicLoad(&report[REPORT_BAD]) != NOTHING_BAD {
            // The steps behind this one move nothing; to this one it makes no difference.
            atomicStore(&counters[COUNTER_FAILED], 1u);
        }
        for (var k = 0u; k < NUM_COUNTERS; k++) {
            atomicStore(&report[REPORT_NEEDED + k], atomicLoad(&counters[k]));
        }
    }
    if at >= adam.num_gaussians * NUM_PARAMETERS || !gradients_are_good() {
        return;
    }
    let k = at % NUM_PARAMETERS;
    let corrections = vec2f(adam.correction_1, adam.correction_2);
    move_value(at, raw_gradients[at], adam.sizes[k / 4u][k % 4u], 0.0, corrections);
}

// Puts the Gaussians of the raw parameters into the scene, before the first step and after each:
// the host would round otherwise.
@compute @workgroup_size(GROUP_SIZE)
fn activate(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = invocation_number(workgroup, workgroups, thread);
    if index >= adam.num_gaussians {
        return;
    }
    let g = activated(index * NUM_PARAMETERS);
    let frame = frame_of(g.rotation);
    let surfel = surfel_of(g, frame);
    surfels[index] = surfel;
    attributes[index] = Lanes(
        vec4f(g.radiance, g.emission),
        vec4f(g.albedo, frame[2].x),
        vec4f(frame[2].yz, 1.0, 0.0),
        vec4f(0.0, surfel.size, 0.0, 0.0),
    );
}
