// Blending of ordered hits: the twin of blend.rs.

// Sixteen lanes in the order of sums.rs: radiance and emission; albedo and normal x; normal y and z, opacity, distance;
// spread, size, first distance, nothing.
struct Lanes {
    a: vec4f,
    b: vec4f,
    c: vec4f,
    d: vec4f,
}

const NO_LANES = Lanes(vec4f(), vec4f(), vec4f(), vec4f());

struct Blender {
    sums: Lanes,
    transmittance: f32,
}

const SKIPPED = 0u;
const BLENDED = 1u;
const LAST = 2u;

// The payload of a hit with the lanes that depend on the ray filled in.
fn hit_values(payload: Lanes, direction: vec3f, t: f32) -> Lanes {
    let normal = vec3f(payload.b.w, payload.c.xy);
    let turned = select(normal, -normal, dot(normal, direction) > 0.0);
    return Lanes(
        payload.a,
        vec4f(payload.b.xyz, turned.x),
        vec4f(turned.yz, payload.c.z, t),
        payload.d,
    );
}

fn offer(state: ptr<function, Blender>, t: f32, alpha: f32, payload: Lanes, direction: vec3f) -> u32 {
    let before = (*state).transmittance;
    let weight = before * alpha;
    if weight < MIN_WEIGHT {
        return SKIPPED;
    }
    if before == 1.0 {
        (*state).sums.d.z = t;
    }
    let values = hit_values(payload, direction, t);
    let behind_first = t - (*state).sums.d.z;
    (*state).sums.a += weight * values.a;
    (*state).sums.b += weight * values.b;
    (*state).sums.c += weight * values.c;
    (*state).sums.d += weight * vec4f(behind_first * behind_first, values.d.y, 0.0, 0.0);
    let after = before * (1.0 - alpha);
    (*state).transmittance = after;
    return select(BLENDED, LAST, after < MIN_TRANSMITTANCE);
}
