use super::super::emitters::with_emitters;
use super::super::receivers::Receivers;
use super::super::transport::TracedTransport;
use super::super::unlit::Unlit;
use super::*;
use eagpt_scene::files::Key;
use eagpt_scene::lamps::emits;
use eagpt_scene::light_basis::{LightGroups, NO_LIGHT};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussians, LightBasis};
use eagpt_testkit::gaussians::{look_at, material, sphere};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::start::Surface;
use glam::DVec3;

const RAYS: Directions = Directions {
    bsdf: 32,
    to_lights: 16,
};
const ALBEDO: f32 = 0.6;

/// A sphere seen from within. Of the share `north` of its area at the one pole and `south` at the
/// other the radiance is the first and the second of `lamps`; the rest reflects.
fn caps([north, south]: [f32; 2], lamps: [Vec3; 2]) -> Gaussians {
    sphere(6000, 2.0, |direction| {
        // Archimedes: a cap above z = 1 − 2f has the share f of the area.
        if direction.z > 1.0 - 2.0 * north {
            material(lamps[0], 1.0, Vec3::ZERO)
        } else if direction.z < 2.0 * south - 1.0 {
            material(lamps[1], 1.0, Vec3::ZERO)
        } else {
            // Radiance that must not count.
            material(Vec3::splat(50.0), 0.0, Vec3::splat(ALBEDO))
        }
    })
}

fn key() -> RandomKey {
    RandomKey::new(1, Purpose::Bake, 1)
}

fn trace(scene: &Gaussians) -> TracedTransport {
    let traced = (0..scene.len() as u32)
        .filter(|&i| !emits(scene.emissions[i as usize]))
        .map(|i| {
            let g = scene.get(i as usize);
            let surface = Surface {
                position: g.position,
                normal: -g.position.normalize(),
                offset: 0.3 * g.scale.x,
            };
            (i, surface)
        })
        .collect();
    let receivers = Receivers {
        traced,
        faint: Vec::new(),
        fronts: Vec::new(),
    };
    let mut traced = TracedTransport::new(Key::new(), RAYS, scene, receivers);
    let (scene, receivers) = (CpuScene::new(scene), &traced.receivers.traced);
    traced.matrix = TransportMatrix::trace(&scene, receivers, RAYS, key());
    traced
}

/// Inside a sphere every patch sees every other at the same `cos cos / r²`: light from a cap of
/// area share f is spread evenly, and with albedo a the radiance of the rest after K bounces is
/// `a L f Σ_{k<K} (a (1 − f))^k`.
#[test]
fn bounces_inside_a_sphere_follow_the_geometric_series() {
    let (share, radiance) = (0.25_f32, 3.0_f32);
    let scene = caps([share, 0.0], [Vec3::splat(radiance); 2]);
    let traced = trace(&scene);
    let light = Exchange::new(&traced.receivers, &traced.matrix, RAYS);
    let mut series = Series::new(scene.len(), 0);
    let mut expected = 0.0;
    for bounce in 1..=4 {
        series.add(&scene.albedos, &light, None);
        expected += ALBEDO * radiance * share * (ALBEDO * (1.0 - share)).powi(bounce - 1);
        let mean: f32 = traced
            .receivers
            .traced
            .iter()
            .map(|(i, _)| series.total[*i as usize].x)
            .sum::<f32>()
            / traced.receivers.traced.len() as f32;
        // 6000 × 32 directions leave 0.3 %; the soft rim of the cap and discs that do not quite
        // close 1 %.
        assert!(
            (mean / expected - 1.0).abs() < 0.015,
            "bounce {bounce}: {mean} instead of {expected}"
        );
    }
    let baked = with_emitters(&scene, &series.total);
    assert_eq!(baked[0], scene.radiances[0]);
}

