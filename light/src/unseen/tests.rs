use super::*;
use crate::alike::testing::in_cube;
use eagpt_scene::lamps::Lamp;
use eagpt_scene::rng::Purpose;
use eagpt_testkit::gaussians::{cube, material};
use eagpt_trace::cpu::CpuScene;
use hull::Cell;
use std::f32::consts::{PI, TAU};

const ALBEDO: f32 = 0.6;

/// A cube of half edge 1 with a hole of half edge 0.8 in its ceiling, the inner surfaces of its
/// discs, and light that is known there: from a wall and from all sides.
fn open_room() -> (Gaussians, Vec<Receiver>, Vec<f32>) {
    let white = |_| material(Vec3::ONE, 0.0, Vec3::splat(ALBEDO));
    let is_hole = |p: Vec3| p.z > 0.99 && p.x.abs() < 0.8 && p.y.abs() < 0.8;
    let walls = cube(1.0, 0.05, white).into_iter();
    let gaussians: Gaussians = walls.filter(|disc| !is_hole(disc.position)).collect();
    let receivers: Vec<Receiver> = (gaussians.iter().zip(0..))
        .map(|(disc, i)| in_cube(&disc, i))
        .collect();
    let known = receivers
        .iter()
        .map(|(_, at)| 1.0 + 0.3 * at.position.x + 0.2 * at.normal.z);
    let known = known.collect();
    (gaussians, receivers, known)
}

fn key(number: u32) -> RandomKey {
    RandomKey::new(5, Purpose::Albedo, number)
}

/// Light that is found where a patch of the ceiling's plane, of half edge 0.4 around `middle`, has
/// `radiance`.
fn found(middle: Vec3, radiance: f32) -> (Option<(HiddenLamps, f64)>, f64) {
    let (mut gaussians, receivers, known) = open_room();
    let tracer = CpuScene::new(&gaussians);
    let patch = |place: Vec3| (place - middle).abs().max_element() < 0.4;
    let (mut unseen, mut all) = (0.0, 0.0);
    for ((i, surface), known) in receivers.iter().zip(&known) {
        // The form factor of the patch, by its own directions.
        let num = 400;
        let points = eagpt_trace::transport::points::Points::new(key(1), *i);
        let sees = (0..num).filter(|&sample| {
            let [a, b, ..] = points.block(sample, 0);
            let towards = eagpt_trace::transport::sampling::cosine_direction(surface.normal, a, b);
            let far = (1.0 - surface.position.z) / towards.z;
            towards.z > 0.0 && far > 1e-3 && patch(surface.position + towards * far)
        });
        let light = radiance * sees.count() as f32 / num as f32;
        unseen += f64::from(light);
        all += f64::from(light + known);
        gaussians.radiances[*i as usize] = Vec3::splat(ALBEDO * (known + light));
    }
    let known = known.into_iter().map(Vec3::splat);
    let received: Vec<(Receiver, Vec3)> = receivers.into_iter().zip(known).collect();
    let found = find(&tracer, &gaussians, &received, (&[], Vec3::Z), key(2)).unwrap();
    (found, unseen / all)
}

/// Radiance times area of all discs that shine, and its middle.
fn power_and_middle(panels: &HiddenLamps) -> (f32, Vec3) {
    let shining = || panels.edit.fixed.iter().filter(|disc| disc.emission > 0.5);
    let power = |disc: &eagpt_scene::Gaussian| {
        TAU * disc.opacity * disc.scale.element_product() * disc.radiance.x
    };
    let total: f32 = shining().map(|disc| power(&disc)).sum();
    let middle: Vec3 = shining().map(|disc| disc.position * power(&disc)).sum();
    (total, middle / total)
}

#[test]
fn light_through_a_hole_is_found_where_it_is() {
    for middle in [Vec3::new(0.3, -0.3, 1.0), Vec3::new(-0.4, 0.2, 1.0)] {
        let (found, true_share) = found(middle, 8.0);
        let (panels, share) = found.unwrap();
        // Less than all: part of it the cell may reflect, and the weight on light takes some.
        let found_of_it = share / true_share;
        assert!(found_of_it > 0.65 && found_of_it < 1.0, "{found_of_it}");
        let (power, at) = power_and_middle(&panels);
        // A cell is 0.34 wide.
        assert!(at.distance(middle) < 0.2, "{at}");
        for disc in panels.edit.fixed.iter() {
            assert!((disc.rotation * Vec3::Z).dot(-disc.position) > 0.0);
        }
        let flux: f32 = panels.lamps.iter().map(|lamp| lamp.power[0]).sum();
        assert!((flux / (PI * power) - 1.0).abs() < 1e-3);
        let holds = |lamp: &Lamp| lamp.contains(at);
        assert!(panels.lamps.iter().any(holds));
    }
}

#[test]
fn where_albedos_are_alike_nothing_is_found() {
    assert!(found(Vec3::Z, 0.0).0.is_none());
    // As little as surfaces reflect that no view shows.
    assert!(found(Vec3::Z, 0.2).0.is_none());
}

#[test]
fn rays_leave_the_hull_at_the_cells_that_they_point_to() {
    let (_, receivers, _) = open_room();
    let up = Vec3::new(0.0, 1.0, 1.0).normalize();
    let places: Vec<Vec3> = receivers.iter().map(|(_, at)| at.position).collect();
    let hull = Hull::around(&places, up).unwrap();
    let inside = hull.rotation * (0.5 * (hull.low + hull.high)) + Vec3::new(0.1, -0.2, 0.05);
    for face in 0..hull::NUM_FACES {
        for (i, j) in [(0, 0), (2, 1), (3, 4)] {
            let cell = Cell { face, at: [i, j] };
            assert_eq!(hull.cell(hull.number(cell)), cell);
            let surface = hull.surface(hull.number(cell));
            assert!(surface.normal.dot(inside - surface.position) > 0.0);
            let towards = surface.position - inside;
            assert_eq!(hull.left_at(inside, towards), cell);
        }
    }
}
