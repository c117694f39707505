// Reflection by the surfaces of paths: of light from everywhere, evenly.

#import declarations
#import features
#import sampling

fn begin_at(path: ptr<function, PathState>, pixel: u32) {}

// Number that the light of a path is divided by.
fn sample_divisor(path: PathState) -> vec3f {
    return vec3f(1.0);
}

// A direction from which light is reflected; below the surface if there is none.
fn reflected_direction(path: ptr<function, PathState>, numbers: vec4f) -> vec3f {
    return cosine_direction((*path).normal, numbers.x, numbers.y);
}

// The number that decides whether a path goes on, of those of its bounce.
fn number_of_survival(numbers: vec4f) -> f32 {
    return numbers.z;
}

// f · cos θ for light from a direction, and the density of that. The albedo is in the throughput.
fn reflected_from(path: PathState, direction: vec3f) -> vec4f {
    return vec4f(dot(direction, path.normal) / PI);
}

// Comes to the surface that a ray has met. Returns its reflectance that is not in the throughput.
fn come_to(path: ptr<function, PathState>, pixel: u32, direction: vec3f, met: Lanes) -> vec3f {
    (*path).throughput *= met.b.xyz;
    return vec3f(1.0);
}