/// Two caps, of which each alone lights the rest as the series has it; together they are all light.
#[test]
fn the_light_of_each_cap_follows_its_own_series() {
    let shares = [0.1, 0.2];
    let lamps = [Vec3::new(5.0, 2.0, 0.0), Vec3::new(1.0, 1.0, 4.0)];
    let scene = caps(shares, lamps);
    let groups = LightGroups {
        names: vec!["north".to_owned(), "south".to_owned()],
        of: (scene.iter())
            .map(|g| match (emits(g.emission), g.position.z > 0.0) {
                (false, _) => NO_LIGHT,
                (true, is_north) => u32::from(!is_north),
            })
            .collect(),
    };
    let traced = trace(&scene);
    let light = Exchange::new(&traced.receivers, &traced.matrix, RAYS);
    let parts = DirectParts {
        num: 2,
        direct: traced.direct_of(&scene, key(), &groups),
    };
    let bounces = 5;
    let solve = |parts| sum_of_bounces(&scene.albedos, &light, bounces, parts, &mut |_| ());
    let mut reflected = solve(Some(&parts));
    assert_eq!(reflected.total, solve(None).total);
    let unlit = Unlit {
        tracer: &CpuScene::new(&scene),
        sampled: &scene,
        lights: &groups,
        cameras: &[look_at(DVec3::ZERO, DVec3::X, 8, 8)],
        fronts: &[],
        directions: RAYS,
        key: key(),
    };
    let albedos = vec![Vec3::splat(ALBEDO); scene.len()];
    let num_rays = unlit.add(&scene, &albedos, &mut reflected.parts).unwrap();
    assert!(num_rays > 0);
    let emitting = ALBEDO * (1.0 - shares[0] - shares[1]);
    let series: f32 = (0..bounces).map(|k| emitting.powi(k as i32)).sum();
    let basis = LightBasis::new(&scene, &groups, &reflected.parts);
    for k in 0..2 {
        let expected = lamps[k] * (ALBEDO * shares[k] * series);
        let alone = basis.alone(k);
        let receivers = traced.receivers.traced.iter();
        let mean = receivers.map(|(i, _)| alone[*i as usize]).sum::<Vec3>()
            / traced.receivers.traced.len() as f32;
        let off = (mean - expected).abs().max_element() / expected.max_element();
        // Smaller caps have more rim.
        assert!(off < 0.02, "{k}: {mean} instead of {expected}");
        // The other cap receives as much, without its own light, and reflects at most its radiance.
        let expected = expected.min(lamps[1 - k]);
        let other: Vec<usize> = (0..scene.len())
            .filter(|&i| groups.of[i] as usize == 1 - k)
            .collect();
        let mean = other.iter().map(|&i| alone[i]).sum::<Vec3>() / other.len() as f32;
        let off = (mean - expected).abs().max_element() / expected.max_element();
        assert!(off < 0.03, "{k}, other cap: {mean} instead of {expected}");
    }
    // The sum is the bake: half floats within 2^-11, f32 beside that nothing.
    let baked = with_emitters(&scene, &reflected.total);
    for (sum, baked) in basis.radiances().iter().zip(&baked) {
        let off = (*sum - *baked).abs().max_element();
        assert!(
            off <= 5e-4 * baked.max_element(),
            "{sum} instead of {baked}"
        );
    }
}

/// Of a sphere seen from within whose Gaussians have two albedos by turns, light of the rest grows
/// without a limit if both are above 1, and does not if their mean is below it.
#[test]
fn light_that_grows_with_each_bounce_is_limited_and_other_is_not() {
    for ([a, b], is_limited) in [([1.3, 1.3], true), ([1.4, 0.2], false)] {
        let mut scene = caps([0.05, 0.0], [Vec3::ONE; 2]);
        let is_surface = |scene: &Gaussians, i: usize| !emits(scene.emissions[i]);
        for i in 0..scene.len() {
            let albedo = if i % 2 == 0 { a } else { b };
            scene.albedos[i] = Vec3::splat(albedo);
        }
        let before = scene.albedos.clone();
        let traced = trace(&scene);
        let light = Exchange::new(&traced.receivers, &traced.matrix, RAYS);
        let last_over_first = |scene: &Gaussians| {
            let bounces = sum_of_bounces(&scene.albedos, &light, 16, None, &mut |_| {}).bounces;
            bounces[15] / bounces[0]
        };
        assert_eq!(last_over_first(&scene) > 10.0, is_limited);
        let num = limit_growth(&mut scene, &light);
        if is_limited {
            // No Gaussian needs to be darker than a white surface.
            assert!(num > scene.len() / 2, "{num}");
            assert!(last_over_first(&scene) < 1.0);
            let darkest = (0..scene.len()).filter(|&i| is_surface(&scene, i));
            let darkest = darkest.map(|i| scene.albedos[i].x).fold(9.0, f32::min);
            assert!(darkest > 0.979, "{darkest}");
        } else {
            assert_eq!((num, &scene.albedos), (0, &before));
        }
    }
}
