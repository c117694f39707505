// Which Gaussians light each other: the twin of links.rs in transport, and of draws.rs.
//
// A ray meets the opaque discs of one draw. All draws share a tree whose boxes hold the largest disc of each Gaussian; how large a disc is in
// the draw of a ray is looked up at leaves.

@group(0) @binding(1) var<uniform> light: LinkParameters;
@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(3) var<storage, read> payloads: array<Lanes>;
// Of the largest discs, then of the emitters.
@group(0) @binding(4) var<storage, read> nodes: array<vec4f>;
@group(0) @binding(5) var<storage, read> leaf_indices: array<u32>;
@group(0) @binding(6) var<storage, read> emitters: array<Emitter>;
// Squared radii in standard deviations, negative for a disc that is not there: [n, NUM_DRAWS].
@group(0) @binding(7) var<storage, read> radii: array<f32>;
@group(0) @binding(8) var<storage, read> receivers: array<ReceiverOnDevice>;
// [receivers, samples of a dispatch].
@group(0) @binding(9) var<storage, read_write> found: array<FoundLink>;
// [receivers, samples of a dispatch].
@group(0) @binding(10) var<storage, read_write> links: array<u32>;
// [receivers].
@group(0) @binding(11) var<storage, read_write> arrived: array<ArrivedLight>;
// As many as there are receivers; the seed of each is its draw.
@group(0) @binding(12) var<storage, read> rays: array<RayQuery>;

// The nearest disc of a draw, NO_NODE if there is none.
fn drawn_hit(ray: Ray, draw: u32) -> u32 {
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
            let radius2 = radii[index * NUM_DRAWS + draw];
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

// What a direction that found an emitter adds: L q / (n q + m p), for n directions of density q and m of density p.
fn light_of(emitter: u32, surface: Surface, direction: vec3f) -> vec3f {
    let q = dot(direction, surface.normal) / PI;
    let p = light_density(surface.position, direction);
    let all = f32(light.num_plain) * q + f32(light.num_to_lights) * p;
    return payloads[emitter].a.xyz * (q / all);
}

fn follow(receiver: ReceiverOnDevice, sample: u32) -> FoundLink {
    let surface = Surface(true, receiver.position, receiver.normal, receiver.slab);
    let numbers = block_of(light.key, receiver.element, sample, light.is_towards_lights);
    var direction = vec3f();
    if light.is_towards_lights == 1u {
        direction = sample_light(surface.position, numbers.x, numbers.y, numbers.z);
        if dot(direction, surface.normal) <= 0.0 {
            return FoundLink(vec3f(), NO_NODE);
        }
    } else {
        direction = cosine_direction(surface.normal, numbers.x, numbers.y);
    }
    // Samples of a receiver take turns in the draws, and receivers begin with different ones.
    let draw = (word_of(light.key, receiver.element, 0u) + sample) % NUM_DRAWS;
    let hit = drawn_hit(ray_from(surface, direction), draw);
    if hit == NO_NODE {
        return FoundLink(vec3f(), NOTHING);
    }
    if payloads[hit].a.w > light.emission_threshold {
        return FoundLink(light_of(hit, surface, direction), NOTHING);
    }
    return FoundLink(vec3f(), hit);
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
        total.num_rays += u32(one.link != NO_NODE);
        links[number] = one.link;
    }
    arrived[receiver] = total;
}

@compute @workgroup_size(64)
fn first_hits(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = group_number(workgroup, workgroups) * 64u + thread;
    if number >= light.num_receivers {
        return;
    }
    let hit = drawn_hit(ray_of(rays[number]), rays[number].seed % NUM_DRAWS);
    links[number] = select(hit, NOTHING, hit == NO_NODE);
}
