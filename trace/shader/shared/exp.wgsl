// The exponential in basic arithmetic: the same on every device.

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
