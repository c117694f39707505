// Search along single rays through a binary tree of boxes.
//
// A node is two vectors: (min, first) and (max, count), the last ones as bits. With a count of 0
// the children are `first` and `first + 1`; otherwise the Gaussians are those of `leaf_indices`
// from `first` on.

struct Ray {
    origin: vec3f,
    direction: vec3f,
    // Distance up to which Gaussians that lie along the surface the ray leaves from do not count.
    t_min: f32,
    own_normal: vec3f,
}

fn ray_of(query: RayQuery) -> Ray {
    return Ray(query.origin, query.direction, query.t_min, query.own_normal);
}

struct Traversal {
    inverse: vec3f,
    // Beyond this nothing matters any more.
    t_max: f32,
    // Nodes yet to be looked into, and the distances at which the ray enters them.
    height: u32,
    node: array<u32, STACK>,
    near: array<f32, STACK>,
}

fn inverse_of(direction: vec3f) -> vec3f {
    // Axis-parallel rays: a huge finite reciprocal keeps 0·∞ out of the box test.
    let huge = select(vec3f(-1e20), vec3f(1e20), direction >= vec3f());
    let is_tiny = abs(direction) <= vec3f(1e-20);
    return select(1.0 / select(direction, vec3f(1.0), is_tiny), huge, is_tiny);
}

fn start_at(traversal: ptr<function, Traversal>, root: u32, direction: vec3f, t_max: f32) {
    (*traversal).inverse = inverse_of(direction);
    (*traversal).t_max = t_max;
    (*traversal).height = 0u;
    if root != NO_NODE {
        (*traversal).height = 1u;
        (*traversal).node[0] = root;
        (*traversal).near[0] = 0.0;
    }
}

// Distance at which the ray enters a box; infinite where it misses. Robust box test (Ize 2013): a
// few roundings on the far side, as many as the imprecise division of GPUs needs.
fn box_distance(node: u32, origin: vec3f, inverse: vec3f, t_max: f32) -> f32 {
    let a = (nodes[2u * node].xyz - origin) * inverse;
    let b = (nodes[2u * node + 1u].xyz - origin) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    let near = max(max(low.x, low.y), max(low.z, 0.0));
    let far = min(min(high.x, high.y), min(high.z, t_max));
    return select(INFINITE, near, near <= far * 1.000001);
}

// The leaf that comes next, as range of `leaf_indices`; empty at the end. Nearer leaves mostly come
// first.
fn next_leaf(traversal: ptr<function, Traversal>, origin: vec3f) -> vec2u {
    while (*traversal).height > 0u {
        let top = (*traversal).height - 1u;
        (*traversal).height = top;
        if (*traversal).near[top] > (*traversal).t_max {
            continue;
        }
        let node = (*traversal).node[top];
        let first = bitcast<u32>(nodes[2u * node].w);
        let count = bitcast<u32>(nodes[2u * node + 1u].w);
        if count > 0u {
            return vec2u(first, first + count);
        }
        let near_a = box_distance(first, origin, (*traversal).inverse, (*traversal).t_max);
        let near_b = box_distance(first + 1u, origin, (*traversal).inverse, (*traversal).t_max);
        let is_a_nearer = near_a <= near_b;
        push(traversal, first + u32(is_a_nearer), max(near_a, near_b));
        push(traversal, first + u32(!is_a_nearer), min(near_a, near_b));
    }
    return vec2u();
}

fn push(traversal: ptr<function, Traversal>, node: u32, near: f32) {
    // No tree has more levels than that (`Trees::add`): nothing is left out.
    if near < INFINITE && (*traversal).height < STACK {
        (*traversal).node[(*traversal).height] = node;
        (*traversal).near[(*traversal).height] = near;
        (*traversal).height += 1u;
    }
}

// Whether a hit is on the very surface that the ray leaves from.
fn is_own(seen: Seen, hit: PlaneHit, ray: Ray) -> bool {
    return hit.t <= ray.t_min && abs(dot(seen.normal, ray.own_normal)) > OWN_COSINE;
}

// Hits are known by the index of their Gaussian.
fn index_of(index: u32) -> u32 {
    return index;
}

// composited features along a ray.
fn trace_ray(ray: Ray) -> Lanes {
    var state = Blender(NO_LANES, 1.0);
    var pending: Pending;
    var traversal: Traversal;
    var from_t = -1.0;
    var from_index = 0u;
    loop {
        clear(&pending);
        start_at(&traversal, light.scene_root, ray.direction, INFINITE);
        loop {
            let leaf = next_leaf(&traversal, ray.origin);
            if leaf.x == leaf.y {
                break;
            }
            for (var i = leaf.x; i < leaf.y; i++) {
                let index = leaf_indices[i];
                let seen = seen_from(surfels[index], ray.origin);
                let hit = meet(seen, ray.direction);
                if counts(seen, hit) && !is_own(seen, hit, ray) && !is_before(hit.t, index, from_t, from_index) {
                    wait_for(&pending, hit.t, index);
                }
            }
            traversal.t_max = pending.forgotten_t;
        }
        var ended = false;
        for (var i = pending.next; i < pending.end && !ended; i++) {
            let index = pending.number[i];
            let seen = seen_from(surfels[index], ray.origin);
            let alpha = alpha_of(seen, meet(seen, ray.direction));
            ended = accumulate(&state, pending.t[i], alpha, attributes[index], ray.direction) == LAST;
        }
        if ended || pending.forgotten_t == INFINITE {
            break;
        }
        from_t = pending.forgotten_t;
        from_index = pending.forgotten;
    }
    return state.features;
}

// A number in [0, 1) for each Gaussian that a ray may meet: the order in which a search finds them
// does not matter.
fn uniform_of(seed: u32, index: u32) -> f32 {
    var x = seed ^ (index * 0x9e3779b9u);
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    x ^= x >> 16u;
    return f32(x >> 8u) * (1.0 / 16777216.0);
}

// The Gaussian of one hit of the ray, chosen with the weight it has in the blend; NO_NODE with the
// probability of meeting nothing. Every hit is accepted with probability α, and the nearest
// accepted one is the choice (stochastic transparency, Enderton et al. 2010).
fn sample_hit(ray: Ray, seed: u32) -> u32 {
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
            let seen = seen_from(surfels[index], ray.origin);
            let hit = meet(seen, ray.direction);
            if !is_before(hit.t, index, traversal.t_max, nearest) || !counts(seen, hit) || is_own(seen, hit, ray) {
                continue;
            }
            if uniform_of(seed, index) < alpha_of(seen, hit) {
                nearest = index;
                traversal.t_max = hit.t;
            }
        }
    }
    return nearest;
}

// Features of a ray whose one hit stands for all: the twin of `features_of_one`.
fn sample_ray(ray: Ray, seed: u32) -> Lanes {
    let index = sample_hit(ray, seed);
    if index == NO_NODE {
        return NO_LANES;
    }
    let t = meet(seen_from(surfels[index], ray.origin), ray.direction).t;
    var features = hit_values(attributes[index], ray.direction, t);
    let size = features.d.y;
    features.d = vec4f(size * size, size, t, 0.0);
    return features;
}
