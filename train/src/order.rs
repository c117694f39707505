//! An order of Gaussians in which neighbours in space are neighbours in memory: the Gaussians of a
//! tile or a leaf are close together.

use glam::Vec3;

/// Cells of the grid along each axis, as a power of two: three fit into 64 bits, and a few points
/// far outside leave cells enough to a room.
const BITS: u32 = 21;

/// Indices of `positions` along a Z-order curve through the box around them (Morton 1966); ties by
/// index.
pub(crate) fn along_curve(positions: &[Vec3]) -> Vec<u32> {
    let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = positions
        .iter()
        .copied()
        .fold(Vec3::NEG_INFINITY, Vec3::max);
    let cells = (1_u32 << BITS) as f32;
    let per_unit = cells / (high - low).max_element().max(f32::MIN_POSITIVE);
    let code = |position: Vec3| {
        let cell = ((position - low) * per_unit).min(Vec3::splat(cells - 1.0));
        let [x, y, z] = cell.to_array().map(|at| spread(at as u64));
        x | y << 1 | z << 2
    };
    let mut order: Vec<(u64, u32)> = positions.iter().map(|&p| code(p)).zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, index)| index).collect()
}

/// Puts two zeros before each of the lower [`BITS`] bits.
fn spread(x: u64) -> u64 {
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread_by_three() {
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread((1 << BITS) - 1), 0x1249_2492_4924_9249);
    }

    #[test]
    fn octants_come_one_after_the_other() {
        let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
        // Corners of a cube in reverse, each twice.
        let positions: Vec<Vec3> = (0..16).map(|i| corner(7 - i / 2)).collect();
        let expected: Vec<u32> = (0..8).rev().flat_map(|i| [2 * i, 2 * i + 1]).collect();
        assert_eq!(along_curve(&positions), expected);
        assert_eq!(along_curve(&[]), Vec::<u32>::new());
        assert_eq!(along_curve(&[Vec3::ONE; 3]), [0, 1, 2]);
    }
}
