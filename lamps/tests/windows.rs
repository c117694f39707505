//! Windows behind bars are one lamp of their whole area; glints are none.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::shape::{Flat, Shape};
use eagpt_lamps::{Found, Kinds};
use eagpt_scene::lamps::{Lamp, LampShape};
use eagpt_scene::{Gaussian, Gaussians, rotation};
use glam::Vec3;
use rig::{RADIANCE, cameras, find_in, patch, photograph, room};

fn facing(centre: Vec3, normal: Vec3, size: [f32; 2]) -> Shape {
    Shape::Rectangle(Flat {
        centre,
        rotation: rotation::from_z_to(normal),
        size,
    })
}

/// Lamps of a scene whose photographs show `lamp` behind `bars`; those from `num_lit` on have it
/// off.
fn found(lamp: &Shape, bars: &[Shape], num_lit: usize, scene: &Gaussians) -> Found {
    let nothing = facing(Vec3::splat(90.0), Vec3::X, [0.01; 2]);
    let photographs = cameras().into_iter().enumerate().map(|(i, camera)| {
        let shown = if i < num_lit { lamp } else { &nothing };
        photograph(i, camera, shown, bars)
    });
    find_in(scene, Kinds::All, photographs)
}

/// Checks the lamp that is found behind bars of this width, scene units, a window of 1.2 by 0.9,
/// times `scale`; its radiance may be off by the share `off`.
fn check_window(width: f32, scale: f32, off: f32) -> Lamp {
    let (centre, size) = (Vec3::new(0.1, 0.1, 2.5), [1.2 * scale, 0.9 * scale]);
    let window = facing(centre, Vec3::NEG_Z, size);
    let below = centre - Vec3::Z * 0.08 * scale;
    let bar = |at: f32, along: bool| {
        let (shift, size) = if along {
            (Vec3::X * scale, [width, scale])
        } else {
            (Vec3::Y * scale, [1.3 * scale, width])
        };
        facing(below + shift * at, Vec3::NEG_Z, size)
    };
    let mut bars: Vec<Shape> = [-0.3, 0.0, 0.3].map(|at| bar(at, true)).to_vec();
    bars.extend([-0.2, 0.2].map(|at| bar(at, false)));
    // Training has the light among the bars, in tilted discs.
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let heap = patch(
        below,
        [Vec3::X * size[0], Vec3::NEG_Y * size[1]],
        Some(RADIANCE),
    );
    let tilt = |i: usize| 0.03 * (i % 5) as f32;
    scene.extend(heap.iter().enumerate().map(|(i, disc)| Gaussian {
        position: disc.position + Vec3::Z * scale * (tilt(i) - 0.06),
        ..disc
    }));
    let scene: Gaussians = scene.into_iter().collect();
    let found = found(&window, &bars, usize::MAX, &scene);
    assert_eq!(
        found.lamps.lamps.len(),
        1,
        "bars of {width}: {:?}",
        found.lamps
    );
    let lamp = &found.lamps.lamps[0];
    assert_eq!(lamp.shape, LampShape::Panel);
    assert!(lamp.bars, "bars of {width}");
    // Pixels at bars are no measure of the panes.
    let share = lamp.radiance[0] / RADIANCE.x;
    assert!((share - 1.0).abs() < off, "{share}");
    assert!((lamp.world_from_lamp() * Vec3::Z).dot(Vec3::NEG_Z) > 0.99);
    // Silhouettes leave its distance open by some centimetres.
    let share = lamp.area / (size[0] * size[1]);
    assert!((0.9..1.1).contains(&share), "{share}");
    assert!(lamp.centre().distance(centre) < 0.12 * scale, "{lamp:?}");
    lamp.clone()
}

#[test]
fn a_window_shines_with_the_radiance_of_its_panes_behind_its_bars() {
    // They hide a fifth of it.
    check_window(0.035, 1.0, 0.02);
}

#[test]
fn panes_that_photographs_show_apart_are_one_window() {
    check_window(0.07, 1.0, 0.02);
}

#[test]
fn a_small_panel_may_be_behind_bars_if_many_views_show_it() {
    // Most pixels of a pane are at bars.
    let lamp = check_window(0.014, 0.4, 0.1);
    let mean = lamp.num_pixels / lamp.views.len();
    assert!(mean < 200, "{mean}");
}

#[test]
fn a_glint_that_few_views_show_is_no_lamp() {
    // All cameras look at it from below.
    let (centre, size) = (Vec3::new(0.1, 0.1, 2.2), [0.3, 0.2]);
    let spot = facing(centre, Vec3::NEG_Z, size);
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let edges = [Vec3::X * 0.2, Vec3::NEG_Y * 0.3];
    scene.extend(patch(centre, edges, Some(RADIANCE)).iter());
    let scene: Gaussians = scene.into_iter().collect();
    let num = |num_lit| found(&spot, &[], num_lit, &scene).lamps.lamps.len();
    assert_eq!((num(cameras().len()), num(6), num(2)), (1, 1, 0));
}
