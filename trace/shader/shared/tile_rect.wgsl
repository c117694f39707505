// Tiles that the disc of a Gaussian may cover. The conic is that of cpu/bins.rs; where the CPU
// projects for each tile, this is one rectangle that holds all of them.

#import declarations
#import view

// Rectangle of tiles, from and to (inclusive): columns in x, rows in y; 16 bits each. Empty: from
// above to.
struct TileRect {
    columns: vec2u,
    rows: vec2u,
}

fn num_tiles_of(packed: vec2u) -> u32 {
    let rect = unpack_rect(packed);
    if rect.columns.x > rect.columns.y {
        return 0u;
    }
    return (rect.columns.y - rect.columns.x + 1u) * (rect.rows.y - rect.rows.x + 1u);
}

fn unpack_rect(packed: vec2u) -> TileRect {
    return TileRect(
        vec2u(packed.x & 0xffffu, packed.x >> 16u),
        vec2u(packed.y & 0xffffu, packed.y >> 16u),
    );
}

const EMPTY_RECT = vec2u(1u, 1u);

fn extent(axis: vec3f, radius: f32) -> vec3f {
    return axis * (radius / dot(axis, axis));
}

// Pixels, from and to (exclusive), whose rays may meet the projected disc along one axis; see
// cpu/bins.rs for the conic.
fn pixel_range(row: vec3f, center: f32, size: u32, offset: vec3f, a: vec3f, b: vec3f) -> vec2u {
    let depth = dot(offset, view.forward);
    let depth_a = dot(a, view.forward);
    let depth_b = dot(b, view.forward);
    let q = depth * depth - (depth_a * depth_a + depth_b * depth_b);
    let m = dot(offset, row) / depth;
    let ra = dot(a, row) - m * depth_a;
    let rb = dot(b, row) - m * depth_b;
    let half_b = ra * depth_a + rb * depth_b;
    let root = sqrt(half_b * half_b + q * (ra * ra + rb * rb));
    let low = m + center + (-half_b - root) / q - view.margin;
    let high = m + center + (-half_b + root) / q + view.margin;
    let first = clamp(ceil(low - 0.5), 0.0, f32(size));
    let end = clamp(floor(high - 0.5) + 1.0, 0.0, f32(size));
    return vec2u(u32(first), u32(end));
}

fn tile_rect(surfel: Surfel, a: vec3f, b: vec3f) -> vec2u {
    let offset = surfel.position - view.origin;
    let depth = dot(offset, view.forward);
    let depth_a = dot(a, view.forward);
    let depth_b = dot(b, view.forward);
    let reach2 = depth_a * depth_a + depth_b * depth_b;
    if depth + sqrt(reach2) <= 0.0 {
        return EMPTY_RECT;
    }
    var columns = vec2u(0u, view.width);
    var rows = vec2u(0u, view.height);
    if depth <= 0.0 || depth * depth - reach2 <= 1e-4 * depth * depth {
        // The disc reaches into the camera's plane: its picture has no bounds, but most such discs
        // lie to the side.
        let reach = sqrt(dot(a, a) + dot(b, b)) + 1e-5 * length(offset);
        for (var side = 0u; side < 4u; side++) {
            if dot(offset, view.sides[side].xyz) < -reach {
                return EMPTY_RECT;
            }
        }
    } else {
        columns = pixel_range(view.right, view.center_x, view.width, offset, a, b);
        rows = pixel_range(view.down, view.center_y, view.height, offset, a, b);
    }
    if columns.x >= columns.y || rows.x >= rows.y {
        return EMPTY_RECT;
    }
    return vec2u(
        (columns.x / TILE) | (((columns.y - 1u) / TILE) << 16u),
        (rows.x / TILE) | (((rows.y - 1u) / TILE) << 16u),
    );
}
