// Paths from a surface to the emitters, one bounce of one sample at a time: the twin of path.rs.

// Continues light.wgsl.
@group(0) @binding(9) var<storage, read_write> paths: array<PathState>;

// Blocks of numbers that a bounce draws: one for the bounce, one for the light.
const BLOCKS = 2u;

// Two rays leave from every vertex, one towards an emitter where that is asked for, then one about the normal, which the path follows. Both go
// through the same code: a kernel has one copy of the search.
const TOWARDS_LIGHT = 0u;
const ABOUT_NORMAL = 1u;

// Whether the path goes on.
fn extend(path: ptr<function, PathState>, pixel: u32) -> bool {
    let looks_for_light = light.light_share > 0.0;
    let surface = Surface(true, (*path).position, (*path).normal, (*path).slab);
    for (var kind = select(ABOUT_NORMAL, TOWARDS_LIGHT, looks_for_light); kind <= ABOUT_NORMAL; kind++) {
        let block = BLOCKS * light.bounce + ABOUT_NORMAL - kind;
        let numbers = block_of(light.key, pixel, light.first_sample, block);
        var direction = cosine_direction(surface.normal, numbers.x, numbers.y);
        if kind == TOWARDS_LIGHT {
            direction = sample_light(surface.position, numbers.x, numbers.y, numbers.z);
        }
        let plain = dot(direction, surface.normal) / PI;
        if kind == TOWARDS_LIGHT && plain <= 0.0 {
            continue;
        }
        let met = trace_ray(ray_from(surface, direction));
        (*path).num_rays += 1u;
        let is_emitter = met.a.w > light.emission_threshold;
        if is_emitter {
            // The balance heuristic of both ways to come by this direction.
            var weight = 1.0;
            if looks_for_light {
                weight = plain / (plain + light_density(surface.position, direction));
            }
            (*path).brought += (*path).throughput * met.a.xyz * weight;
        }
        if kind == TOWARDS_LIGHT {
            continue;
        }
        (*path).throughput *= met.b.xyz;
        if (light.flags & ROULETTE) != 0u {
            let throughput = (*path).throughput;
            let chance = min(max(throughput.x, max(throughput.y, throughput.z)), 1.0);
            if numbers.z >= chance {
                return false;
            }
            (*path).throughput = throughput / chance;
        }
        let next = surface_at(surface.position, direction, met);
        (*path).position = next.position;
        (*path).normal = next.normal;
        (*path).slab = next.slab;
        return next.is_there && !is_emitter;
    }
    return false;
}

@compute @workgroup_size(64)
fn extend_paths(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = light.start_pixel + group_number(workgroup, workgroups) * 64u + thread;
    if pixel >= light.end_pixel {
        return;
    }
    var path = paths[pixel];
    if light.bounce == 0u {
        let surface = surface_of(pixel);
        path = PathState(surface.position, surface.slab, surface.normal, 0u, vec3f(1.0), u32(surface.is_there), vec3f(), 0u);
        if light.first_sample == 0u {
            gathered[pixel] = NOTHING_GATHERED;
        }
    }
    if path.is_alive == 1u {
        let goes_on = extend(&path, light.first_pixel + pixel) && (light.flags & LAST_BOUNCE) == 0u;
        path.is_alive = u32(goes_on);
        if !goes_on {
            var total = gathered[pixel];
            add_sample(&total, path.brought, path.num_rays);
            gathered[pixel] = total;
        }
    }
    paths[pixel] = path;
}
