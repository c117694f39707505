// Whether more than half of the light passes along single rays, each up to a distance.

#import declarations
#import workgroup
#import surfel
#import bvh

@group(0) @binding(1) var<uniform> light: LightParameters;
@group(0) @binding(6) var<storage, read> rays: array<RayQuery>;
@group(0) @binding(7) var<storage, read> distances: array<f32>;
@group(0) @binding(8) var<storage, read_write> is_free: array<u32>;

// Hits in any order, no further than the distance, and no more of them than it takes.
fn passes_half(root: u32, ray: Ray, distance: f32) -> bool {
    var traversal: Traversal;
    start_at(&traversal, root, ray.direction, distance);
    var passed = 1.0;
    while passed > FREE {
        let leaf = next_leaf(&traversal, ray.origin);
        if leaf.x == leaf.y {
            break;
        }
        for (var i = leaf.x; i < leaf.y; i++) {
            let seen = seen_from(surfels[leaf_indices[i]], ray.origin);
            let hit = meet(seen, ray.direction);
            if counts(seen, hit) && hit.t <= distance && !is_own(seen, hit, ray) {
                passed *= 1.0 - alpha_of(seen, hit);
            }
        }
    }
    return passed > FREE;
}

@compute @workgroup_size(GROUP_SIZE)
fn find_free_rays(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = light.start_pixel + invocation_number(workgroup, workgroups, thread);
    if number < light.end_pixel {
        is_free[number] = u32(passes_half(light.scene_root, ray_of(rays[number]), distances[number]));
    }
}
