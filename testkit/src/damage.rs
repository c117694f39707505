//! Damaged files: what a reader is given may be wrong anywhere, and it has to say so.

use eagpt_scene::rng::{Purpose, RandomKey};
use std::ops::Range;

/// Bytes that mean something in numbers, JSON and tables.
const TELLING: &[u8] = b"0919eE-+.,:[]{}\"\n x";
/// Headers and directories lie this near the ends of a file.
const NEAR: usize = 600;
/// Bytes of a piece that is repeated, fewer than this.
const PIECE: usize = 16;

/// Calls `check` with damaged copies of `bytes`, at least one byte: each has one to four changes,
/// which follow from its number.
pub fn for_each_damage(bytes: &[u8], copies: Range<u32>, mut check: impl FnMut(&[u8])) {
    let key = RandomKey::new(20, Purpose::Initialise, 0);
    for copy in copies {
        let mut damaged = bytes.to_vec();
        let mut stream = key.stream(copy, 0);
        for _ in 0..=copy % 4 {
            change(&mut damaged, stream.next_words());
        }
        check(&damaged);
    }
}

fn change(bytes: &mut Vec<u8>, [place, value, kind, length]: [u32; 4]) {
    let num = bytes.len();
    let place = place as usize % num;
    let near = place % num.min(NEAR);
    // Extreme values and single bits find more than uniform ones.
    match kind % 9 {
        0 => bytes[place] = 0,
        1 => bytes[place] = 0xff,
        2 => bytes[place] ^= 1 << (value % 8),
        3 => bytes[place] = value as u8,
        4 | 5 => bytes[place] = TELLING[value as usize % TELLING.len()],
        6 if value % 2 == 0 => bytes[near] = length as u8,
        6 => bytes[num - 1 - near] = length as u8,
        7 => {
            let end = (place + length as usize % PIECE).min(num);
            let piece = bytes[place..end].to_vec();
            bytes.splice(place..place, piece);
        }
        _ => bytes.truncate(place + 1),
    }
}

/// Calls `check` with every prefix of `bytes`, or with `max` of them spread evenly if there are
/// more, and with all bytes but the last; never with all.
pub fn for_each_truncation(bytes: &[u8], max: usize, mut check: impl FnMut(&[u8])) {
    let step = bytes.len().div_ceil(max).max(1);
    for length in (0..bytes.len()).step_by(step) {
        check(&bytes[..length]);
    }
    check(&bytes[..bytes.len() - 1]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_is_done_and_truncations_are_shorter() {
        let bytes = [7_u8; 100];
        let (mut num_changed, mut num_longer, mut num_shorter) = (0, 0, 0);
        for_each_damage(&bytes, 0..200, |damaged| {
            num_changed += u32::from(damaged != bytes);
            num_longer += u32::from(damaged.len() > bytes.len());
            num_shorter += u32::from(damaged.len() < bytes.len());
        });
        assert!(num_changed >= 180, "{num_changed}");
        assert!(
            num_longer > 20 && num_shorter > 20,
            "{num_longer} {num_shorter}"
        );
        let mut lengths = Vec::new();
        for_each_truncation(&bytes, 10, |prefix| lengths.push(prefix.len()));
        assert_eq!(lengths, [0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 99]);
    }
}
