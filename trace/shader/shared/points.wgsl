// Points at which light is sampled, with the bits of points.rs: Owen-scrambled Sobol points with a
// hash for the scramble (Burley 2020). All bits are reversed until the end.

#import random
#import sobol

const SEQUENCE_BITS = 16u;

fn hash4(input: vec4u) -> vec4u {
    var n = input ^ vec4u(0xe6fe3bebu);
    n ^= n >> vec4u(16u);
    n *= 0x7feb352du;
    n ^= n >> vec4u(15u);
    n *= 0x846ca68bu;
    return n ^ (n >> vec4u(16u));
}

fn owen_scramble_rev(input: vec4u, scramble: vec4u) -> vec4u {
    var n = input;
    n ^= n * 0x3d20adeau;
    n += scramble;
    n *= (scramble >> vec4u(16u)) | vec4u(1u);
    n ^= n * 0x05526c56u;
    return n ^ (n * 0x53a22864u);
}

fn sobol_point(index: u32, seed: u32) -> vec4f {
    let shuffled = owen_scramble_rev(vec4u(reverseBits(index)), hash4(vec4u(seed ^ 0x79c68e4au)));
    let scramble = vec4u(seed * 0x9c8f2d3bu) ^ vec4u(0x912f69bau, 0x174f18abu, 0x691e72cau, 0xb40cc1b8u);
    let point = reverseBits(owen_scramble_rev(sobol_rev(shuffled.x), hash4(scramble)));
    return bitcast<vec4f>((point >> vec4u(9u)) | vec4u(0x3f800000u)) - 1.0;
}

// Four numbers in [0, 1) of `sample`; `block` counts fours.
fn block_of(key: vec4u, element: u32, sample: u32, block: u32) -> vec4f {
    let sequence = sample >> SEQUENCE_BITS;
    let seed = stream_words(key, element, block ^ (sequence << SEQUENCE_BITS)).x;
    return sobol_point(sample & ((1u << SEQUENCE_BITS) - 1u), seed);
}

// Of elements that take `num` samples each: neighbours take the next points of one sequence, see
// RowPoints of points.rs.
fn row_block_of(key: vec4u, element: u32, num: u32, sample: u32, block: u32) -> vec4f {
    let sharing = max((1u << SEQUENCE_BITS) / max(num, 1u), 1u);
    return block_of(key, element / sharing, element % sharing * num + sample, block);
}

// A word for choices that need no stratification.
fn word_of(key: vec4u, element: u32, sample: u32) -> u32 {
    return stream_words(key, element, ~sample).x;
}
