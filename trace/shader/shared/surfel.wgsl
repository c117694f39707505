// Hits of rays with Gaussians, relative to the origin of the rays: the formulas of surfel.rs in the
// same order of operations. Divisions and square roots of devices round otherwise.

#import declarations
#import exp

struct PlaneHit {
    t: f32,
    // ω·n, not turned.
    cosine: f32,
    // In-plane coordinates in standard deviations.
    u: f32,
    v: f32,
}

fn seen_from(surfel: Surfel, origin: vec3f) -> Seen {
    let offset = surfel.position - origin;
    return Seen(
        surfel.normal,
        dot(offset, surfel.normal),
        surfel.axis_u,
        dot(offset, surfel.axis_u),
        surfel.axis_v,
        dot(offset, surfel.axis_v),
        surfel.cut2,
        surfel.opacity,
        0.0,
        0.0,
    );
}

fn meet(seen: Seen, direction: vec3f) -> PlaneHit {
    let cosine = dot(direction, seen.normal);
    let t = seen.plane / cosine;
    return PlaneHit(
        t,
        cosine,
        dot(direction, seen.axis_u) * t - seen.offset_u,
        dot(direction, seen.axis_v) * t - seen.offset_v,
    );
}

// Compilers may assume that no number is a NaN: the cosine is tested first.
fn counts(seen: Seen, hit: PlaneHit) -> bool {
    if abs(hit.cosine) <= MIN_COSINE {
        return false;
    }
    return hit.u * hit.u + hit.v * hit.v <= seen.cut2 && hit.t > 0.0;
}

fn alpha_of(seen: Seen, hit: PlaneHit) -> f32 {
    return seen.opacity * exp_of_negative(-0.5 * (hit.u * hit.u + hit.v * hit.v));
}
