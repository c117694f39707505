// Rows of the adjoint that are gradients, as in blend.rs, four vectors: position and first scale;
// second scale and rotation; opacity and radiance; emission and albedo.

#import declarations
#import features
#import surfel
#import view
#import band

@group(0) @binding(10) var<storage, read> seen_surfels: array<Seen>;
@group(0) @binding(11) var<storage, read> d_features: array<Lanes>;

alias Row = Lanes;

// A row, and what its Gaussian looks like.
struct Adder {
    sum: Row,
    seen: Seen,
    scale: vec2f,
}

fn empty_row(index: u32) -> Row {
    return NO_LANES;
}

fn start_row(index: u32) -> Adder {
    let seen = seen_surfels[index];
    let scale = vec2f(inverseSqrt(dot(seen.axis_u, seen.axis_u)), inverseSqrt(dot(seen.axis_v, seen.axis_v)));
    return Adder(empty_row(index), seen, scale);
}

fn hit_gradient(seen: Seen, scale: vec2f, direction: vec3f, d: Lanes, weight: f32, d_alpha: f32) -> Lanes {
    let met = meet(seen, direction);
    // α = σ·exp(−(u² + v²)/2)
    let alpha = alpha_of(seen, met);
    let d_u = -d_alpha * alpha * met.u;
    let d_v = -d_alpha * alpha * met.v;
    // The plane moves the hit along the ray: t feeds D directly, u and v through the point.
    let d_t = weight * d.c.w + d_u * dot(seen.axis_u, direction) + d_v * dot(seen.axis_v, direction);
    let d_plane = d_t / met.cosine;
    // N = Σ w n, turned; its derivative along t_u and t_v turns the normal.
    let turned = select(weight, -weight, met.cosine > 0.0);
    let d_normal = vec3f(d.b.w, d.c.xy);
    let d_normal_u = turned * scale.x * dot(d_normal, seen.axis_u) - d_plane * met.u * scale.x;
    let d_normal_v = turned * scale.y * dot(d_normal, seen.axis_v) - d_plane * met.v * scale.y;
    return Lanes(
        vec4f(-d_u / scale.x, -d_v / scale.y, d_plane, -d_u * met.u / scale.x),
        vec4f(
            -d_v * met.v / scale.y,
            -d_normal_v,
            d_normal_u,
            d_u * met.v * scale.y / scale.x - d_v * met.u * scale.x / scale.y,
        ),
        vec4f(d_alpha * alpha / seen.opacity, weight * d.a.xyz),
        vec4f(weight * d.a.w, weight * d.b.xyz),
    );
}

fn add_hit(adder: ptr<function, Adder>, pixel: vec2u, hit: vec2f) {
    let offset = select(0.5, 1.0, hit.x < 0.0);
    let direction = pixel_direction(f32(pixel.x) + offset, f32(pixel.y) + offset);
    let d = d_features[pixel.y * view.width + pixel.x - band.first_pixel];
    let gradient = hit_gradient((*adder).seen, (*adder).scale, direction, d, abs(hit.x), hit.y);
    (*adder).sum = add_row((*adder).sum, gradient);
}

fn add_row(sum: Row, row: Row) -> Row {
    return Lanes(sum.a + row.a, sum.b + row.b, sum.c + row.c, sum.d + row.d);
}
