//! Lit pixels of training views, by which lamps are found.

use crate::backend::TrainingView;
use crate::error::Result;
use crate::views::Views;
use eagpt_lamps::Evidence;
use eagpt_scene::Camera;
use eagpt_trace::{GBuffer, Tracer};

/// The lit pixels of training views, and where the scene that `tracer` traces has them; without
/// those that show what `known` traces, and those beside them.
pub(super) fn lit_pixels(
    tracer: &dyn Tracer,
    views: &Views,
    known: Option<&dyn Tracer>,
) -> Result<Evidence> {
    let mut evidence = Evidence::default();
    for training in views.iter() {
        let TrainingView { view, light, .. } = training?;
        if view.emission.is_none() {
            continue;
        }
        let seen = tracer.gbuffer(&view.camera)?;
        match known {
            Some(known) => {
                let shown = shown(&known.gbuffer(&view.camera)?, &view.camera);
                evidence.add(&view.without(&shown), light, &seen);
            }
            None => evidence.add(&view, light, &seen),
        }
    }
    Ok(evidence)
}

/// The pixels of `camera` in which something is, and those beside them, row by row.
fn shown(seen: &GBuffer, camera: &Camera) -> Vec<bool> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut shown = vec![false; width * height];
    for (i, _) in (0..)
        .zip(&seen.pixels)
        .filter(|(_, pixel)| pixel.alpha() > 0.0)
    {
        let (x, y) = (i % width, i / width);
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            shown[row * width..][x.saturating_sub(1)..(x + 2).min(width)].fill(true);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::discs::{Material, Solid, Surface};
    use eagpt_scene::{Gaussians, Gloss};
    use eagpt_testkit::gaussians::look_at;
    use eagpt_trace::Device;
    use glam::{DVec3, Vec3};

    #[test]
    fn pixels_of_a_lamp_and_beside_it_are_left_out() {
        let ball = Surface {
            solid: Solid::Ball {
                centre: Vec3::ZERO,
                radius: 0.06,
            },
            material: Material {
                albedo: Vec3::ZERO,
                radiance: Some(Vec3::ONE),
                gloss: Gloss::NONE,
            },
            spacing: None,
        };
        let scene: Gaussians = ball.discs();
        let camera = look_at(DVec3::new(2.0, 0.0, 0.0), DVec3::ZERO, 40, 30);
        let seen = Device::Cpu.scene(&scene).unwrap().gbuffer(&camera).unwrap();
        let shown = shown(&seen, &camera);
        let is_there = |x: i32, y: i32| {
            let is_inside = (0..40).contains(&x) && (0..30).contains(&y);
            is_inside && seen.pixels[(y * 40 + x) as usize].alpha() > 0.0
        };
        let beside = [-1, 0, 1];
        for (i, shown) in (0..).zip(&shown) {
            let (x, y) = (i % 40, i / 40);
            let mut around = beside
                .iter()
                .flat_map(|dx| beside.map(|dy| (x + dx, y + dy)));
            assert_eq!(*shown, around.any(|(x, y)| is_there(x, y)), "{x} {y}");
        }
        let num = shown.iter().filter(|shown| **shown).count();
        assert!((6..200).contains(&num), "{num}");
    }
}
