//! Lamps made of heaps of discs, as a training leaves them: tilted, scattered, and on the side of
//! the cameras only. What comes out has the area and the place of the true surface.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use eagpt_edit::{Script, replay};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::script::ScriptFile;
use eagpt_scene::{Gaussian, Gaussians, Gloss, Result};
use glam::{Quat, Vec2, Vec3};
use std::f32::consts::PI;
use std::path::Path;

const CENTRE: Vec3 = Vec3::new(1.0, -2.0, 1.5);

/// Discs of a surface some 16 across: those that a camera at −y sees, a few hundredths of its size
/// out of place, tilted by several degrees.
fn heap(solid: Solid, size: f32) -> Gaussians {
    let surface = Surface {
        solid,
        material: Material {
            albedo: Vec3::new(0.6, 0.4, 0.2),
            radiance: None,
            gloss: Gloss::NONE,
        },
        spacing: Some(size / 16.0),
    };
    let whole = surface.discs();
    let seen = (0..).zip(whole.iter()).filter(|(_, disc)| {
        let towards = Vec3::new(0.0, -3.0, -0.4);
        (disc.rotation * Vec3::Z).dot(towards) > -0.1
    });
    let key = RandomKey::new(1, Purpose::Furnish, 0);
    let random = |index: u32, sample: u32| {
        let [x, y, z, _] = key.stream(index, sample).next_uniforms();
        Vec3::new(x, y, z) - 0.5
    };
    let shaken = seen.map(|(index, disc)| Gaussian {
        position: disc.position + random(index, 0) * (0.06 * size),
        rotation: Quat::from_scaled_axis(random(index, 1) * 0.4) * disc.rotation,
        ..disc
    });
    shaken.collect()
}

/// A script that makes a lamp of everything, by the keys of `make_lamp` but the radiance.
fn script(keys: &str) -> Result<Script> {
    let text = format!(
        "[[step]]\nselect = \"everything\"\nthen = [{{ make_lamp = {{ {keys}, radiance = [3, 2, 1] }} }}]"
    );
    Script::of_file(ScriptFile::new(Path::new("a.toml"), text.into_bytes())?)
}

/// Bounds of the centres.
fn bounds(gaussians: &Gaussians) -> [Vec3; 2] {
    let all = || gaussians.positions.iter().copied();
    [
        all().reduce(Vec3::min).unwrap(),
        all().reduce(Vec3::max).unwrap(),
    ]
}

#[test]
fn a_lamp_is_where_the_heap_was_and_as_large() {
    let turned = Quat::from_rotation_z(0.5) * Quat::from_rotation_x(1.2);
    let tube = |axis| Solid::Tube {
        centre: CENTRE,
        axis,
        radii: [0.25, 0.18],
        is_open: false,
    };
    let edges = [turned * Vec3::X * 0.6, turned * Vec3::Y * 0.35];
    for (solid, size, keys) in [
        (tube(Vec3::Z * 0.3), 0.5, "shape = \"tube\""),
        (
            tube(turned * Vec3::Z * 0.4),
            0.5,
            &format!(
                "shape = \"tube\", axis = {:?}",
                (turned * Vec3::Z).to_array()
            ),
        ),
        (
            Solid::Ball {
                centre: CENTRE,
                radius: 0.2,
            },
            0.4,
            "shape = \"ball\"",
        ),
        (
            Solid::Quad {
                centre: CENTRE,
                edges,
            },
            0.5,
            "shape = \"rectangle\"",
        ),
        (
            Solid::Ellipse {
                centre: CENTRE,
                axes: edges,
            },
            0.5,
            "shape = \"ellipse\"",
        ),
    ] {
        let edited = replay(&script(keys).unwrap(), heap(solid, size)).unwrap();
        let lamp = edited.gaussians;
        let material = Material {
            albedo: Vec3::ZERO,
            radiance: Some(Vec3::ONE),
            gloss: Gloss::NONE,
        };
        let truth = Surface {
            solid,
            material,
            spacing: None,
        };
        let truth = truth.discs();
        // Half of the shaking, 3 % of the size, and the quantile of the edges.
        for (found, wanted) in bounds(&lamp).into_iter().zip(bounds(&truth)) {
            let off = (found - wanted).abs().max_element();
            assert!(off < 0.04 * size, "{keys}: {found} {wanted}");
        }
        let [area, wanted] = [&lamp, &truth].map(area);
        assert!(
            (area / wanted - 1.0).abs() < 0.08,
            "{keys}: {area} {wanted}"
        );
        for g in lamp.iter() {
            assert_eq!((g.emission, g.radiance), (1.0, Vec3::new(3.0, 2.0, 1.0)));
            assert!((g.albedo - Vec3::new(0.6, 0.4, 0.2)).length() < 1e-5);
        }
    }
}

