// Functions that drivers may round in their own way, in basic arithmetic: the same on every device.

#import exp

// exp(x), for −80 ≤ x ≤ 80 and clamped to there.
fn exp_of(x: f32) -> f32 {
    return exp_of_negative(clamp(x, -80.0, 80.0));
}

// ln(x) of a positive normal number.
fn ln_of(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    var exponent = i32(bits >> 23u) - 127;
    var mantissa = bitcast<f32>((bits & 0x7fffffu) | 0x3f800000u);
    if mantissa > 1.41421356 {
        mantissa *= 0.5;
        exponent += 1;
    }
    // ln m = 2 artanh((m − 1)/(m + 1)); |s| ≤ 0.172, the next term of the series is below 1e-9.
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let s2 = s * s;
    let series = s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0))));
    let e = f32(exponent);
    return e * 0.693359375 + (e * -2.12194442e-4 + 2.0 * (s + s * series));
}
