// Single rays of any origin and direction, each with what it is asked for.

@group(0) @binding(1) var<uniform> light: LightParameters;
@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(3) var<storage, read> attributes: array<Lanes>;
@group(0) @binding(4) var<storage, read> nodes: array<vec4f>;
@group(0) @binding(5) var<storage, read> leaf_indices: array<u32>;
@group(0) @binding(6) var<storage, read> rays: array<RayQuery>;
@group(0) @binding(7) var<storage, read_write> ray_features: array<Lanes>;
@group(0) @binding(8) var<storage, read_write> chosen: array<u32>;

@compute @workgroup_size(64)
fn blend_rays(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = light.start_pixel + group_number(workgroup, workgroups) * 64u + thread;
    if number < light.end_pixel && rays[number].is_idle == 0u {
        ray_features[number] = trace_ray(ray_of(rays[number]));
    }
}

@compute @workgroup_size(64)
fn sample_rays(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = light.start_pixel + group_number(workgroup, workgroups) * 64u + thread;
    if number < light.end_pixel && rays[number].is_idle == 0u {
        ray_features[number] = sample_ray(ray_of(rays[number]), rays[number].seed);
    }
}

@compute @workgroup_size(64)
fn choose_hits(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = light.start_pixel + group_number(workgroup, workgroups) * 64u + thread;
    if number < light.end_pixel {
        chosen[number] = sample_hit(ray_of(rays[number]), rays[number].seed);
    }
}
