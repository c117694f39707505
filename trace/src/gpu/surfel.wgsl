// Gaussians as a ray from a fixed origin meets them: the twin of surfel.rs, with the same order of
// operations. `Surfel`, `Seen` and the constants in capitals come from Rust.

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

// Compilers may assume that no number is a NaN: the cosine is looked at first.
fn counts(seen: Seen, hit: PlaneHit) -> bool {
    if abs(hit.cosine) <= MIN_COSINE {
        return false;
    }
    return hit.u * hit.u + hit.v * hit.v <= seen.cut2 && hit.t > 0.0;
}

// exp(x) for −80 ≤ x ≤ 0, as on the CPU: what drivers accumulate differs by up to 3 + 2|x| units in
// the last place.
fn exp_of_negative(x: f32) -> f32 {
    let n = round(x * 1.44269504);
    let r = (x - n * 0.693359375) - n * -2.12194442e-4;
    var p = 1.0 / 5040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    return p * bitcast<f32>(u32(i32(n) + 127) << 23u);
}

fn alpha_of(seen: Seen, hit: PlaneHit) -> f32 {
    return seen.opacity * exp_of_negative(-0.5 * (hit.u * hit.u + hit.v * hit.v));
}
