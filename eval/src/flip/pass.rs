//! Passes of one-dimensional filters over blocks of values.

use super::filters::GROUP;

/// Values of a block; strips are a whole number of blocks wide in memory.
pub(super) const LANES: usize = 32;

pub(super) type Block = [f32; LANES];

#[inline(always)]
pub(super) fn block(values: &[f32], first: usize) -> &Block {
    // Buffers extend by whole blocks beyond the reach of any filter.
    values[first..].first_chunk().unwrap_or(&[0.0; LANES])
}

/// An even filter of the values that `at` gives at a distance to both sides.
///
/// Distances are processed in groups: sums are sequential, products of a group are independent.
#[inline(always)]
pub(super) fn even<'a>(weights: &[f32], at: impl Fn(usize) -> [&'a Block; 2], out: &mut Block) {
    let [middle, _] = at(0);
    for i in 0..LANES {
        out[i] = weights[0] * middle[i];
    }
    for (group, weights) in weights[1..].as_chunks::<GROUP>().0.iter().enumerate() {
        let first = 1 + group * GROUP;
        let ([a1, b1], [a2, b2], [a3, b3]) = (at(first), at(first + 1), at(first + 2));
        for i in 0..LANES {
            out[i] += weights[0] * (a1[i] + b1[i])
                + weights[1] * (a2[i] + b2[i])
                + weights[2] * (a3[i] + b3[i]);
        }
    }
}

/// Two even filters of one length.
#[inline(always)]
pub(super) fn two_even<'a>(
    weights: [&[f32]; 2],
    at: impl Fn(usize) -> [&'a Block; 2],
    [out1, out2]: [&mut Block; 2],
) {
    let [middle, _] = at(0);
    for i in 0..LANES {
        out1[i] = weights[0][0] * middle[i];
        out2[i] = weights[1][0] * middle[i];
    }
    let groups = weights[0][1..].as_chunks::<GROUP>().0.iter();
    let groups = groups.zip(weights[1][1..].as_chunks::<GROUP>().0);
    for (group, (w, v)) in groups.enumerate() {
        let first = 1 + group * GROUP;
        let ([a1, b1], [a2, b2], [a3, b3]) = (at(first), at(first + 1), at(first + 2));
        for i in 0..LANES {
            let (s1, s2, s3) = (a1[i] + b1[i], a2[i] + b2[i], a3[i] + b3[i]);
            out1[i] += w[0] * s1 + w[1] * s2 + w[2] * s3;
            out2[i] += v[0] * s1 + v[1] * s2 + v[2] * s3;
        }
    }
}

/// An odd filter, such as that of edges, and an even one of its length.
#[inline(always)]
pub(super) fn odd_and_even<'a>(
    odd: &[f32],
    even: &[f32],
    at: impl Fn(usize) -> [&'a Block; 2],
    [out_odd, out_even]: [&mut Block; 2],
) {
    let [middle, _] = at(0);
    for i in 0..LANES {
        out_odd[i] = 0.0;
        out_even[i] = even[0] * middle[i];
    }
    let groups = odd[1..].as_chunks::<GROUP>().0.iter();
    let groups = groups.zip(even[1..].as_chunks::<GROUP>().0);
    for (group, (w, v)) in groups.enumerate() {
        let first = 1 + group * GROUP;
        let ([a1, b1], [a2, b2], [a3, b3]) = (at(first), at(first + 1), at(first + 2));
        for i in 0..LANES {
            let (s1, s2, s3) = (a1[i] + b1[i], a2[i] + b2[i], a3[i] + b3[i]);
            let (d1, d2, d3) = (b1[i] - a1[i], b2[i] - a2[i], b3[i] - a3[i]);
            out_odd[i] += w[0] * d1 + w[1] * d2 + w[2] * d3;
            out_even[i] += v[0] * s1 + v[1] * s2 + v[2] * s3;
        }
    }
}
