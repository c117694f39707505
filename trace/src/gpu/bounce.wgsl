// One bounce into the scene's own radiance: the twin of `bounced` in transport/mod.rs and of `BounceSampler`.

fn gather_sample(total: ptr<function, Gathered>, surface: Surface, pixel: u32, sample: u32) {
    let numbers = block_of(light.key, pixel, sample, 0u);
    var direction = vec3f();
    if numbers.w < light.light_share {
        direction = sample_light(surface.position, numbers.z, numbers.x, numbers.y);
    } else {
        direction = cosine_direction(surface.normal, numbers.x, numbers.y);
    }
    var brought = vec3f();
    let plain = dot(direction, surface.normal) / PI;
    if plain > 0.0 {
        var weight = 1.0;
        if light.light_share > 0.0 {
            let towards = light_density(surface.position, direction);
            weight = plain / ((1.0 - light.light_share) * plain + light.light_share * towards);
        }
        let hit = sample_hit(ray_from(surface, direction), word_of(light.key, pixel, sample));
        if hit != NO_NODE {
            brought = payloads[hit].a.xyz * weight;
        }
    }
    add_sample(total, brought, 1u);
}
