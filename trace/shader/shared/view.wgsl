// The camera, and rays through its pixels as `RayFrame::direction` has them.

#import declarations

@group(0) @binding(0) var<uniform> view: View;

fn pixel_direction(x: f32, y: f32) -> vec3f {
    return normalize(view.base + view.step_x * x + view.step_y * y);
}
