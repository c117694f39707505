// Buffers of the integrators, and what all of them do.

#import declarations
#import color
#import features
#import view
#import surface

@group(0) @binding(1) var<uniform> light: LightParameters;
// Of the camera rays.
@group(0) @binding(7) var<storage, read> features: array<Lanes>;
@group(0) @binding(8) var<storage, read_write> gathered: array<Gathered>;

fn direction_of(pixel: u32) -> vec3f {
    let image_pixel = light.first_pixel + pixel;
    return pixel_direction(f32(image_pixel % view.width) + 0.5, f32(image_pixel / view.width) + 0.5);
}

// The surface that a pixel sees; none where it sees an emitter, or nothing.
fn surface_of(pixel: u32) -> Surface {
    let met = features[pixel];
    if met.a.w > light.emission_threshold {
        return Surface(false, vec3f(), vec3f(), 0.0);
    }
    return surface_at(view.origin, direction_of(pixel), met);
}

const NOTHING_GATHERED = Gathered(vec3f(), 0.0, 0u, array<u32, 3>());

fn add_sample(total: ptr<function, Gathered>, brought: vec3f, num_rays: u32) {
    (*total).total += brought;
    let y = luminance(brought);
    (*total).squares += y * y;
    (*total).num_rays += num_rays;
}
