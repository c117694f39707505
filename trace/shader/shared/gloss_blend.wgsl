// Gloss of single rays: F0 is blended by the weights of hits, roughness by what they mirror; see
// GlossBlend in blend.rs.

// Of each Gaussian: F0 and the roughness.
@group(0) @binding(8) var<storage, read> glosses: array<vec4f>;

struct GlossBlend {
    specular: vec3f,
    // Sums of F0's largest channel, and of that times the roughness.
    largest: f32,
    roughness: f32,
}

// Of the ray that was traced last.
var<private> blended_gloss: GlossBlend;

fn add_gloss(weight: f32, index: u32) {
    let gloss = glosses[index];
    let largest = weight * max(gloss.x, max(gloss.y, gloss.z));
    blended_gloss.specular += weight * gloss.xyz;
    blended_gloss.largest += largest;
    blended_gloss.roughness += largest * gloss.w;
}

// That of hits whose weights add up to `alpha`.
fn finished_gloss(alpha: f32) -> vec4f {
    if blended_gloss.largest <= 0.0 || alpha <= 0.0 {
        return vec4f();
    }
    let specular = min(blended_gloss.specular / alpha, vec3f(1.0));
    return vec4f(specular, min(blended_gloss.roughness / blended_gloss.largest, 1.0));
}
