// Radiance that differs with the direction: the functions of `eagpt_scene::harmonics`.

#import declarations

// In the direction from `eye` to `position`; all zero where these are one point.
fn harmonic_functions(eye: vec3f, position: vec3f) -> array<f32, NUM_FUNCTIONS> {
    let offset = position - eye;
    let distance = length(offset);
    var d = vec3f();
    if distance > 0.0 {
        d = offset / distance;
    }
    return array<f32, NUM_FUNCTIONS>(
        -HARMONIC_LINEAR * d.y,
        HARMONIC_LINEAR * d.z,
        -HARMONIC_LINEAR * d.x,
        HARMONIC_PRODUCT * (d.x * d.y),
        -HARMONIC_PRODUCT * (d.y * d.z),
        HARMONIC_ZONAL * (2.0 * d.z * d.z - d.x * d.x - d.y * d.y),
        -HARMONIC_PRODUCT * (d.x * d.z),
        HARMONIC_DIFFERENCE * (d.x * d.x - d.y * d.y),
    );
}
