// Paths from a surface to the emitters, one ray of one bounce of one sample at a time; the CPU
// (path.rs) follows a path to its end instead.
//
// Two rays leave from every vertex: one towards an emitter, where that is asked for, then one that
// is sampled from what the surface reflects, which the path follows. Each is aimed, traced
// (rays.wgsl) and shaded by a kernel of its own: small kernels keep more rays under way, and one
// kernel for all of it takes the compilers of some drivers minutes. What surfaces reflect is in
// path_diffuse.wgsl, or in path_glossy.wgsl for scenes with gloss.

#import declarations
#import workgroup
#import features
#import points
#import sampling
#import surface
#import lights
#import integrator
#ifdef gloss
#import path_glossy
#else
#import path_diffuse
#endif

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

fn end_path(path: ptr<function, PathState>, pixel: u32) {
    (*path).is_alive = 0u;
    var total = gathered[pixel];
    add_sample(&total, (*path).brought / sample_divisor(*path), (*path).num_rays);
    gathered[pixel] = total;
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
        var path = PathState();
        path.position = start.position;
        path.offset = start.offset;
        path.normal = start.normal;
        path.throughput = vec3f(1.0);
        path.is_alive = u32(start.is_there);
        begin_at(&path, pixel);
        paths[pixel] = path;
        if light.first_sample == 0u {
            gathered[pixel] = NOTHING_GATHERED;
        }
    }
    var path = paths[pixel];
    if path.is_alive == 0u {
        rays[pixel].is_idle = 1u;
        return;
    }
    let numbers = numbers_of(pixel);
    var direction = vec3f();
    if is_towards_light() {
        direction = sample_light(light.num_emitters, path.position, numbers.x, numbers.y, numbers.z);
    } else {
        direction = reflected_direction(&path, numbers);
    }
    let is_below = dot(direction, path.normal) <= 0.0;
    if !is_towards_light() {
        if is_below {
            end_path(&path, pixel);
        }
        paths[pixel] = path;
    }
    let ray = ray_from(Surface(true, path.position, path.normal, path.offset), direction);
    let choice = bitcast<u32>(numbers.w);
    rays[pixel] = RayQuery(ray.origin, ray.t_min, direction, choice, ray.own_normal, u32(is_below));
}

// Adds what a ray has met to its path; returns whether the path goes on.
fn shade(path: ptr<function, PathState>, pixel: u32, direction: vec3f, met: Lanes) -> bool {
    (*path).num_rays += 1u;
    let reflected = reflected_from(*path, direction);
    if reflected.w <= 0.0 {
        return is_towards_light();
    }
    let is_emitter = met.a.w > light.emission_threshold;
    if is_emitter {
        // The balance heuristic of both ways to come by this direction.
        var density = reflected.w;
        if light.light_share > 0.0 {
            density += light_density(light.light_root, (*path).position, direction);
        }
        (*path).brought += (*path).throughput * met.a.xyz * reflected.xyz / density;
    }
    if is_towards_light() {
        return true;
    }
    (*path).throughput *= reflected.xyz / reflected.w;
    let next = surface_at((*path).position, direction, met);
    if !next.is_there || is_emitter || (light.flags & LAST_BOUNCE) != 0u {
        return false;
    }
    let reflectance = come_to(path, pixel, direction, met);
    if (light.flags & ROULETTE) != 0u {
        let worth = (*path).throughput * reflectance;
        let chance = min(max(worth.x, max(worth.y, worth.z)), 1.0);
        if number_of_survival(numbers_of(pixel)) >= chance {
            return false;
        }
        (*path).throughput /= chance;
    }
    (*path).position = next.position;
    (*path).normal = next.normal;
    (*path).offset = next.offset;
    return true;
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
    if !shade(&path, pixel, rays[pixel].direction, ray_features[pixel]) {
        end_path(&path, pixel);
    }
    paths[pixel] = path;
}
