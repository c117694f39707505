//! Z-order curves: orders in which neighbours in space are mostly neighbours in number (Morton
//! 1966).

/// Largest number of bits of each coordinate: three fit into 64 bits.
pub const BITS: u32 = 21;

/// The place of a cell of a grid on the curve; of each coordinate, the lower [`BITS`] bits count.
pub fn code(cell: [u32; 3]) -> u64 {
    let [x, y, z] = cell.map(|at| spread(u64::from(at)));
    x | y << 1 | z << 2
}

/// The place of a cell of a grid in a plane on the curve; of each coordinate, the lower 16 bits
/// count.
pub fn square_code(cell: [u32; 2]) -> u32 {
    let [x, y] = cell.map(|at| {
        let x = at & 0x0000_ffff;
        let x = (x | x << 8) & 0x00ff_00ff;
        let x = (x | x << 4) & 0x0f0f_0f0f;
        let x = (x | x << 2) & 0x3333_3333;
        (x | x << 1) & 0x5555_5555
    });
    x | y << 1
}

/// Puts two zeros before each of the lower [`BITS`] bits.
fn spread(x: u64) -> u64 {
    let x = x & ((1 << BITS) - 1);
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
    fn cells_of_a_plane_follow_the_curve() {
        for bit in 0..16 {
            assert_eq!(square_code([1 << bit, 0]), 1 << (2 * bit));
        }
        let cells = [[0, 0], [1, 0], [0, 1], [1, 1], [2, 0]];
        assert_eq!(cells.map(square_code), [0, 1, 2, 3, 4]);
        assert_eq!(square_code([0xffff; 2]), u32::MAX);
    }

    #[test]
    fn cells_follow_the_curve() {
        let cells = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0]];
        assert_eq!(cells.map(code), [1, 2, 4, 8]);
        assert_eq!(code([3, 3, 3]), 63);
    }
}
