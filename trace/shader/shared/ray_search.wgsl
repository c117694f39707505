// Hits of single rays with the Gaussians of the tree at `root`.

#import declarations
#import features
#import surfel
#import blend
#import pending
#import bvh
#ifdef ray_gloss
#import gloss_blend
#endif

@group(0) @binding(3) var<storage, read> attributes: array<Lanes>;

// Composited features along a ray.
fn trace_ray(root: u32, ray: Ray) -> Lanes {
    var state = Blender(NO_LANES, 1.0);
#ifdef ray_gloss
    blended_gloss = GlossBlend();
#endif
    var pending: Pending;
    var traversal: Traversal;
    var from_t = -1.0;
    var from_index = 0u;
    loop {
        clear(&pending);
        start_at(&traversal, root, ray.direction, INFINITE);
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
#ifdef ray_gloss
            let weight = state.transmittance * alpha;
            if weight >= MIN_WEIGHT {
                add_gloss(weight, index);
            }
#endif
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
fn sample_hit(root: u32, ray: Ray, seed: u32) -> u32 {
    var traversal: Traversal;
    start_at(&traversal, root, ray.direction, INFINITE);
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

// Features of a ray whose one hit stands for all.
fn sample_ray(root: u32, ray: Ray, seed: u32) -> Lanes {
    let index = sample_hit(root, ray, seed);
#ifdef ray_gloss
    blended_gloss = GlossBlend();
#endif
    if index == NO_NODE {
        return NO_LANES;
    }
#ifdef ray_gloss
    add_gloss(1.0, index);
#endif
    let t = meet(seen_from(surfels[index], ray.origin), ray.direction).t;
    var features = hit_values(attributes[index], ray.direction, t);
    let size = features.d.y;
    features.d = vec4f(size * size, size, t, 0.0);
    return features;
}
