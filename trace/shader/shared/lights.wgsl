// Directions towards emitters, and the density with which they are chosen; see lights.rs.

#import declarations
#import exp
#import surfel
#import bvh
#import sampling

@group(0) @binding(6) var<storage, read> emitters: array<Emitter>;

// A direction from `origin` to a random point of a random emitter; zero if the point is the origin.
fn sample_light(num_emitters: u32, origin: vec3f, pick: f32, a: f32, b: f32) -> vec3f {
    // The first emitter whose cumulative probability is above `pick`.
    var low = 0u;
    var high = num_emitters - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if emitters[middle].cumulative <= pick {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let emitter = emitters[low];
    let surfel = emitter.surfel;
    let axis_u = surfel.axis_u / dot(surfel.axis_u, surfel.axis_u);
    let axis_v = surfel.axis_v / dot(surfel.axis_v, surfel.axis_v);
    // Inverse of the footprint's radial distribution, 1 − exp(−r²/2), cut at its rim.
    let radius = sqrt(max(-2.0 * log(1.0 - a * emitter.inside), 0.0));
    let flat = radius * turn(b);
    let offset = surfel.position + axis_u * flat.x + axis_v * flat.y - origin;
    let length2 = dot(offset, offset);
    return select(vec3f(), offset * inverseSqrt(length2), length2 > 1e-30);
}

// Density over solid angle with which `sample_light` chooses `direction`: every emitter along the
// ray could have been the one.
fn light_density(root: u32, origin: vec3f, direction: vec3f) -> f32 {
    var traversal: Traversal;
    start_at(&traversal, root, direction, INFINITE);
    var density = 0.0;
    loop {
        let leaf = next_leaf(&traversal, origin);
        if leaf.x == leaf.y {
            break;
        }
        for (var i = leaf.x; i < leaf.y; i++) {
            let emitter = emitters[leaf_indices[i]];
            let seen = seen_from(emitter.surfel, origin);
            let hit = meet(seen, direction);
            if counts(seen, hit) {
                let footprint = exp_of_negative(-0.5 * (hit.u * hit.u + hit.v * hit.v));
                density += emitter.density * footprint * hit.t * hit.t / abs(hit.cosine);
            }
        }
    }
    return density;
}
