// Second stage of the adjoint: the gradient of each Gaussian in each tile, the sum over the tile's pixels in their order.

@group(0) @binding(2) var<storage, read> listed: array<vec2u>;
@group(0) @binding(3) var<storage, read> seen_surfels: array<Seen>;
@group(0) @binding(4) var<storage, read> d_sums: array<Lanes>;
@group(0) @binding(5) var<storage, read> masks: array<vec2u>;
@group(0) @binding(6) var<storage, read> hit_starts: array<u32>;
@group(0) @binding(7) var<storage, read> hits: array<vec2f>;
// Gradients as in blend.rs, four vectors: position and first scale; second scale and rotation; opacity and radiance; emission and albedo.
@group(0) @binding(8) var<storage, read_write> rows: array<Lanes>;

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

@compute @workgroup_size(64)
fn add_rows(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let row = group_number(workgroup, workgroups) * 64u + thread;
    let place = band.first_place + row;
    if row >= arrayLength(&rows) || place >= min(arrayLength(&listed), arrayLength(&masks)) {
        return;
    }
    let mask = masks[place];
    if all(mask == vec2u()) {
        return;
    }
    let seen = seen_surfels[listed[place].x];
    let tile = listed[place].y;
    let scale = vec2f(inverseSqrt(dot(seen.axis_u, seen.axis_u)), inverseSqrt(dot(seen.axis_v, seen.axis_v)));
    let corner = vec2u(tile % view.tiles_x, tile / view.tiles_x) * TILE;
    var sum = NO_LANES;
    var hit = hit_starts[place];
    for (var word = 0u; word < 2u; word++) {
        var left = mask[word];
        while left != 0u {
            let bit = countTrailingZeros(left) + 32u * word;
            left &= left - 1u;
            let pixel = corner + vec2u(bit % TILE, bit / TILE);
            let direction = pixel_direction(f32(pixel.x) + 0.5, f32(pixel.y) + 0.5);
            let d = d_sums[pixel.y * view.width + pixel.x - band.first_pixel];
            let gradient = hit_gradient(seen, scale, direction, d, hits[hit].x, hits[hit].y);
            sum = Lanes(sum.a + gradient.a, sum.b + gradient.b, sum.c + gradient.c, sum.d + gradient.d);
            hit++;
        }
    }
    rows[row] = sum;
}
