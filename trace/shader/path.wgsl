// Paths from a surface to the emitters, one ray of one bounce of one sample at a time; the CPU
// (path.rs) follows a path to its end instead.
//
// Two rays leave from every vertex: one towards an emitter, where that is asked for, then one about
// the normal, which the path follows. Each is aimed, traced (rays.wgsl) and shaded by a kernel of
// its own: small kernels keep more rays under way, and one kernel for all of it takes the compilers
// of some drivers minutes.

#import declarations
#import workgroup
#import features
#import points
#import sampling
#import surface
#import lights
#import integrator

@group(0) @binding(9) var<storage, read_write> paths: array<PathState>;
@group(0) @binding(10) var<storage, read_write> rays: array<RayQuery>;
@group(0) @binding(11) var<storage, read> ray_features: array<Lanes>;

// Blocks of random numbers of a bounce: one for the bounce, one for the light.
const BLOCKS = 2u;

fn is_towards_light() -> bool {
    return (light.flags & TOWARDS_LIGHT) != 0u;
}

fn numbers_of(pixel: u32) -> vec4f {
    let block = BLOCKS * light.bounce + u32(is_towards_light());
    return block_of(light.key, light.first_pixel + pixel, light.first_sample, block);
}

@compute @workgroup_size(GROUP_SIZE)
fn aim_rays(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = light.start_pixel + invocation_number(workgroup, workgroups, thread);
    if pixel >= light.end_pixel {
        return;
    }
    if (light.flags & FIRST_RAY) != 0u {
        let start = surface_of(pixel);
        paths[pixel] = PathState(
            start.position,
            start.offset,
            start.normal,
            0u,
            vec3f(1.0),
            u32(start.is_there),
            vec3f(),
            0u,
        );
        if light.first_sample == 0u {
            gathered[pixel] = NOTHING_GATHERED;
        }
    }
    let path = paths[pixel];
    if path.is_alive == 0u {
        rays[pixel].is_idle = 1u;
        return;
    }
    let numbers = numbers_of(pixel);
    var direction = cosine_direction(path.normal, numbers.x, numbers.y);
    if is_towards_light() {
        direction = sample_light(light.num_emitters, path.position, numbers.x, numbers.y, numbers.z);
    }
    let is_below = is_towards_light() && dot(direction, path.normal) <= 0.0;
    let ray = ray_from(Surface(true, path.position, path.normal, path.offset), direction);
    let choice = bitcast<u32>(numbers.w);
    rays[pixel] = RayQuery(ray.origin, ray.t_min, direction, choice, ray.own_normal, u32(is_below));
}

// Adds what a ray has met to its path; returns whether the path goes on.
fn shade(path: ptr<function, PathState>, direction: vec3f, met: Lanes, survive: f32) -> bool {
    (*path).num_rays += 1u;
    let is_emitter = met.a.w > light.emission_threshold;
    if is_emitter {
        // The balance heuristic of both ways to come by this direction.
        var weight = 1.0;
        if light.light_share > 0.0 {
            let cosine_density = dot(direction, (*path).normal) / PI;
            weight = cosine_density / (cosine_density + light_density(light.light_root, (*path).position, direction));
        }
        (*path).brought += (*path).throughput * met.a.xyz * weight;
    }
    if is_towards_light() {
        return true;
    }
    (*path).throughput *= met.b.xyz;
    if (light.flags & ROULETTE) != 0u {
        let throughput = (*path).throughput;
        let chance = min(max(throughput.x, max(throughput.y, throughput.z)), 1.0);
        if survive >= chance {
            return false;
        }
        (*path).throughput = throughput / chance;
    }
    let next = surface_at((*path).position, direction, met);
    (*path).position = next.position;
    (*path).normal = next.normal;
    (*path).offset = next.offset;
    return next.is_there && !is_emitter && (light.flags & LAST_BOUNCE) == 0u;
}

@compute @workgroup_size(GROUP_SIZE)
fn shade_rays(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = light.start_pixel + invocation_number(workgroup, workgroups, thread);
    if pixel >= light.end_pixel || rays[pixel].is_idle == 1u {
        return;
    }
    var path = paths[pixel];
    if !shade(&path, rays[pixel].direction, ray_features[pixel], numbers_of(pixel).z) {
        path.is_alive = 0u;
        var total = gathered[pixel];
        add_sample(&total, path.brought, path.num_rays);
        gathered[pixel] = total;
    }
    paths[pixel] = path;
}
