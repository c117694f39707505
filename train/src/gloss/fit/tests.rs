//! Lobes found in sums whose answer is known.

use super::*;
use eagpt_scene::rng::{Purpose, RandomKey};

const TRUTH: Fit = Fit {
    roughness: 2,
    specular: 0.3,
};

/// Normal equations over 200 points that are seen from 12 sides, where light is `light(diffuse,
/// lobe)` of the lobe of the truth, the halves of whose samples are this noisy.
fn sums(noise: f64, light: impl Fn(f64, &Lobe, f64) -> f64) -> NormalEquations {
    let key = RandomKey::new(5, Purpose::Albedo, 0);
    let mut sums = NormalEquations::default();
    for point in 0..200 {
        let views: Vec<Seen> = (0..12)
            .map(|view| {
                let uniform = |k| key.stream(point, view * 16 + k).next_uniforms();
                let lobe = |k: u32| {
                    let [a, b, c, d] = uniform(k).map(f64::from);
                    let [p, q, ..] = uniform(8 + k).map(f64::from);
                    let facing = [c, d].map(|half| a * a * 2.0 + noise * (half - 0.5));
                    let edge = [p, q].map(|half| 0.2 * b + 0.1 * noise * (half - 0.5));
                    Lobe {
                        facing,
                        edge,
                        albedo: [0.9 - 0.3 * b, 0.1 * b],
                    }
                };
                let lobes = std::array::from_fn(|k| lobe(k as u32));
                // Without the noise of its halves.
                let [a, b, ..] = uniform(TRUTH.roughness as u32).map(f64::from);
                let clean = Lobe {
                    facing: [a * a * 2.0; 2],
                    edge: [0.2 * b; 2],
                    ..lobes[TRUTH.roughness]
                };
                let [texture, ..] = key.stream(point, 999).next_uniforms();
                let [other, ..] = uniform(15);
                Seen {
                    light: light(0.5 + f64::from(texture), &clean, other.into()),
                    weight: 1.0,
                    lobes,
                }
            })
            .collect();
        sums.add_point(&views);
    }
    sums
}

/// Noise of samples makes the lobe that is found neither weaker nor stronger.
#[test]
fn the_lobe_of_glossy_points_is_found() {
    for noise in [0.0, 1.0] {
        let found = sums(noise, |scattered, lobe, _| {
            let [a, b] = lobe.albedo;
            let reflected = TRUTH.specular * a + b;
            scattered * (1.0 - reflected) + TRUTH.specular * lobe.facing[0] + lobe.edge[0]
        });
        let lobe = found.fit(0.2).expect("differences are large");
        assert_eq!(lobe.roughness, TRUTH.roughness);
        // The values that are tried are 10 % apart.
        let ratio = lobe.specular / TRUTH.specular;
        assert!((0.85..1.15).contains(&ratio), "{lobe:?}");
        let explained = found.explained(lobe);
        assert!(explained > 0.9 && explained < 1.1, "{explained}");
        let certainty = found.certainty(lobe);
        assert!(noise == 0.0 || certainty < 0.95, "{certainty}");
    }
}

#[test]
fn other_differences_are_no_gloss() {
    let found = sums(1.0, |scattered, _, other| scattered + 0.3 * other);
    let lobe = found.fit(0.2).expect("samples are certain enough");
    assert!(found.explained(lobe) < 0.02, "{lobe:?}");
    let still = sums(1.0, |scattered, _, _| scattered);
    let lobe = still.fit(0.2).expect("samples are certain enough");
    assert!(still.explained(lobe) <= 0.0);
}

/// More light than a mirror sends is no gloss; a mirror is.
#[test]
fn lobes_beyond_a_mirror_are_not_sound() {
    for (specular, is_sound) in [(1.0, true), (1.6, false)] {
        let found = sums(0.0, |_, lobe, _| specular * lobe.facing[0] + lobe.edge[0]);
        let lobe = found.fit(0.2).expect("differences are large");
        assert_eq!(lobe.is_sound(), is_sound, "{lobe:?}");
    }
}

/// Paint beside a mirror that is darker than what it would mirror is none.
#[test]
fn a_surface_shows_at_least_what_it_mirrors() {
    let mirror = Fit {
        specular: 1.0,
        ..TRUTH
    };
    let shines = sums(0.0, |_, lobe, _| lobe.facing[0] + lobe.edge[0]);
    assert!(shines.shows(mirror));
    let bright = sums(0.0, |scattered, _, _| 2.0 * scattered);
    assert!(bright.shows(mirror));
    let dark = sums(0.0, |scattered, _, _| 0.1 * scattered);
    assert!(!dark.shows(mirror));
    let varnish = Fit {
        specular: 0.04,
        ..TRUTH
    };
    assert!(dark.shows(varnish));
}

#[test]
fn what_scatters_is_not_told_by_its_lobe_alone() {
    let mirrored = |lobe: &Lobe| 0.5 * lobe.facing[0] + lobe.edge[0];
    let metal = sums(0.0, |_, lobe, _| mirrored(lobe));
    let lobe = metal.fit(0.2).and_then(|lobe| metal.bare(lobe)).unwrap();
    assert!(metal.explained_alone(lobe) > 0.9);
    let paint = sums(0.0, |scattered, lobe, _| scattered + mirrored(lobe));
    let lobe = paint.fit(0.2).unwrap();
    assert!(paint.explained(lobe) > 0.9);
    assert_eq!(paint.bare(lobe), None);
    assert!(paint.explained_alone(lobe) < 0.0);
}
