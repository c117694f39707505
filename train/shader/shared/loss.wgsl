// Buffers of the loss, and what its kernels share; see loss/. Pixels are those of the view, row by
// row; each is the mean over its rays.

#import training
#import features

@group(0) @binding(0) var<uniform> loss: LossParameters;
@group(0) @binding(1) var<storage, read> rays: array<Lanes>;
// Mean features of each pixel; spread and first distance have no part in a loss.
@group(0) @binding(2) var<storage, read_write> means: array<Lanes>;
@group(0) @binding(3) var<storage, read> targets: array<TargetPixel>;
@group(0) @binding(4) var<storage, read_write> encoded: array<Encoded>;
// Moments, and later derivatives by them, blurred along x.
@group(0) @binding(5) var<storage, read_write> blurred: array<Moments>;
@group(0) @binding(6) var<storage, read_write> partials: array<Moments>;
@group(0) @binding(7) var<storage, read_write> terms: array<Terms>;
// Channels of pixels whose light is a lower bound, red in the lowest bit.
@group(0) @binding(12) var<storage, read> clipped: array<u32>;
// Of stage 1: the irradiance of each pixel, or with 1 beside it the light of an emitter.
@group(0) @binding(11) var<storage, read> lit: array<vec4f>;

// PQ values and their slopes.
struct Encoded {
    pq: vec3f,
    slope: vec3f,
}

// Of the three colours: mean of the target, mean of what is shown, mean of the sum of their
// squares, mean of their product.
struct Moments {
    of_target: vec3f,
    of_shown: vec3f,
    of_squares: vec3f,
    of_product: vec3f,
}

// Contributions of a pixel to features.
struct Terms {
    // |difference| of PQ values, SSIM, |E − M|, |A − A_gt|
    image: vec4f,
    // 1 − Ñ·N and its pixels, 1 − Ñ_d·N and its pixels
    surface: vec4f,
    // |D̃ − d| / d
    depth: f32,
}

// Derivatives of one pixel's term of spanned normals by the differences of points across and down,
// and by its N.
struct SurfaceGradient {
    d_across: vec3f,
    d_down: vec3f,
    d_normal: vec3f,
}

fn has_flag(pixel: u32, flag: u32) -> bool {
    return ((targets[pixel].normal_z_flags >> 16u) & flag) != 0u;
}

fn is_known(pixel: u32) -> bool {
    return has_flag(pixel, KNOWN);
}

// Rays along each axis of a pixel, the first of its places on their grid.
fn rays_per_axis(pixel: u32) -> u32 {
    return select(1u, loss.rays_per_axis, has_flag(pixel, EDGE));
}

fn opacity_of_target(pixel: u32) -> f32 {
    return f32(targets[pixel].normal_z_flags >> (16u + FLAG_BITS)) / f32(FULL_OPACITY);
}

fn pq_of_target(pixel: u32) -> vec3f {
    let blue = unpack2x16unorm(targets[pixel].blue_emission).x;
    return PQ_RANGE * vec3f(unpack2x16unorm(targets[pixel].red_green), blue);
}

fn emission_of_target(pixel: u32) -> f32 {
    return unpack2x16unorm(targets[pixel].blue_emission).y;
}

// Zero where there is none.
fn normal_of_target(pixel: u32) -> vec3f {
    let z = unpack2x16snorm(targets[pixel].normal_z_flags).x;
    return vec3f(unpack2x16snorm(targets[pixel].normal_xy), z);
}

// Relative error of the mean distance, and 0 where it tells nothing: of pixels without a point, of
// transparent ones.
fn depth_error(pixel: u32) -> f32 {
    let wanted = targets[pixel].distance;
    if wanted == 0.0 || alpha_of_features(means[pixel]) <= MIN_DEPTH_ALPHA {
        return 0.0;
    }
    return (mean_distance(means[pixel]) - wanted) / wanted;
}

fn normal_of(features: Lanes) -> vec3f {
    return vec3f(features.b.w, features.c.xy);
}

fn alpha_of_features(features: Lanes) -> f32 {
    return features.c.z;
}

fn mean_distance(features: Lanes) -> f32 {
    return select(0.0, features.c.w / features.c.z, features.c.z > 0.0);
}

// Of the middle of a pixel.
fn direction_of(pixel: u32) -> vec3f {
    let x = f32(pixel % loss.width) + 0.5;
    let y = f32(pixel / loss.width) + 0.5;
    return normalize(loss.base + loss.step_x * x + loss.step_y * y);
}

// Value and derivative by n of 1 − (n/|n|)·m, m of unit length.
fn one_minus_cosine(n: vec3f, m: vec3f) -> vec4f {
    let norm = length(n);
    let unit = n / norm;
    let cosine = dot(unit, m);
    return vec4f((unit * cosine - m) / norm, 1.0 - cosine);
}

// Moments blurred along x, blurred along y as well.
fn window_of(pixel: u32) -> Moments {
    let x = pixel % loss.width;
    let row = i32(pixel / loss.width);
    var weights = BLUR_WEIGHTS;
    var sum = Moments();
    for (var offset = -BLUR_RADIUS; offset <= BLUR_RADIUS; offset++) {
        let y = row + offset;
        if y >= 0 && y < i32(loss.height) {
            let other = blurred[u32(y) * loss.width + x];
            let weight = weights[abs(offset)];
            sum = Moments(
                sum.of_target + weight * other.of_target,
                sum.of_shown + weight * other.of_shown,
                sum.of_squares + weight * other.of_squares,
                sum.of_product + weight * other.of_product,
            );
        }
    }
    return sum;
}
