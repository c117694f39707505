// Single rays of any origin and direction.

#import declarations
#import workgroup
#import features
#import ray_search

@group(0) @binding(1) var<uniform> light: LightParameters;
@group(0) @binding(6) var<storage, read> rays: array<RayQuery>;
@group(0) @binding(7) var<storage, read_write> ray_features: array<Lanes>;
#ifdef ray_gloss
@group(0) @binding(9) var<storage, read_write> ray_glosses: array<vec4f>;
#endif

fn tell(number: u32, met: Lanes) {
    ray_features[number] = met;
#ifdef ray_gloss
    ray_glosses[number] = finished_gloss(met.c.z);
#endif
}

@compute @workgroup_size(GROUP_SIZE)
fn blend_rays(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = light.start_pixel + invocation_number(workgroup, workgroups, thread);
    if number < light.end_pixel && rays[number].is_idle == 0u {
        tell(number, trace_ray(light.scene_root, ray_of(rays[number])));
    }
}

@compute @workgroup_size(GROUP_SIZE)
fn sample_rays(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = light.start_pixel + invocation_number(workgroup, workgroups, thread);
    if number < light.end_pixel && rays[number].is_idle == 0u {
        tell(number, sample_ray(light.scene_root, ray_of(rays[number]), rays[number].seed));
    }
}
