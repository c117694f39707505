//! The searches for hits against each other, also after Gaussians have moved.

use super::cameras;
use eagpt_scene::Gaussians;
use eagpt_testkit::gaussians::random_cloud;
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::bvh::{Bvh, RayScratch};
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::ray::Ray;
use eagpt_trace::surfel::SurfelSet;
use glam::Vec3;

#[test]
fn tiles_and_single_rays_give_the_same_bits() {
    let gaussians = random_cloud(2000, 8);
    let set = SurfelSet::new(&gaussians);
    let bvh = Bvh::new(&set);
    for camera in cameras() {
        let (tiles, _) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing);
        let (rays, _) = camera::trace(&set, &camera, HitSearch::SingleRays(&bvh), Keep::Nothing);
        assert!(tiles == rays);
    }
}

/// Needles and discs seen edge-on, which lie in few of the blocks that their bounds cover; several
/// in one plane, whose distances tie.
#[test]
fn needles_ties_and_grazing_discs_are_found_by_all_searches() {
    let mut gaussians = random_cloud(3000, 12);
    for (i, scale) in gaussians.scales.iter_mut().enumerate() {
        *scale *= match i % 3 {
            0 => glam::Vec2::new(12.0, 0.05),
            1 => glam::Vec2::new(0.02, 3.0),
            _ => glam::Vec2::splat(0.5),
        };
    }
    for i in (0..gaussians.len()).step_by(5) {
        gaussians.positions[i].z = 0.05 * (i % 4) as f32;
        gaussians.rotations[i] = glam::Quat::from_rotation_z(i as f32);
    }
    let set = SurfelSet::new(&gaussians);
    let bvh = Bvh::new(&set);
    for camera in cameras() {
        let (tiles, mut tile_record) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
        let (rays, mut ray_record) =
            camera::trace(&set, &camera, HitSearch::SingleRays(&bvh), Keep::Record);
        assert!(tiles == rays);
        let by_tiles = tile_record.adjoint(&set, &tiles.pixels, GradientMask::Everything);
        assert!(by_tiles == ray_record.adjoint(&set, &tiles.pixels, GradientMask::Everything));
    }
}

/// Light that passes is the product over all hits up to a distance, here of all Gaussians in turn.
#[test]
fn rays_are_free_up_to_where_half_of_the_light_is_left() {
    let gaussians = random_cloud(1500, 8);
    let set = SurfelSet::new(&gaussians);
    let scene = CpuScene::new(&gaussians);
    let mut counts = [0; 2];
    for (i, ray) in (0..).zip(sphere_of_rays()) {
        let distance = 0.01 * (i % 150) as f32;
        let passed: f64 = (set.surfels.iter())
            .filter_map(|surfel| {
                let seen = surfel.seen_from(ray.origin);
                let met = seen.meet(ray.direction);
                let is_before = seen.counts(&met) && met.t <= distance;
                let r2 = f64::from(met.u).powi(2) + f64::from(met.v).powi(2);
                is_before.then(|| 1.0 - f64::from(surfel.opacity) * (-0.5 * r2).exp())
            })
            .product();
        // Products in another order differ by roundings.
        if (passed - 0.5).abs() > 1e-5 {
            assert_eq!(scene.is_free(&ray, distance), passed > 0.5, "{i}: {passed}");
            counts[usize::from(passed > 0.5)] += 1;
        }
    }
    assert!(counts.iter().all(|num| *num > 40), "{counts:?}");
}

fn sphere_of_rays() -> impl Iterator<Item = Ray> {
    (0..400).map(|i| {
        let a = i as f32 * 2.399_963;
        let z = 1.0 - (2 * i + 1) as f32 / 400.0;
        let flat = (1.0 - z * z).sqrt();
        let direction = Vec3::new(flat * a.cos(), flat * a.sin(), z).normalize();
        Ray::free([0.05, -0.02, 0.1], direction.to_array())
    })
}

fn trace_sphere_of_rays(set: &SurfelSet, bvh: &Bvh) -> Vec<eagpt_trace::Features> {
    let mut scratch = RayScratch::default();
    sphere_of_rays()
        .map(|ray| bvh.trace(set, &ray, &mut scratch))
        .collect()
}

fn moved(gaussians: &Gaussians, by: f32) -> Gaussians {
    let mut out = gaussians.clone();
    for (i, p) in out.positions.iter_mut().enumerate() {
        let phase = i as f32;
        *p += Vec3::new(phase.sin(), (1.7 * phase).cos(), (0.3 * phase).sin()) * by;
    }
    out
}

#[test]
fn a_refit_tree_equals_a_fresh_one() {
    let gaussians = random_cloud(3000, 5);
    let mut bvh = Bvh::new(&SurfelSet::new(&gaussians));
    let small = SurfelSet::new(&moved(&gaussians, 0.01));
    assert!(!bvh.update(&small), "a small move is followed by a refit");
    assert!(trace_sphere_of_rays(&small, &bvh) == trace_sphere_of_rays(&small, &Bvh::new(&small)));
    let large = SurfelSet::new(&moved(&gaussians, 0.8));
    assert!(bvh.update(&large), "a large move makes a new tree");
    assert!(trace_sphere_of_rays(&large, &bvh) == trace_sphere_of_rays(&large, &Bvh::new(&large)));
}

#[test]
fn faint_gaussians_enter_and_leave_the_tree() {
    let mut gaussians = random_cloud(500, 6);
    let mut bvh = Bvh::new(&SurfelSet::new(&gaussians));
    gaussians.opacities[17] = 1e-3;
    gaussians.opacities[18] = 1.0;
    let set = SurfelSet::new(&gaussians);
    assert!(bvh.update(&set));
    assert!(trace_sphere_of_rays(&set, &bvh) == trace_sphere_of_rays(&set, &Bvh::new(&set)));
}

#[test]
fn an_empty_scene_shows_nothing() {
    let set = SurfelSet::new(&Gaussians::default());
    let bvh = Bvh::new(&set);
    for search in [HitSearch::Tiles, HitSearch::SingleRays(&bvh)] {
        let (image, record) = camera::trace(&set, &cameras()[0], search, Keep::Record);
        assert!(
            image
                .pixels
                .iter()
                .all(|features| *features == eagpt_trace::Features::default())
        );
        assert_eq!(record.num_hits(), 0);
    }
}
