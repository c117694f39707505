// Rays through pixels: the twin of `RayFrame::direction`.
fn pixel_direction(x: f32, y: f32) -> vec3f {
    return normalize(view.base + view.step_x * x + view.step_y * y);
}
