// Rows of the adjoint that say what a Gaussian contributes to pixels; see `Contribution` in
// blend.rs.

#import declarations
#import view
#import band

// A number for each pixel of the band.
@group(0) @binding(10) var<storage, read> values: array<f32>;

alias Row = Contribution;

struct Adder {
    sum: Row,
}

fn empty_row(index: u32) -> Row {
    return Contribution(index, 0.0, 0.0, 0.0, 0u);
}

fn start_row(index: u32) -> Adder {
    return Adder(empty_row(index));
}

fn add_hit(adder: ptr<function, Adder>, pixel: vec2u, hit: vec2f) {
    let at = pixel.y * view.width + pixel.x;
    let value = values[at - band.first_pixel];
    (*adder).sum = add_row((*adder).sum, Contribution((*adder).sum.gaussian, hit.x, hit.x * value, hit.x, at));
}

fn add_row(sum: Row, row: Row) -> Row {
    let is_first = row.largest_weight == sum.largest_weight && row.pixel < sum.pixel;
    let is_larger = row.largest_weight > sum.largest_weight || is_first;
    return Contribution(
        row.gaussian,
        sum.weight + row.weight,
        sum.weighted_value + row.weighted_value,
        max(sum.largest_weight, row.largest_weight),
        select(sum.pixel, row.pixel, is_larger),
    );
}
