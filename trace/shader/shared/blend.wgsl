// Blending of ordered hits, front to back; the same arithmetic as blend.rs.

#import declarations
#import features

struct Blender {
    features: Lanes,
    transmittance: f32,
}

const SKIPPED = 0u;
const BLENDED = 1u;
const LAST = 2u;

// The attributes of a hit with the lanes that depend on the ray filled in.
fn hit_values(attributes: Lanes, direction: vec3f, t: f32) -> Lanes {
    let normal = vec3f(attributes.b.w, attributes.c.xy);
    let turned = select(normal, -normal, dot(normal, direction) > 0.0);
    return Lanes(
        attributes.a,
        vec4f(attributes.b.xyz, turned.x),
        vec4f(turned.yz, attributes.c.z, t),
        attributes.d,
    );
}

fn accumulate(state: ptr<function, Blender>, t: f32, alpha: f32, attributes: Lanes, direction: vec3f) -> u32 {
    let before = (*state).transmittance;
    let weight = before * alpha;
    if weight < MIN_WEIGHT {
        return SKIPPED;
    }
    if before == 1.0 {
        (*state).features.d.z = t;
    }
    let values = hit_values(attributes, direction, t);
    let behind_first = t - (*state).features.d.z;
    (*state).features.a += weight * values.a;
    (*state).features.b += weight * values.b;
    (*state).features.c += weight * values.c;
    (*state).features.d += weight * vec4f(behind_first * behind_first, values.d.y, 0.0, 0.0);
    let after = before * (1.0 - alpha);
    (*state).transmittance = after;
    return select(BLENDED, LAST, after < MIN_TRANSMITTANCE);
}
