// Composited features, attributes and gradients are all sixteen numbers.

// Sixteen lanes in the order of features.rs: radiance and emission; albedo and normal x; normal y
// and z, opacity, distance; spread, size, first distance, nothing.
struct Lanes {
    a: vec4f,
    b: vec4f,
    c: vec4f,
    d: vec4f,
}

const NO_LANES = Lanes(vec4f(), vec4f(), vec4f(), vec4f());
