// Reflection by the surfaces of paths: a lobe over a diffuse part.

#import declarations
#import features
#import integrator
#import random
#import bsdf
#import pixel_gloss

@group(0) @binding(14) var<storage, read> ray_glosses: array<vec4f>;

fn bsdf_at(path: PathState) -> Bsdf {
    return bsdf_of(path.normal, path.to_eye, path.albedo, path.gloss);
}

fn begin_at(path: ptr<function, PathState>, pixel: u32) {
    let surface = Surface((*path).is_alive == 1u, (*path).position, (*path).normal, (*path).offset);
    let start = glossy_start(pixel, surface);
    (*path).to_eye = -direction_of(pixel);
    (*path).albedo = start.albedo;
    (*path).gloss = start.gloss;
    (*path).divisor = start.divisor;
}

// Number that the light of a path is divided by.
fn sample_divisor(path: PathState) -> vec3f {
    return path.divisor;
}

// A direction from which light is reflected; below the surface if there is none.
fn reflected_direction(path: ptr<function, PathState>, numbers: vec4f) -> vec3f {
    let bsdf = bsdf_at(*path);
    if numbers.z >= bsdf.specular_share {
        (*path).min_roughness = ROUGH_BEHIND;
    }
    return sample_bsdf(bsdf, numbers.z, numbers.x, numbers.y);
}

// The number that decides whether a path goes on, of those of its bounce, which all have another
// use: hashed from the one that chooses the hit.
fn number_of_survival(numbers: vec4f) -> f32 {
    let word = stream_words(light.key, bitcast<u32>(numbers.w), light.bounce).x;
    return f32(word >> 8u) * (1.0 / 16777216.0);
}

// f · cos θ for light from a direction, and the density of that.
fn reflected_from(path: PathState, direction: vec3f) -> vec4f {
    return evaluate_bsdf(bsdf_at(path), direction);
}

// Comes to the surface that a ray has met. Returns its reflectance that is not in the throughput.
fn come_to(path: ptr<function, PathState>, pixel: u32, direction: vec3f, met: Lanes) -> vec3f {
    let gloss = ray_glosses[pixel];
    let alpha = met.c.z;
    (*path).to_eye = -direction;
    (*path).albedo = met.b.xyz / alpha;
    (*path).gloss = vec4f(gloss.xyz, max(gloss.w, (*path).min_roughness));
    (*path).throughput *= alpha;
    return min((*path).albedo + gloss.xyz, vec3f(1.0));
}
