// Random directions about a normal; as in sampling.rs, but with the sine and cosine of the device.

const PI = 3.14159265;

// Cosine and sine of 2πb. Drivers are precise for angles from −π to π alone.
fn turn(b: f32) -> vec2f {
    let angle = 2.0 * PI * (b - 0.5);
    return -vec2f(cos(angle), sin(angle));
}

// Tangent, bitangent and the unit `normal` (Duff et al., "Building an Orthonormal Basis,
// Revisited", JCGT 2017).
fn frame_about(normal: vec3f) -> mat3x3f {
    let side = select(-1.0, 1.0, normal.z >= 0.0);
    let c = -1.0 / (side + normal.z);
    let d = normal.x * normal.y * c;
    let tangent = vec3f(1.0 + side * normal.x * normal.x * c, side * d, -side * normal.x);
    let bitangent = vec3f(d, side + normal.y * normal.y * c, -normal.y);
    return mat3x3f(tangent, bitangent, normal);
}

// A direction about the unit `normal` with density cos θ / π, from two uniform numbers in [0, 1).
fn cosine_direction(normal: vec3f, a: f32, b: f32) -> vec3f {
    return normalize(frame_about(normal) * vec3f(sqrt(a) * turn(b), sqrt(1.0 - a)));
}
