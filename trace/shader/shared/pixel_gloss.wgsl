// Glossy surfaces of pixels, and what is sampled of them.

#import declarations
#import surface
#import bsdf
#import integrator

// Of the camera rays: F0 and the roughness.
@group(0) @binding(12) var<storage, read> pixel_glosses: array<vec4f>;

// See `Start` of vertex.rs.
struct GlossyStart {
    is_glossy: bool,
    // Diffuse albedo; white where nothing is mirrored.
    albedo: vec3f,
    gloss: vec4f,
    bsdf: Bsdf,
    // Number that the light of a sample is divided by.
    divisor: vec3f,
}

// Whether the light that surfaces scatter is known, and what they mirror is all that is sampled.
fn is_gather() -> bool {
    return (light.flags & GATHER) != 0u;
}

fn glossy_start(pixel: u32, surface: Surface) -> GlossyStart {
    let gloss = pixel_glosses[pixel];
    let is_glossy = max(gloss.x, max(gloss.y, gloss.z)) > 0.0;
    var albedo = vec3f(1.0);
    if is_glossy {
        albedo = select(features[pixel].b.xyz / features[pixel].c.z, vec3f(), is_gather());
    }
    let bsdf = bsdf_of(surface.normal, -direction_of(pixel), albedo, gloss);
    let divisor = select(vec3f(1.0), max(bsdf.albedo, vec3f(MIN_REFLECTANCE)), is_glossy);
    return GlossyStart(is_glossy, albedo, gloss, bsdf, divisor);
}
