// Which places of the grid of rays have one, and where it passes; see camera_rays.rs. A pixel that
// is split has one through the middle of each of its 2×2 places, another one through its own
// middle, at the first of them.

#import declarations

@group(0) @binding(10) var<uniform> split: SplitPixels;

// From the left and the upper edge of place `thread` of `tile` to its ray, in places; 0 where it
// has none.
fn ray_offset(tile: u32, thread: u32) -> f32 {
    let place = vec2u(thread % TILE, thread / TILE);
    let within = place.y / RAYS_PER_AXIS * SPLIT_EDGE + place.x / RAYS_PER_AXIS;
    let bit = tile % TILES_PER_DISPATCH * (SPLIT_EDGE * SPLIT_EDGE) + within;
    let word = split.bits[bit / 128u][bit / 32u % 4u];
    if ((word >> (bit % 32u)) & 1u) != 0u {
        return 0.5;
    }
    return select(0.0, f32(RAYS_PER_AXIS) / 2.0, all(place % RAYS_PER_AXIS == vec2u()));
}
