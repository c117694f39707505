// Second stage of the adjoint: the row of each Gaussian in each tile, the sum over the tile's
// pixels in their order. A row is a gradient, or with `contributions` a contribution.

#import declarations
#import workgroup
#import view
#import band

#ifdef contributions
#import contribution_row
#else
#import gradient_row
#endif

@group(0) @binding(2) var<storage, read> listed: array<vec2u>;
@group(0) @binding(3) var<storage, read> masks: array<vec2u>;
@group(0) @binding(4) var<storage, read> hit_starts: array<u32>;
@group(0) @binding(5) var<storage, read> hits: array<vec2f>;
@group(0) @binding(6) var<storage, read_write> rows: array<Row>;

@compute @workgroup_size(GROUP_SIZE)
fn add_rows(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let row = invocation_number(workgroup, workgroups, thread);
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
    var adder = start_row(listed[place].x);
    var hit = hit_starts[place];
    for (var word = 0u; word < 2u; word++) {
        var left = mask[word];
        while left != 0u {
            let bit = countTrailingZeros(left) + 32u * word;
            left &= left - 1u;
            add_hit(&adder, corner + vec2u(bit % TILE, bit / TILE), hits[hit]);
            hit++;
        }
    }
    rows[row] = adder.sum;
}
