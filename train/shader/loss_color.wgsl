// PQ encoding, and SSIM with its derivatives by the moments; see loss/color.rs and
// eval/src/ssim.rs.

#import training
#import workgroup
#import features
#import exp_ln
#import loss

// PQ and its slope. The ratio (C1 + C2 p)/(1 + C3 p) is 1 − x with x = (C3 − C2)(p − 1)/(1 + C3 p)
// between −0.1 and 0.17, whose logarithm keeps all its digits: the exponent that follows is 79.
fn pq_with_slope(linear: f32) -> vec2f {
    let scaled = linear * PQ_SCALE;
    let is_clamped = !(scaled > PQ_FLOOR);
    let y = select(scaled, PQ_FLOOR, is_clamped);
    let power = exp_of(PQ_M1 * ln_of(y));
    let denominator = 1.0 + PQ_C3 * power;
    let x = (PQ_C2 - PQ_C3) * (1.0 - power) / denominator;
    let s = x / (2.0 - x);
    let s2 = s * s;
    let log_ratio = -2.0 * (s + s * s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0)))));
    let value = exp_of(PQ_M2 * log_ratio);
    let d_power = PQ_M1 * power / y;
    let d_ratio = (PQ_C2 - PQ_C3 * PQ_C1) / (denominator * denominator) * d_power;
    let slope = PQ_M2 * value / (1.0 - x) * d_ratio * PQ_SCALE;
    return vec2f(value, select(slope, 0.0, is_clamped));
}

fn encoded_as_pq(linear: vec3f) -> Encoded {
    let r = pq_with_slope(linear.x);
    let g = pq_with_slope(linear.y);
    let b = pq_with_slope(linear.z);
    return Encoded(vec3f(r.x, g.x, b.x), vec3f(r.y, g.y, b.y));
}

fn mean_of_rays(pixel: u32) -> Lanes {
    let n = rays_per_axis(pixel);
    let first = vec2u(pixel % loss.width, pixel / loss.width) * loss.rays_per_axis;
    var sum = NO_LANES;
    for (var y = 0u; y < n; y++) {
        for (var x = 0u; x < n; x++) {
            let ray = rays[(first.y + y) * loss.width * loss.rays_per_axis + first.x + x];
            sum = Lanes(sum.a + ray.a, sum.b + ray.b, sum.c + ray.c, vec4f());
        }
    }
    let num = f32(n * n);
    return Lanes(sum.a / num, sum.b / num, sum.c / num, vec4f());
}

@compute @workgroup_size(GROUP_SIZE)
fn encode(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    let features = mean_of_rays(pixel);
    means[pixel] = features;
    encoded[pixel] = encoded_as_pq(features.a.xyz);
}

// Of stage 1: what albedos make of the light.
@compute @workgroup_size(GROUP_SIZE)
fn encode_lit(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    let features = mean_of_rays(pixel);
    means[pixel] = features;
    let light = lit[pixel];
    encoded[pixel] = encoded_as_pq(select(features.b.xyz * light.xyz, light.xyz, light.w > 0.0));
}

// A colour above the target's lower bound has no error.
@compute @workgroup_size(GROUP_SIZE)
fn clip(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    let bounded = (vec3u(clipped[pixel]) & vec3u(1u, 2u, 4u)) != vec3u();
    let shown = encoded[pixel];
    let bound = pq_of_target(pixel);
    let is_beyond = bounded & (shown.pq > bound);
    encoded[pixel] = Encoded(select(shown.pq, bound, is_beyond), select(shown.slope, vec3f(), is_beyond));
}

fn add_moments(sum: Moments, weight: f32, x: i32, row: u32) -> Moments {
    if x < 0 || x >= i32(loss.width) {
        return sum;
    }
    let pixel = row * loss.width + u32(x);
    let a = pq_of_target(pixel);
    let b = encoded[pixel].pq;
    return Moments(
        sum.of_target + weight * a,
        sum.of_shown + weight * b,
        sum.of_squares + weight * (a * a + b * b),
        sum.of_product + weight * (a * b),
    );
}

@compute @workgroup_size(GROUP_SIZE)
fn blur_moments(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    let x = i32(pixel % loss.width);
    let row = pixel / loss.width;
    var weights = BLUR_WEIGHTS;
    var sum = Moments();
    for (var offset = -BLUR_RADIUS; offset <= BLUR_RADIUS; offset++) {
        sum = add_moments(sum, weights[abs(offset)], x + offset, row);
    }
    blurred[pixel] = sum;
}

@compute @workgroup_size(GROUP_SIZE)
fn compare(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    var similarity = 0.0;
    var d_moments = Moments();
    if has_flag(pixel, WINDOW) {
        let m = window_of(pixel);
        let product = m.of_target * m.of_shown;
        let squares = m.of_target * m.of_target + m.of_shown * m.of_shown;
        let numerator_mean = 2.0 * product + SSIM_C1;
        let numerator_structure = 2.0 * (m.of_product - product) + SSIM_C2;
        let inverse_mean = 1.0 / (squares + SSIM_C1);
        let inverse_structure = 1.0 / (m.of_squares - squares + SSIM_C2);
        let inverse = inverse_mean * inverse_structure;
        let value = numerator_mean * numerator_structure * inverse;
        similarity = value.x + value.y + value.z;
        d_moments = Moments(
            vec3f(),
            2.0 * m.of_target * (numerator_structure - numerator_mean) * inverse
                + 2.0 * m.of_shown * value * (inverse_structure - inverse_mean),
            -value * inverse_structure,
            2.0 * numerator_mean * inverse,
        );
    }
    partials[pixel] = d_moments;
    var image = vec4f(0.0, similarity, 0.0, 0.0);
    var depth = 0.0;
    if is_known(pixel) {
        let difference = abs(encoded[pixel].pq - pq_of_target(pixel));
        image.x = difference.x + difference.y + difference.z;
        image.z = select(0.0, abs(means[pixel].a.w - emission_of_target(pixel)), loss.has_emission != 0u);
        image.w = abs(alpha_of_features(means[pixel]) - opacity_of_target(pixel));
        depth = min(abs(depth_error(pixel)), MAX_DEPTH_ERROR);
    }
    terms[pixel].image = image;
    terms[pixel].depth = depth;
}

@compute @workgroup_size(GROUP_SIZE)
fn blur_partials(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    let x = i32(pixel % loss.width);
    let start = pixel - u32(x);
    var weights = BLUR_WEIGHTS;
    var sum = Moments();
    for (var offset = -BLUR_RADIUS; offset <= BLUR_RADIUS; offset++) {
        let at = x + offset;
        if at >= 0 && at < i32(loss.width) {
            let other = partials[start + u32(at)];
            let weight = weights[abs(offset)];
            sum.of_shown += weight * other.of_shown;
            sum.of_squares += weight * other.of_squares;
            sum.of_product += weight * other.of_product;
        }
    }
    blurred[pixel] = sum;
}
