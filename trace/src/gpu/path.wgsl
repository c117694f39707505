// Paths from a surface to the emitters: the twin of path.rs.

const BLOCKS = 2u;

// Two rays leave from every vertex, one towards an emitter where that is asked for, then one about the normal, which the path follows. Both go
// through the same code: a kernel has one copy of the search.
const TOWARDS_LIGHT = 0u;
const ABOUT_NORMAL = 1u;

fn gather_sample(total: ptr<function, Gathered>, start: Surface, pixel: u32, sample: u32) {
    let looks_for_light = light.light_share > 0.0;
    var surface = start;
    var throughput = vec3f(1.0);
    var brought = vec3f();
    var num_rays = 0u;
    for (var ray_number = select(1u, 0u, looks_for_light); ray_number < 2u * light.max_bounces; ray_number++) {
        let bounce = ray_number / 2u;
        let kind = ray_number % 2u;
        let numbers = block_of(light.key, pixel, sample, BLOCKS * bounce + 1u - kind);
        var direction = vec3f();
        if kind == TOWARDS_LIGHT {
            if !looks_for_light {
                continue;
            }
            direction = sample_light(surface.position, numbers.x, numbers.y, numbers.z);
        } else {
            direction = cosine_direction(surface.normal, numbers.x, numbers.y);
        }
        let plain = dot(direction, surface.normal) / PI;
        if kind == TOWARDS_LIGHT && plain <= 0.0 {
            continue;
        }
        let met = trace_ray(ray_from(surface, direction));
        num_rays++;
        let is_emitter = met.a.w > light.emission_threshold;
        if is_emitter {
            // The balance heuristic of both ways to come by this direction.
            var weight = 1.0;
            if looks_for_light {
                weight = plain / (plain + light_density(surface.position, direction));
            }
            brought += throughput * met.a.xyz * weight;
        }
        if kind == TOWARDS_LIGHT {
            continue;
        }
        throughput *= met.b.xyz;
        let survives = numbers.z;
        if is_emitter {
            break;
        }
        if bounce + 1u >= light.roulette_from {
            let chance = min(max(throughput.x, max(throughput.y, throughput.z)), 1.0);
            if survives >= chance {
                break;
            }
            throughput /= chance;
        }
        surface = surface_at(surface.position, direction, met);
        if !surface.is_there {
            break;
        }
    }
    add_sample(total, brought, num_rays);
}
