use super::*;

/// Shots with a counter for a name and a time of their own; letters are exposures, `|` is a pause
/// of a minute.
fn keys(sequence: &str) -> Vec<Key> {
    let (mut keys, mut time_s) = (Vec::new(), 0.0);
    for letter in sequence.chars() {
        if letter == '|' {
            time_s += 60.0;
            continue;
        }
        time_s += 2.0;
        keys.push(Key {
            stem: format!("DSC{:05}", 100 + keys.len()),
            time_s: Some(time_s),
            exposure: exposure(letter),
        });
    }
    keys
}

/// Two stops from letter to letter.
fn exposure(letter: char) -> f64 {
    0.0025 * 4_f64.powi(letter as i32 - 'a' as i32)
}

/// The groups as letters.
fn grouped(sequence: &str) -> Vec<String> {
    let letters: Vec<char> = sequence.chars().filter(|c| *c != '|').collect();
    let groups = group(&keys(sequence), 30.0);
    groups
        .iter()
        .map(|g| g.iter().map(|&shot| letters[shot]).collect())
        .collect()
}

#[test]
fn cycles_are_cut_in_whatever_order_exposures_come() {
    for cycle in ["abcde", "edcba", "cbdae"] {
        assert_eq!(grouped(&cycle.repeat(3)), [cycle; 3]);
    }
    assert_eq!(grouped("abcde"), ["abcde"]);
}

#[test]
fn a_missing_shot_does_not_shift_what_follows() {
    assert_eq!(grouped("abcdeabdeabcde"), ["abcde", "abde", "abcde"]);
    assert_eq!(grouped("abcdebcdeabcde"), ["abcde", "bcde", "abcde"]);
    assert_eq!(grouped("abcdeabcdabcde"), ["abcde", "abcd", "abcde"]);
    assert_eq!(grouped("abcde|bcde|abcde"), ["abcde", "bcde", "abcde"]);
}

#[test]
fn a_repeated_or_swapped_shot_stays_with_its_stack() {
    assert_eq!(grouped("abcdeabbcdeabcde"), ["abcde", "abbcde", "abcde"]);
    assert_eq!(grouped("abcdeacbdeabcde"), ["abcde", "acbde", "abcde"]);
    assert_eq!(grouped("abcdeabcdeeabcde"), ["abcde", "abcdee", "abcde"]);
}

#[test]
fn deviations_are_named() {
    let all = keys("abcdeabde");
    let bracket = Bracket("abcde".chars().map(exposure).collect());
    let missing = bracket.deviation(&all, &[5, 6, 7, 8]);
    assert_eq!(missing.missing, [exposure('c')]);
    let double = keys("abbcde");
    assert_eq!(
        bracket.deviation(&double, &[0, 1, 2, 3, 4, 5]).double,
        [(1, 2)]
    );
    assert!(bracket.deviation(&all, &[0, 2, 1, 3, 4]).out_of_order);
    let mut odd = keys("abcde");
    // 30 % longer: still the place of c, but not its exposure.
    odd[2].exposure *= 1.3;
    let deviation = bracket.deviation(&odd, &[0, 1, 2, 3, 4]);
    assert_eq!(deviation.odd, [(2, exposure('c'))]);
    assert!(deviation.missing.is_empty());
    // Far from all of them.
    odd[4].exposure *= 64.0;
    assert_eq!(bracket.deviation(&odd, &[0, 1, 2, 3, 4]).extra, [4]);
}

fn named(stems: &[&str]) -> Vec<Key> {
    let key = |stem: &&str| Key {
        stem: (*stem).to_owned(),
        time_s: None,
        exposure: 1.0,
    };
    stems.iter().map(key).collect()
}

#[test]
fn names_decide_where_they_have_an_index() {
    let keys = named(&["p2_1", "p2_0", "p10_0", "p10_1"]);
    assert_eq!(group(&keys, 1.0), [vec![1, 0], vec![2, 3]]);
    assert_eq!(name_of_group(&["p2_0", "p2_1"]), "p2");
    // A camera's counter is no index.
    assert_eq!(by_name(&named(&["IMG_0041", "IMG_0042"])), None);
    assert_eq!(by_name(&named(&["a_101", "a_102", "a_103"])), None);
    assert_eq!(name_of_group(&["IMG_0041", "IMG_0042"]), "IMG_0041");
}
