// Search along single rays through a binary tree of boxes.
//
// A node is two vectors: (min, first) and (max, count), the last ones as bits. With a count of 0
// the children are `first` and `first + 1`; otherwise the Gaussians are those of `leaf_indices`
// from `first` on.

#import declarations
#import surfel
#import pending

@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
// Of the scene, then of the emitters.
@group(0) @binding(4) var<storage, read> nodes: array<vec4f>;
@group(0) @binding(5) var<storage, read> leaf_indices: array<u32>;

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
