// Where a bounce starts, from the features of the ray that comes to it; see start.rs.

#import declarations
#import features
#import bvh

struct Surface {
    is_there: bool,
    position: vec3f,
    // Unit length, turned to where the ray came from.
    normal: vec3f,
    // Height above the tangent plane up to which hits belong to the surface itself.
    offset: f32,
}

fn normal_of(met: Lanes) -> vec3f {
    return vec3f(met.b.w, met.c.xy);
}

fn surface_at(origin: vec3f, direction: vec3f, met: Lanes) -> Surface {
    let length2 = dot(normal_of(met), normal_of(met));
    let alpha = met.c.z;
    if alpha < START_MIN_ALPHA || length2 < 1e-30 {
        return Surface(false, vec3f(), vec3f(), 0.0);
    }
    let normal = normal_of(met) * inverseSqrt(length2);
    let mean_distance = met.c.w / alpha;
    // Moments about the first hit, not about zero: with the latter the digits cancel for distant
    // surfaces.
    let difference = mean_distance - met.d.z;
    let deviation = sqrt(max(met.d.x / alpha - difference * difference, 0.0));
    let size = met.d.y / alpha;
    let spread = deviation * abs(dot(direction, normal));
    let offset = clamp(OFFSET_DEVIATIONS * spread, MIN_OFFSET_SIZES * size, MAX_OFFSET_SIZES * size);
    return Surface(true, origin + direction * mean_distance, normal, offset);
}

// The ray that leaves in unit `direction`.
fn ray_from(surface: Surface, direction: vec3f) -> Ray {
    let slant = min(1.0 / max(dot(direction, surface.normal), 1e-30), MAX_SLANT);
    return Ray(surface.position, direction, surface.offset * slant, surface.normal);
}
