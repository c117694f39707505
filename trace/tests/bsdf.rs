//! The BSDF of glossy surfaces: energy, reciprocity, and samples that follow their density.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use eagpt_scene::Gloss;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_trace::transport::bsdf::{Bsdf, BsdfSample, equivalent_albedo};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};

const NORMAL: Vec3 = Vec3::new(0.48, -0.6, 0.64);

fn gloss(specular: f32, roughness: f32) -> Gloss {
    Gloss {
        specular: Vec3::new(specular, 0.8 * specular, 0.5 * specular),
        roughness,
    }
}

/// A unit direction at this cosine and azimuth.
fn direction(cosine: f32, azimuth: f32) -> Vec3 {
    let (tangent, bitangent) = NORMAL.any_orthonormal_pair();
    let flat = (1.0 - cosine * cosine).sqrt();
    let (sin, cos) = azimuth.sin_cos();
    tangent * (flat * cos) + bitangent * (flat * sin) + NORMAL * cosine
}

/// Mean over directions of `of`, by the samples of `bsdf`.
fn mean(bsdf: &Bsdf, num: u32, of: impl Fn(&BsdfSample) -> Vec3) -> Vec3 {
    let key = RandomKey::new(2, Purpose::Render, 0);
    let total = (0..num).fold(Vec3::ZERO, |sum, i| {
        let [choice, a, b, _] = key.stream(i, 0).next_uniforms();
        sum + bsdf.sample([choice, a, b]).map_or(Vec3::ZERO, |s| of(&s))
    });
    total / num as f32
}

/// A white surface in a white room is white, whatever its lobe; others reflect as much as they
/// say.
#[test]
fn a_white_furnace_stays_white() {
    for specular in [0.0, 0.01, 0.04, 0.6, 1.0] {
        for roughness in [0.0, 0.1, 0.35, 0.7, 1.0] {
            for cosine in [1.0, 0.7, 0.3, 0.08] {
                let gloss = gloss(specular, roughness);
                let furnace = |albedo: Vec3| {
                    let bsdf = Bsdf::new(NORMAL, direction(cosine, 0.4), albedo, gloss);
                    (mean(&bsdf, 20_000, |s| s.value / s.density), bsdf.albedo())
                };
                let (white, _) = furnace(Vec3::ONE);
                let off = (white - Vec3::ONE).abs().max_element();
                assert!(off < 0.01, "{specular} {roughness} {cosine}: {white}");
                let (dull, said) = furnace(Vec3::new(0.1, 0.5, 0.9));
                let off = (dull - said).abs().max_element();
                assert!(
                    off < 0.012,
                    "{specular} {roughness} {cosine}: {dull} {said}"
                );
                assert!(said.max_element() <= 1.0);
            }
        }
    }
}

#[test]
fn reflection_is_the_same_both_ways() {
    for (specular, roughness) in [(0.04, 0.3), (0.9, 0.15), (0.5, 0.8)] {
        for (to, from) in [((0.9, 0.1), (0.3, 2.0)), ((0.2, 1.0), (0.6, 1.3))] {
            let [to, from] = [to, from].map(|(cosine, azimuth)| direction(cosine, azimuth));
            let one_way = |out: Vec3, incoming: Vec3| {
                let albedo = Vec3::new(0.2, 0.5, 0.7);
                let bsdf = Bsdf::new(NORMAL, out, albedo, gloss(specular, roughness));
                bsdf.evaluate(incoming).0 / incoming.dot(NORMAL)
            };
            let (a, b) = (one_way(to, from), one_way(from, to));
            assert!(
                (a - b).abs().max_element() < 2e-4 * a.max_element(),
                "{a} {b}"
            );
        }
    }
}

/// The mean of 1/density over samples is the solid angle of the hemisphere.
#[test]
fn the_density_is_that_of_the_samples() {
    for (specular, roughness) in [(0.0, 1.0), (0.04, 0.4), (0.7, 0.5), (1.0, 0.8)] {
        let to_eye = direction(0.6, 0.0);
        let bsdf = Bsdf::new(NORMAL, to_eye, Vec3::splat(0.5), gloss(specular, roughness));
        // Weighted by the square of the cosine, whose integral is 2π/3: grazing directions are
        // rare among samples.
        let square = mean(&bsdf, 200_000, |s| {
            Vec3::splat(s.direction.dot(NORMAL).powi(2) / s.density)
        });
        let off = (square.x / (TAU / 3.0) - 1.0).abs();
        assert!(off < 0.02, "{specular} {roughness}: {off}");
    }
}

#[test]
fn diffuse_surfaces_are_as_they_were() {
    let albedo = Vec3::new(0.123, 0.456, 0.789);
    assert_eq!(equivalent_albedo(albedo, Gloss::NONE), albedo);
    let (out, incoming) = (direction(0.3, 0.0), direction(0.8, 2.0));
    let (value, density) = Bsdf::new(NORMAL, out, albedo, Gloss::NONE).evaluate(incoming);
    assert!((value - albedo * 0.8 * FRAC_1_PI).abs().max_element() < 1e-6);
    assert!((density - 0.8 * FRAC_1_PI).abs() < 1e-6);
    let metal = equivalent_albedo(Vec3::ZERO, gloss(0.8, 0.2));
    assert!(metal.cmplt(Vec3::ONE).all() && metal.x > 0.75, "{metal}");
}

/// A sampled mirror reflects by the law of reflection.
#[test]
fn a_mirror_sends_light_one_way() {
    let out = direction(0.5, 0.3);
    let bsdf = Bsdf::new(NORMAL, out, Vec3::ZERO, gloss(1.0, 0.0));
    let key = RandomKey::new(2, Purpose::Render, 0);
    let mirrored = 2.0 * out.dot(NORMAL) * NORMAL - out;
    assert!(bsdf.mirror_direction().dot(mirrored) > 1.0 - 1e-6);
    for i in 0..100 {
        let [choice, a, b, _] = key.stream(i, 0).next_uniforms();
        let sample = bsdf.sample([choice, a, 0.9 * b]).unwrap();
        assert!(sample.direction.dot(mirrored) > 0.9999);
    }
}
