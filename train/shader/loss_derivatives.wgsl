// Derivatives of the whole loss by the features of every ray.

#import training
#import workgroup
#import features
#import loss

@group(0) @binding(8) var<storage, read> surfaces: array<SurfaceGradient>;
@group(0) @binding(9) var<storage, read> report: array<u32>;
@group(0) @binding(10) var<storage, read_write> d_rays: array<Lanes>;

// By the light that is shown, of the colour term.
fn by_shown(pixel: u32) -> vec3f {
    let shown = encoded[pixel].pq;
    let target_pq = pq_of_target(pixel);
    let by_moments = window_of(pixel);
    let d_ssim = loss.per_window * (by_moments.of_shown + 2.0 * shown * by_moments.of_squares + target_pq * by_moments.of_product);
    let d_pq = loss.l1 * sign(shown - target_pq) - loss.ssim * d_ssim;
    return d_pq * encoded[pixel].slope;
}

fn surface_at(x: i32, y: i32) -> SurfaceGradient {
    if x < 0 || y < 0 || x >= i32(loss.width) || y >= i32(loss.height) {
        return SurfaceGradient();
    }
    return surfaces[u32(y) * loss.width + u32(x)];
}

// By the distance from the origin of the point of a pixel, of the term of spanned normals.
fn by_mean_distance(pixel: u32) -> f32 {
    let x = i32(pixel % loss.width);
    let y = i32(pixel / loss.width);
    let d_point = surface_at(x - 1, y).d_across - surface_at(x + 1, y).d_across + surface_at(x, y - 1).d_down
        - surface_at(x, y + 1).d_down;
    return dot(d_point, direction_of(pixel));
}

fn derivative(pixel: u32) -> Lanes {
    let features = means[pixel];
    var d_radiance = vec3f();
    var d_emission = 0.0;
    var d_normal = vec3f();
    var d_alpha = 0.0;
    var d_distance = 0.0;
    if is_known(pixel) {
        d_radiance = loss.color * by_shown(pixel);
        d_emission = loss.emission * sign(features.a.w - emission_of_target(pixel));
        d_alpha = loss.alpha * sign(alpha_of_features(features) - opacity_of_target(pixel));
        let error = depth_error(pixel);
        if error != 0.0 && abs(error) < MAX_DEPTH_ERROR {
            // D̃ = D / A
            d_distance = loss.depth * sign(error) / (targets[pixel].distance * alpha_of_features(features));
            d_alpha -= d_distance * mean_distance(features);
        }
    }
    if loss.has_normals != 0u {
        let num_map = bitcast<f32>(report[REPORT_NUM_MAP]);
        let num_spanned = bitcast<f32>(report[REPORT_NUM_SPANNED]);
        if num_map > 0.0 && terms[pixel].surface.y > 0.0 {
            d_normal += loss.normal / num_map * one_minus_cosine(normal_of(features), normal_of_target(pixel)).xyz;
        }
        if num_spanned > 0.0 {
            let share = loss.depth_normal / num_spanned;
            d_normal += share * surfaces[pixel].d_normal;
            if alpha_of_features(features) > 0.0 {
                // D̃ = D / A
                let d_mean = share * by_mean_distance(pixel) / alpha_of_features(features);
                d_distance += d_mean;
                d_alpha -= d_mean * mean_distance(features);
            }
        }
    }
    return Lanes(
        vec4f(d_radiance, d_emission),
        vec4f(0.0, 0.0, 0.0, d_normal.x),
        vec4f(d_normal.yz, d_alpha, d_distance),
        vec4f(),
    );
}

// Turns a derivative by the mean of a pixel's rays into one by each of them.
fn share_out(pixel: u32, d: Lanes) {
    let n = rays_per_axis(pixel);
    let num = f32(n * n);
    let shared_out = Lanes(d.a / num, d.b / num, d.c / num, vec4f());
    let first = vec2u(pixel % loss.width, pixel / loss.width) * loss.rays_per_axis;
    for (var y = 0u; y < n; y++) {
        for (var x = 0u; x < n; x++) {
            d_rays[(first.y + y) * loss.width * loss.rays_per_axis + first.x + x] = shared_out;
        }
    }
}

@compute @workgroup_size(GROUP_SIZE)
fn derivatives(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    share_out(pixel, derivative(pixel));
}

// Of stage 1: by the albedos alone, which emitters do not show.
@compute @workgroup_size(GROUP_SIZE)
fn derivatives_lit(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let pixel = invocation_number(workgroup, workgroups, thread);
    if pixel >= loss.num_pixels {
        return;
    }
    let light = lit[pixel];
    var d_albedo = vec3f();
    if is_known(pixel) && light.w == 0.0 {
        d_albedo = loss.color * by_shown(pixel) * light.xyz;
    }
    share_out(pixel, Lanes(vec4f(), vec4f(d_albedo, 0.0), vec4f(), vec4f()));
}