/// Sum of the areas of discs: those of a surface made of discs grow with it.
fn area(discs: &Gaussians) -> f32 {
    discs.scales.iter().map(|scale| scale.x * scale.y).sum()
}

/// Few Gaussians of a small shade may all lie level.
#[test]
fn level_discs_are_a_cylinder() {
    let ball = Solid::Ball {
        centre: CENTRE,
        radius: 0.2,
    };
    let base = heap(ball, 0.4).get(0);
    let level = |i: u16| {
        let part = (f32::from(i) + 0.5) / 100.0;
        let (sin, cos) = (2.4 * f32::from(i)).sin_cos();
        let (radius, height) = (0.25 * part.sqrt(), 0.2 * (0.618 * f32::from(i)).fract());
        Gaussian {
            position: CENTRE + Vec3::new(radius * cos, radius * sin, height),
            scale: Vec2::splat(0.05),
            rotation: Quat::IDENTITY,
            opacity: 0.5,
            ..base
        }
    };
    let heap: Gaussians = (0..100).map(level).collect();
    let edited = replay(&script("shape = \"tube\"").unwrap(), heap).unwrap();
    let [low, high] = bounds(&edited.gaussians);
    let wanted = [Vec3::new(-0.25, -0.25, 0.0), Vec3::new(0.25, 0.25, 0.2)];
    for (found, wanted) in [low, high].into_iter().zip(wanted) {
        let off = (found - CENTRE - wanted).abs().max_element();
        assert!(off < 0.01, "{found} {wanted}");
    }
}

#[test]
fn what_no_lamp_can_be_made_of_is_refused() {
    let quad = Solid::Quad {
        centre: CENTRE,
        edges: [Vec3::X, Vec3::Z],
    };
    let few: Gaussians = heap(quad, 1.0).iter().take(5).collect();
    for (heap, keys, expected) in [
        (few, "shape = \"ball\"", "6 Gaussians or more, not of 5"),
        (heap(quad, 1.0), "shape = \"tube\"", "has not this shape"),
        (heap(quad, 1.0), "shape = \"ball\"", "has not this shape"),
    ] {
        let error = replay(&script(keys).unwrap(), heap)
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error}");
        assert!(error.contains("a.toml"), "{error}");
    }
}

#[test]
fn only_a_tube_has_an_axis() {
    let error = script("shape = \"ball\", axis = \"z\"").unwrap_err();
    let error = error.to_string();
    assert!(error.contains("only a `tube` has an `axis`"), "{error}");
}

/// Few and scattered discs say where a tube is whose size is known.
#[test]
fn a_tube_of_known_size_is_put_in_the_middle() {
    let tube = Solid::Tube {
        centre: CENTRE,
        axis: Vec3::Z * 0.2,
        radii: [0.3, 0.15],
        is_open: false,
    };
    let seen = heap(tube, 0.8);
    // From both sides.
    let turned = seen.iter().map(|disc| Gaussian {
        position: CENTRE + (disc.position - CENTRE) * Vec3::new(-1.0, -1.0, 1.0),
        rotation: Quat::from_rotation_z(PI) * disc.rotation,
        ..disc
    });
    let some: Gaussians = seen.iter().chain(turned).step_by(5).collect();
    let known = "shape = \"tube\", radii = [0.3, 0.15], height = 0.2";
    let edited = replay(&script(known).unwrap(), some).unwrap();
    let [low, high] = bounds(&edited.gaussians);
    let wanted = Vec3::new(0.3, 0.3, 0.1);
    for (found, wanted) in [(low, -wanted), (high, wanted)] {
        let off = (found - CENTRE - wanted).abs().max_element();
        assert!(off < 0.05, "{found} {wanted}");
    }
    for (keys, expected) in [
        (
            "shape = \"tube\", radii = [0.3, 0.15]",
            "`radii` and a `height`",
        ),
        (
            "shape = \"ball\", radii = [0.3, 0.15], height = 0.2",
            "only a `tube`",
        ),
    ] {
        let error = script(keys).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
