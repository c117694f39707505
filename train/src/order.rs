//! An order of Gaussians in which neighbours in space are neighbours in memory: the Gaussians of a
//! tile or a leaf are close together.

use eagpt_scene::morton;
use glam::Vec3;

/// Indices of `positions` along a Z-order curve through the box around them; ties by index. The
/// grid has as many cells as a curve can: a few points far outside leave cells enough to a room.
pub(crate) fn along_curve(positions: &[Vec3]) -> Vec<u32> {
    let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = positions
        .iter()
        .copied()
        .fold(Vec3::NEG_INFINITY, Vec3::max);
    let cells = (1_u32 << morton::BITS) as f32;
    let per_unit = cells / (high - low).max_element().max(f32::MIN_POSITIVE);
    let code = |position: Vec3| {
        let cell = ((position - low) * per_unit).min(Vec3::splat(cells - 1.0));
        morton::code(cell.to_array().map(|at| at as u32))
    };
    let mut order: Vec<(u64, u32)> = positions.iter().map(|&p| code(p)).zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, index)| index).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
