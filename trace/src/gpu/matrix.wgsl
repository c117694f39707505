// Entries of the light-transport matrix: counterpart of matrix.rs in transport, and of
// realizations.rs.
//
// A ray meets the opaque discs of one realization. All realizations share a tree whose boxes hold
// the largest disc of each Gaussian; how large a disc is in the realization of a ray is looked up
// at leaves.

@group(0) @binding(1) var<uniform> light: TransportParameters;
@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(3) var<storage, read> attributes: array<Lanes>;
// Of the largest discs, then of the emitters.
@group(0) @binding(4) var<storage, read> nodes: array<vec4f>;
@group(0) @binding(5) var<storage, read> leaf_indices: array<u32>;
@group(0) @binding(6) var<storage, read> emitters: array<Emitter>;
// Squared radii in standard deviations, negative for a disc that is not there: [n,
// NUM_REALIZATIONS].
@group(0) @binding(7) var<storage, read> radii: array<f32>;
@group(0) @binding(8) var<storage, read> receivers: array<ReceiverOnDevice>;
// [receivers, samples of a dispatch].
@group(0) @binding(9) var<storage, read_write> found: array<FoundEntry>;
// [receivers, samples of a dispatch].
@group(0) @binding(10) var<storage, read_write> matrix: array<u32>;
// [receivers].
@group(0) @binding(11) var<storage, read_write> arrived: array<ArrivedLight>;

// The nearest disc of a realization, NO_NODE if there is none.
fn realization_hit(ray: Ray, realization: u32) -> u32 {
    var traversal: Traversal;
    start_at(&traversal, light.scene_root, ray.direction, INFINITE);
    var nearest = NO_NODE;
    loop {
        let leaf = next_leaf(&traversal, ray.origin);
        if leaf.x == leaf.y {
            break;
        }
        for (var i = leaf.x; i < leaf.y; i++) {
            let index = leaf_indices[i];
            let radius2 = radii[index * NUM_REALIZATIONS + realization];
            if radius2 <= 0.0 {
                continue;
            }
            var seen = seen_from(surfels[index], ray.origin);
            seen.cut2 = radius2;
            let hit = meet(seen, ray.direction);
            if is_before(hit.t, index, traversal.t_max, nearest) && counts(seen, hit) && !is_own(seen, hit, ray) {
                nearest = index;
                traversal.t_max = hit.t;
            }
        }
    }
    return nearest;
}

// Light of an emitter that a direction found: L q / (n q + m p), for n BSDF samples of density q
// and m light samples of density p.
fn light_of(emitter: u32, surface: Surface, direction: vec3f) -> vec3f {
    let q = dot(direction, surface.normal) / PI;
    let p = light_density(surface.position, direction);
    let all = f32(light.num_bsdf) * q + f32(light.num_to_lights) * p;
    return attributes[emitter].a.xyz * (q / all);
}

fn follow(receiver: ReceiverOnDevice, sample: u32) -> FoundEntry {
    let surface = Surface(true, receiver.position, receiver.normal, receiver.offset);
    let numbers = block_of(light.key, receiver.element, sample, light.is_towards_lights);
    var direction = vec3f();
    if light.is_towards_lights == 1u {
        direction = sample_light(surface.position, numbers.x, numbers.y, numbers.z);
        if dot(direction, surface.normal) <= 0.0 {
            return FoundEntry(vec3f(), NO_NODE);
        }
    } else {
        direction = cosine_direction(surface.normal, numbers.x, numbers.y);
    }
    // Samples of a receiver take turns in the realizations, and receivers begin with different
    // ones.
    let realization = (word_of(light.key, receiver.element, 0u) + sample) % NUM_REALIZATIONS;
    let hit = realization_hit(ray_from(surface, direction), realization);
    if hit == NO_NODE {
        return FoundEntry(vec3f(), NOTHING);
    }
    if attributes[hit].a.w > light.emission_threshold {
        return FoundEntry(light_of(hit, surface, direction), hit | EMITTER);
    }
    return FoundEntry(vec3f(), hit);
}

@compute @workgroup_size(64)
fn follow_directions(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = group_number(workgroup, workgroups) * 64u + thread;
    let num_samples = light.end_sample - light.first_sample;
    let receiver = number / num_samples;
    if receiver < light.num_receivers {
        found[number] = follow(receivers[receiver], light.first_sample + number % num_samples);
    }
}

// In the order of samples: the sum does not depend on how they are divided among dispatches.
@compute @workgroup_size(64)
fn add_up(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let receiver = group_number(workgroup, workgroups) * 64u + thread;
    if receiver >= light.num_receivers {
        return;
    }
    var total = arrived[receiver];
    let num_samples = light.end_sample - light.first_sample;
    for (var sample = 0u; sample < num_samples; sample++) {
        let number = receiver * num_samples + sample;
        let one = found[number];
        total.light += one.light;
        total.num_rays += u32(one.target != NO_NODE);
        matrix[number] = select(one.target, NOTHING, one.target == NO_NODE);
    }
    arrived[receiver] = total;
}
