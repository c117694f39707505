// Directions towards emitters of one realization, and the density with which they are chosen; see
// light_list.rs.

#import declarations
#import surfel
#import bvh
#import sampling
#import surface

@group(0) @binding(6) var<storage, read> light_discs: array<LightDisc>;
@group(0) @binding(12) var<uniform> light_clusters: array<LightCluster, MAX_CLUSTERS>;

// Light that a receiver may get of a cluster, relative to its luminance times area.
fn importance_of(cluster: u32, receiver: Surface) -> f32 {
    let offset = light_clusters[cluster].centre - receiver.position;
    let radius = light_clusters[cluster].radius;
    let spread = light_clusters[cluster].spread;
    var above = dot(receiver.normal, offset);
    if above < radius {
        let part = max(above + radius, 0.0);
        above = part * part / (4.0 * radius);
    }
    let distance2 = dot(offset, offset) + spread;
    let crossed = offset.yzx * offset.zxy;
    let facing = dot(light_clusters[cluster].squares, offset * offset)
        + 2.0 * dot(light_clusters[cluster].products, crossed);
    return above * sqrt(max(facing, 0.0) + spread / 3.0) / (distance2 * distance2);
}

fn power_of(cluster: u32, realization: u32) -> f32 {
    return light_clusters[cluster].powers[realization / 4u][realization % 4u];
}

// Sum over the clusters of importance times power.
fn total_importance(num_clusters: u32, realization: u32, receiver: Surface) -> f32 {
    var sum = 0.0;
    for (var cluster = 0u; cluster < num_clusters; cluster++) {
        sum += importance_of(cluster, receiver) * power_of(cluster, realization);
    }
    return sum;
}

// A direction from a receiver to a random point of a random emitter; zero if nothing shines that it
// may see.
fn sample_light_list(num_clusters: u32, realization: u32, receiver: Surface, pick: f32, a: f32, b: f32) -> vec3f {
    var left = pick * total_importance(num_clusters, realization, receiver);
    var chosen = NO_NODE;
    var power = 0.0;
    for (var cluster = 0u; cluster < num_clusters; cluster++) {
        let importance = importance_of(cluster, receiver);
        let share = importance * power_of(cluster, realization);
        if share > 0.0 {
            // Rounding may leave a little at the end.
            chosen = cluster;
            power = left / importance;
            if left < share {
                break;
            }
        }
        left -= share;
    }
    if chosen == NO_NODE {
        return vec3f();
    }
    // The first disc whose cumulative power is above that.
    var low = light_clusters[chosen].first;
    var high = light_clusters[chosen].end - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if light_discs[middle].cumulative[realization / 4u][realization % 4u] <= power {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let surfel = light_discs[low].surfel;
    let axis_u = surfel.axis_u / dot(surfel.axis_u, surfel.axis_u);
    let axis_v = surfel.axis_v / dot(surfel.axis_v, surfel.axis_v);
    let radius2 = light_discs[low].radii[realization / 4u][realization % 4u];
    let flat = sqrt(a * max(radius2, 0.0)) * turn(b);
    let offset = surfel.position + axis_u * flat.x + axis_v * flat.y - receiver.position;
    let length2 = dot(offset, offset);
    return select(vec3f(), offset * inverseSqrt(length2), length2 > 1e-30);
}

// Density over solid angle with which `sample_light_list` chooses `direction`: every emitter along
// the ray could have been the one.
fn light_list_density(num_clusters: u32, root: u32, realization: u32, receiver: Surface, direction: vec3f) -> f32 {
    var traversal: Traversal;
    start_at(&traversal, root, direction, INFINITE);
    var sum = 0.0;
    loop {
        let leaf = next_leaf(&traversal, receiver.position);
        if leaf.x == leaf.y {
            break;
        }
        for (var i = leaf.x; i < leaf.y; i++) {
            let disc = leaf_indices[i];
            let radius2 = light_discs[disc].radii[realization / 4u][realization % 4u];
            if radius2 <= 0.0 {
                continue;
            }
            var seen = seen_from(light_discs[disc].surfel, receiver.position);
            seen.cut2 = radius2;
            let hit = meet(seen, direction);
            if counts(seen, hit) {
                let importance = importance_of(light_discs[disc].cluster, receiver);
                sum += importance * light_discs[disc].luminance * hit.t * hit.t / abs(hit.cosine);
            }
        }
    }
    if sum > 0.0 {
        return sum / total_importance(num_clusters, realization, receiver);
    }
    return 0.0;
}
