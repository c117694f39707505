use super::*;
use eagpt_scene::rng::{Purpose, RandomKey};

fn free(radiance: f64) -> Expected {
    Expected {
        radiance,
        bounds: [0.0, f64::INFINITY],
        weight: 3e-3,
    }
}

/// Receivers of four surfaces that see three sources of radiance `x`, with known light and
/// logarithms of albedo that are off by random numbers of up to `noise`.
fn fitted(x: [f64; 3], noise: f64, expected: [f64; 10]) -> Fit {
    fitted_within(x, noise, expected.map(free))
}

fn fitted_within(x: [f64; 3], noise: f64, expected: [Expected; 10]) -> Fit {
    let key = RandomKey::new(3, Purpose::Initialise, 0);
    let (mut rows, mut radiances, mut known) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..2000_u32 {
        let mut stream = key.stream(i, 0);
        let [a, b, c, d] = stream.next_uniforms().map(f64::from);
        let [e, ..] = stream.next_uniforms().map(f64::from);
        // Sources 4, 7 and 2 of ten.
        let row = vec![(2, 0.2 * c), (4, 0.3 * a), (7, 0.1 * b * b)];
        let light = 0.2 * c * x[2] + 0.3 * a * x[0] + 0.1 * b * b * x[1] + 0.5 + d;
        let albedo = [0.1, 0.3, 0.6, 0.8][i as usize % 4];
        radiances.push(light * albedo * (noise * (2.0 * e - 1.0)).exp());
        known.push(0.5 + d);
        rows.push(row);
    }
    let segments: Vec<u32> = (0..2000).map(|i| i % 4).collect();
    let equations = Equations {
        rows: &rows,
        radiances: &radiances,
        known: &known,
        expected: &(0..).zip(expected).collect(),
        segments: &segments,
        least: 30,
        reflects: false,
    };
    equations.fit()
}

#[test]
fn albedos_alike_tell_the_light_of_cells() {
    for (x, noise) in [([2.0, 5.0, 0.0], 0.0), ([2.0, 5.0, 1.0], 0.2)] {
        let found = fitted(x, noise, [0.0; 10]);
        // The weight on light takes some away.
        for (source, x) in [4, 7, 2].into_iter().zip(x) {
            assert!(
                (found.x[&source] - x).abs() < 0.05 + 0.1 * x + noise,
                "{x} {}",
                found.x[&source]
            );
        }
        let none = [0, 1, 3, 5, 6, 8, 9];
        assert!(none.iter().all(|source| found.x[source] == 0.0));
        let explained = if noise == 0.0 { 0.8 } else { 0.3 };
        assert!(found.explained > explained, "{}", found.explained);
    }
}

#[test]
fn where_there_is_no_light_none_is_found() {
    let found = fitted([0.0; 3], 0.2, [0.0; 10]);
    assert!(
        found.share < 0.01 && found.explained < 0.01,
        "{} {}",
        found.share,
        found.explained
    );
    assert_eq!(
        fitted([0.0; 3], 0.0, [0.0; 10]).x,
        (0..10).map(|source| (source, 0.0)).collect()
    );
}

/// Little light more than is expected, as any noise, is none; darkness where light is expected is
/// seen, too.
#[test]
fn what_is_expected_stays_unless_albedos_say_otherwise() {
    let of = |x: [f64; 3]| [0.0, 0.0, x[2], 0.0, x[0], 0.7, 0.0, x[1], 0.0, 0.0];
    let x = [2.0, 5.0, 1.0];
    let found = fitted(x, 0.2, of(x));
    assert!(
        found.share < 0.01 && found.explained < 0.01,
        "{} {}",
        found.share,
        found.explained
    );
    // Nobody sees it.
    assert_eq!(found.x[&5], 0.7);
    let found = fitted([0.0, 5.0, 1.0], 0.0, of(x));
    assert!(
        found.x[&4] < 0.1 && (found.x[&7] - 5.0).abs() < 0.3,
        "{:?}",
        found.x
    );
}

#[test]
fn without_surfaces_there_is_nothing() {
    let equations = Equations {
        rows: &[vec![(0, 0.5)]],
        radiances: &[1.0],
        known: &[1.0],
        expected: &[(0, free(0.5))].into(),
        segments: &[0],
        least: 2,
        reflects: false,
    };
    let found = equations.fit();
    assert_eq!(
        (found.share, found.explained, found.x),
        (0.0, 0.0, [(0, 0.5)].into())
    );
}

#[test]
fn sources_keep_their_bounds() {
    for (x, found) in [(2.0, 3.0), (3.5, 3.5), (6.0, 4.0)] {
        let mut expected = [free(0.0); 10];
        expected[4] = Expected {
            radiance: 3.0,
            bounds: [3.0, 4.0],
            weight: 0.0,
        };
        let all = fitted_within([x, 0.0, 0.0], 0.0, expected).x;
        assert!((all[&4] - found).abs() < 0.1, "{all:?}");
        assert!((3.0..=4.0).contains(&all[&4]));
    }
}

#[test]
fn no_surface_reflects_more_than_it_gets() {
    let found = |reflects: bool| {
        let equations = Equations {
            rows: &vec![vec![(0, 0.5)]; 40],
            radiances: &[2.0; 40],
            known: &[1.0; 40],
            expected: &[(0, free(0.0))].into(),
            segments: &[0; 40],
            least: 30,
            reflects,
        };
        equations.fit().x[&0]
    };
    // All are alike; a white surface needs twice the light that is known.
    assert_eq!(found(false), 0.0);
    assert!((found(true) - 2.0).abs() < 0.05, "{}", found(true));
}
