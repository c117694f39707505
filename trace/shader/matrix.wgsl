// Entries of the light-transport matrix: which Gaussians light each other.
//
// A ray meets the opaque discs of one stochastic realization. The CPU has a tree for each
// realization; here all share one tree, whose boxes hold the largest disc of each Gaussian, and how
// large a disc is in the realization of a ray is looked up at leaves.

#import declarations
#import workgroup
#import features
#import surfel
#import bvh
#import points
#import sampling
#import surface
#import light_list
#import pending

@group(0) @binding(1) var<uniform> light: TransportParameters;
@group(0) @binding(3) var<storage, read> attributes: array<Lanes>;
// Squared radii in standard deviations, negative for a disc that is not there: [n,
// NUM_REALIZATIONS].
@group(0) @binding(7) var<storage, read> radii: array<f32>;
@group(0) @binding(8) var<storage, read> receivers: array<ReceiverOnDevice>;
// [receivers, samples of a dispatch].
@group(0) @binding(9) var<storage, read_write> found: array<FoundEntry>;
// [receivers, samples of a dispatch].
@group(0) @binding(10) var<storage, read_write> targets: array<u32>;
// [receivers].
@group(0) @binding(11) var<storage, read_write> direct: array<DirectLight>;

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
fn light_of(emitter: u32, realization: u32, surface: Surface, direction: vec3f) -> vec3f {
    let q = dot(direction, surface.normal) / PI;
    let p = light_list_density(light.num_clusters, light.light_root, realization, surface, direction);
    let all = f32(light.num_bsdf) * q + f32(light.num_to_lights) * p;
    return attributes[emitter].a.xyz * (q / all);
}

fn follow(receiver: ReceiverOnDevice, sample: u32) -> FoundEntry {
    let surface = Surface(true, receiver.position, receiver.normal, receiver.offset);
    let num_samples = select(light.num_bsdf, light.num_to_lights, light.is_towards_lights == 1u);
    let numbers = row_block_of(light.key, receiver.element, num_samples, sample, light.is_towards_lights);
    // Samples of a receiver take turns in the realizations, and receivers begin with different
    // ones.
    let realization = (word_of(light.key, receiver.element, 0u) + sample) % NUM_REALIZATIONS;
    var direction = vec3f();
    if light.is_towards_lights == 1u {
        direction = sample_light_list(light.num_clusters, realization, surface, numbers.x, numbers.y, numbers.z);
        if dot(direction, surface.normal) <= 0.0 {
            return FoundEntry(vec3f(), NO_NODE);
        }
    } else {
        direction = cosine_direction(surface.normal, numbers.x, numbers.y);
    }
    let hit = realization_hit(ray_from(surface, direction), realization);
    if hit == NO_NODE {
        return FoundEntry(vec3f(), NOTHING);
    }
    if attributes[hit].a.w > light.emission_threshold {
        return FoundEntry(light_of(hit, realization, surface, direction), hit | EMITTER);
    }
    return FoundEntry(vec3f(), hit);
}

@compute @workgroup_size(GROUP_SIZE)
fn follow_directions(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = invocation_number(workgroup, workgroups, thread);
    let num_samples = light.end_sample - light.first_sample;
    let receiver = number / num_samples;
    if receiver < light.num_receivers {
        found[number] = follow(receivers[receiver], light.first_sample + number % num_samples);
    }
}

// In the order of samples: the sum does not depend on how they are divided among dispatches.
@compute @workgroup_size(GROUP_SIZE)
fn add_up(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let receiver = invocation_number(workgroup, workgroups, thread);
    if receiver >= light.num_receivers {
        return;
    }
    var total = direct[receiver];
    let num_samples = light.end_sample - light.first_sample;
    for (var sample = 0u; sample < num_samples; sample++) {
        let number = receiver * num_samples + sample;
        let one = found[number];
        total.light += one.light;
        let luminance = dot(one.light, vec3f(0.2126, 0.7152, 0.0722));
        total.squares += luminance * luminance;
        total.num_rays += u32(one.gaussian != NO_NODE);
        targets[number] = select(one.gaussian, NOTHING, one.gaussian == NO_NODE);
    }
    direct[receiver] = total;
}
