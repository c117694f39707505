// What each Gaussian contributes to the pixels of each tile; see `Contribution` in blend.rs. Hits have their weights from the first stage of the
// adjoint.

@group(0) @binding(2) var<storage, read> listed: array<vec2u>;
// A number for each pixel of the band.
@group(0) @binding(3) var<storage, read> values: array<f32>;
@group(0) @binding(4) var<storage, read> masks: array<vec2u>;
@group(0) @binding(5) var<storage, read> hit_starts: array<u32>;
@group(0) @binding(6) var<storage, read> hits: array<vec2f>;
@group(0) @binding(7) var<storage, read_write> rows: array<Contribution>;

@compute @workgroup_size(64)
fn add_contributions(
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
    let tile = listed[place].y;
    let corner = vec2u(tile % view.tiles_x, tile / view.tiles_x) * TILE;
    var sum = Contribution(listed[place].x, 0.0, 0.0, 0.0, 0u);
    var hit = hit_starts[place];
    for (var word = 0u; word < 2u; word++) {
        var left = mask[word];
        while left != 0u {
            let bit = countTrailingZeros(left) + 32u * word;
            left &= left - 1u;
            let pixel = (corner.y + bit / TILE) * view.width + corner.x + bit % TILE;
            let weight = hits[hit].x;
            sum.weight += weight;
            sum.weighted_value += weight * values[pixel - band.first_pixel];
            // Pixels of a tile come in the order of the image.
            if weight > sum.largest_weight {
                sum.largest_weight = weight;
                sum.pixel = pixel;
            }
            hit++;
        }
    }
    rows[row] = sum;
}
