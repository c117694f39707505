//! Helpers of this crate's tests.

use crate::rng::{Purpose, RandomKey};

/// Calls `check` with every prefix of `bytes`, or with `max` of them spread evenly if there are
/// more; never with all bytes.
pub(crate) fn for_each_truncation(bytes: &[u8], max: usize, mut check: impl FnMut(&[u8])) {
    let step = bytes.len().div_ceil(max).max(1);
    for length in (0..bytes.len()).step_by(step) {
        check(&bytes[..length]);
    }
    check(&bytes[..bytes.len() - 1]);
}

/// Calls `check` with `num` copies of `bytes` in each of which one to four random bytes are
/// replaced.
pub(crate) fn for_each_damage(bytes: &[u8], num: u32, mut check: impl FnMut(&[u8])) {
    let key = RandomKey::new(20, Purpose::Initialise, 0);
    for copy in 0..num {
        let mut damaged = bytes.to_vec();
        let mut stream = key.stream(copy, 0);
        for _ in 0..=copy % 4 {
            let [place, value, kind, _] = stream.next_words();
            let place = place as usize % bytes.len();
            // Extreme values and single bits find more than uniform ones.
            damaged[place] = match kind % 4 {
                0 => 0,
                1 => 0xff,
                2 => damaged[place] ^ (1 << (value % 8)),
                _ => value as u8,
            };
        }
        check(&damaged);
    }
}

/// Asserts that an error prints as one line with all of `parts` in it.
#[track_caller]
pub(crate) fn assert_error<T>(outcome: crate::Result<T>, parts: &[&str]) {
    let Err(error) = outcome else {
        panic!("not refused, without {parts:?}");
    };
    let message = error.to_string();
    assert!(!message.contains('\n'), "more than one line: {message}");
    for part in parts {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
}

#[test]
fn damage_is_done_and_truncations_are_shorter() {
    let bytes = [7_u8; 100];
    let (mut num_changed, mut lengths) = (0, Vec::new());
    for_each_damage(&bytes, 50, |damaged| {
        assert_eq!(damaged.len(), bytes.len());
        num_changed += usize::from(damaged != bytes);
    });
    for_each_truncation(&bytes, 10, |prefix| lengths.push(prefix.len()));
    assert!(num_changed >= 45, "{num_changed}");
    assert_eq!(lengths, [0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 99]);
}
