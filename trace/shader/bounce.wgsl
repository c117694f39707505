// One bounce into the radiance that Gaussians carry, as `sampled` in integrate.rs. A dispatch takes
// a few samples of many pixels, where the CPU takes all samples of one.

#import declarations
#import workgroup
#import ray_search
#import points
#import sampling
#import surface
#import lights
#import integrator
#ifdef gloss
#import pixel_gloss
#endif

fn gather_sample(total: ptr<function, Gathered>, surface: Surface, pixel: u32, sample: u32) {
    let numbers = block_of(light.key, pixel, sample, 0u);
    var direction = vec3f();
    if numbers.w < light.light_share {
        direction = sample_light(light.num_emitters, surface.position, numbers.z, numbers.x, numbers.y);
    } else {
        direction = cosine_direction(surface.normal, numbers.x, numbers.y);
    }
    var brought = vec3f();
    let cosine_density = dot(direction, surface.normal) / PI;
    if cosine_density > 0.0 {
        var weight = 1.0;
        if light.light_share > 0.0 {
            let towards = light_density(light.light_root, surface.position, direction);
            weight = cosine_density / ((1.0 - light.light_share) * cosine_density + light.light_share * towards);
        }
        let hit = sample_hit(light.scene_root, ray_from(surface, direction), word_of(light.key, pixel, sample));
        if hit != NO_NODE {
            brought = attributes[hit].a.xyz * weight;
        }
    }
    add_sample(total, brought, 1u);
}

#ifdef gloss
fn gather_glossy_sample(total: ptr<function, Gathered>, start: GlossyStart, surface: Surface, pixel: u32, sample: u32) {
    let numbers = block_of(light.key, pixel, sample, 0u);
    let share = light.light_share;
    var direction = vec3f();
    if numbers.z < share {
        direction = sample_light(light.num_emitters, surface.position, numbers.z / share, numbers.x, numbers.y);
    } else {
        direction = sample_bsdf(start.bsdf, numbers.w, numbers.x, numbers.y);
    }
    var brought = vec3f();
    let reflected = evaluate_bsdf(start.bsdf, direction);
    if reflected.w > 0.0 {
        var density = reflected.w;
        if share > 0.0 {
            density = (1.0 - share) * density + share * light_density(light.light_root, surface.position, direction);
        }
        let hit = sample_hit(light.scene_root, ray_from(surface, direction), word_of(light.key, pixel, sample));
        if hit != NO_NODE {
            brought = attributes[hit].a.xyz * reflected.xyz / (density * start.divisor);
        }
    }
    add_sample(total, brought, 1u);
}
#endif

@compute @workgroup_size(GROUP_SIZE)
fn gather_bounces(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = light.start_pixel + invocation_number(workgroup, workgroups, thread);
    if pixel >= light.end_pixel {
        return;
    }
    let surface = surface_of(pixel);
    var total = gathered[pixel];
    if light.first_sample == 0u {
        total = NOTHING_GATHERED;
    }
    if surface.is_there {
#ifdef gloss
        let start = glossy_start(pixel, surface);
#endif
        for (var sample = light.first_sample; sample < light.end_sample; sample++) {
#ifdef gloss
            if start.is_glossy {
                gather_glossy_sample(&total, start, surface, light.first_pixel + pixel, sample);
                continue;
            }
            if is_gather() {
                break;
            }
#endif
            gather_sample(&total, surface, light.first_pixel + pixel, sample);
        }
    }
    gathered[pixel] = total;
}
