// Normals and the normals of the surface that mean distances span; see loss/depth_normal.rs.

#import training
#import workgroup
#import loss

@group(0) @binding(8) var<storage, read_write> surfaces: array<SurfaceGradient>;

fn point_of(pixel: u32) -> vec3f {
    return direction_of(pixel) * mean_distance(means[pixel]);
}

fn is_solid(pixel: u32) -> bool {
    return alpha_of_features(means[pixel]) > MIN_NORMAL_ALPHA;
}

@compute @workgroup_size(GROUP_SIZE)
fn surface_terms(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    surfaces[pixel] = SurfaceGradient();
    terms[pixel].surface = vec4f();
    if loss.has_normals == 0u || !is_known(pixel) || !is_solid(pixel) {
        return;
    }
    let own = normal_of(means[pixel]);
    let has_own = dot(own, own) > 0.0;
    var normal = normal_of_target(pixel);
    let is_on_map = any(normal != vec3f());
    var surface = vec4f();
    if is_on_map && has_own {
        surface = vec4f(one_minus_cosine(own, normal).w, 1.0, 0.0, 0.0);
    }
    if !is_on_map && has_own {
        normal = normalize(own);
    }
    terms[pixel].surface = surface;
    let x = pixel % loss.width;
    let y = pixel / loss.width;
    if x == 0u || y == 0u || x + 1u == loss.width || y + 1u == loss.height || all(normal == vec3f()) {
        return;
    }
    let left = pixel - 1u;
    let right = pixel + 1u;
    let above = pixel - loss.width;
    let below = pixel + loss.width;
    if !is_solid(left) || !is_solid(right) || !is_solid(above) || !is_solid(below) {
        return;
    }
    let across = point_of(right) - point_of(left);
    let down = point_of(below) - point_of(above);
    // x right, y down: down × across points back to the camera.
    let spanned = cross(down, across);
    if dot(spanned, spanned) <= MIN_POSITIVE {
        return;
    }
    let term = one_minus_cosine(spanned, normal);
    var d_normal = vec3f();
    if !is_on_map {
        d_normal = one_minus_cosine(own, normalize(spanned)).xyz;
    }
    surfaces[pixel] = SurfaceGradient(cross(term.xyz, down), cross(across, term.xyz), d_normal);
    terms[pixel].surface = vec4f(surface.xy, term.w, 1.0);
}
