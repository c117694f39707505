// The BSDF of a glossy surface; see bsdf.rs.

#import declarations
#import color
#import sampling

// Albedos of lobes for F = 1 − edge and F = edge, two pairs in each: by roughness and cosine, then
// by roughness their means over the hemisphere.
@group(0) @binding(13) var<uniform> lobe_albedos: array<vec4f, LOBE_ALBEDOS>;

// The albedo of a lobe.
struct LobeAlbedo {
    specular: vec3f,
    grazing: f32,
    // Rows of the table around the roughness, and the share of the second.
    row: u32,
    share: f32,
}

fn lobe_albedo(gloss: vec4f) -> LobeAlbedo {
    let place = clamp(gloss.w, 0.0, 1.0) * f32(LOBE_TABLE - 1u);
    let row = min(u32(place), LOBE_TABLE - 2u);
    let largest = max(gloss.x, max(gloss.y, gloss.z));
    return LobeAlbedo(gloss.xyz, min(largest / FULL_GRAZING_SPECULAR, 1.0), row, place - f32(row));
}

fn pair_at(number: u32) -> vec2f {
    let both = lobe_albedos[number / 2u];
    return select(both.xy, both.zw, (number & 1u) == 1u);
}

fn of_pair(lobe: LobeAlbedo, pair: vec2f) -> vec3f {
    return min(lobe.specular * pair.x + vec3f(lobe.grazing * pair.y), vec3f(1.0));
}

// E(μ).
fn albedo_at(lobe: LobeAlbedo, cosine: f32) -> vec3f {
    if lobe.grazing == 0.0 {
        return vec3f();
    }
    let last = f32(LOBE_TABLE - 1u);
    let k = min(u32(sqrt(clamp(cosine, 0.0, 1.0)) * last), LOBE_TABLE - 2u);
    // Cosines of the table are squares.
    let low = f32(k * k) / (last * last);
    let high = f32((k + 1u) * (k + 1u)) / (last * last);
    let along = clamp((cosine - low) / (high - low), 0.0, 1.0);
    let first = lobe.row * LOBE_TABLE + k;
    let second = first + LOBE_TABLE;
    let smooth_row = mix(pair_at(first), pair_at(first + 1u), along);
    let rough_row = mix(pair_at(second), pair_at(second + 1u), along);
    return of_pair(lobe, mix(smooth_row, rough_row, lobe.share));
}

// Ē.
fn mean_albedo(lobe: LobeAlbedo) -> vec3f {
    if lobe.grazing == 0.0 {
        return vec3f();
    }
    let first = LOBE_TABLE * LOBE_TABLE + lobe.row;
    return of_pair(lobe, mix(pair_at(first), pair_at(first + 1u), lobe.share));
}

struct Bsdf {
    // Tangent, bitangent and normal.
    frame: mat3x3f,
    // Towards the eye, in that frame.
    out: vec3f,
    alpha: f32,
    lobe: LobeAlbedo,
    // P (1 − E(μₒ)) / (1 − Ē).
    diffuse: vec3f,
    // Chance that a direction is sampled from the specular lobe.
    specular_share: f32,
    // Of light from everywhere, what goes to the eye.
    albedo: vec3f,
}

// `gloss`: F0 and the roughness.
fn bsdf_of(normal: vec3f, to_eye: vec3f, albedo: vec3f, gloss: vec4f) -> Bsdf {
    let frame = frame_about(normal);
    let local = to_eye * frame;
    let out = normalize(vec3f(local.xy, max(local.z, BSDF_MIN_COSINE)));
    let lobe = lobe_albedo(gloss);
    let mirrored = albedo_at(lobe, out.z);
    let scattered = albedo * (1.0 - mirrored);
    let diffuse = scattered / max(1.0 - mean_albedo(lobe), vec3f(BSDF_MIN_COSINE));
    let s = luminance(mirrored);
    let share = select(0.0, s / (s + luminance(scattered)), s > 0.0);
    let alpha = max(gloss.w * gloss.w, MIN_LOBE_ALPHA);
    return Bsdf(frame, out, alpha, lobe, diffuse, share, mirrored + scattered);
}

// Schlick's weight of the reflection at grazing angles.
fn schlick(facing: f32) -> f32 {
    let x = clamp(1.0 - facing, 0.0, 1.0);
    return x * x * x * x * x;
}

// Smith's Λ.
fn smith(w: vec3f, alpha: f32) -> f32 {
    let tan2 = dot(w.xy, w.xy) / max(w.z * w.z, 1e-30);
    return 0.5 * (sqrt(1.0 + alpha * alpha * tan2) - 1.0);
}

// GGX: density of facets of normal `half_way` over projected area.
fn distribution(half_way: vec3f, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let root = dot(half_way.xy, half_way.xy) + a2 * half_way.z * half_way.z;
    return a2 / max(PI * root * root, 1e-30);
}

// f · cos θ for light from the unit `direction`, and the density with which `sample_bsdf` chooses
// that; zeros below the surface.
fn evaluate_bsdf(bsdf: Bsdf, direction: vec3f) -> vec4f {
    let incoming = direction * bsdf.frame;
    if incoming.z <= 0.0 {
        return vec4f();
    }
    let cosine_density = incoming.z / PI;
    var value = bsdf.diffuse * (1.0 - albedo_at(bsdf.lobe, incoming.z)) * cosine_density;
    var density = (1.0 - bsdf.specular_share) * cosine_density;
    if bsdf.specular_share > 0.0 {
        let half_way = normalize(incoming + bsdf.out);
        let edge = schlick(clamp(dot(half_way, bsdf.out), 0.0, 1.0));
        let a = smith(bsdf.out, bsdf.alpha);
        let b = smith(incoming, bsdf.alpha);
        let facets = distribution(half_way, bsdf.alpha) / (4.0 * bsdf.out.z);
        let fresnel = bsdf.lobe.specular * (1.0 - edge) + vec3f(bsdf.lobe.grazing * edge);
        value += fresnel * (facets / (1.0 + a + b));
        density += bsdf.specular_share * facets / (1.0 + a);
    }
    return vec4f(value, density);
}

// A direction from three uniform numbers in [0, 1); zero where a facet reflects below the surface.
fn sample_bsdf(bsdf: Bsdf, choice: f32, a: f32, b: f32) -> vec3f {
    if choice >= bsdf.specular_share {
        return cosine_direction(bsdf.frame[2], a, b);
    }
    let half_way = visible_facet(bsdf.out, bsdf.alpha, a, b);
    let incoming = 2.0 * dot(bsdf.out, half_way) * half_way - bsdf.out;
    return select(vec3f(), normalize(bsdf.frame * incoming), incoming.z > 0.0);
}

// Normal of a facet that is seen from `out`, by its visible area (Dupuy and Benyoub 2023).
fn visible_facet(out: vec3f, alpha: f32, a: f32, b: f32) -> vec3f {
    let stretched = normalize(vec3f(out.xy * alpha, out.z));
    let z = (1.0 - b) * (1.0 + stretched.z) - stretched.z;
    let cap = vec3f(sqrt(max(1.0 - z * z, 0.0)) * turn(a), z) + stretched;
    return normalize(vec3f(cap.xy * alpha, max(cap.z, 0.0)));
}
