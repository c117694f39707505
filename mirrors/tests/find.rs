//! Mirrors in a room of patterned walls, photographed as they are and trained in three ways.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use eagpt_eval::psnr_srgb;
use eagpt_mirrors::{Evidence, Mirror, Room, find, pixels, polish};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::{Camera, Gaussian, Gaussians, Gloss, Image, View};
use eagpt_testkit::gaussians::look_at;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::Integrator;
use eagpt_trace::{Device, LightOptions, Ray};
use glam::{DVec3, Vec3};

/// The room reaches from minus this to this, metres; the mirror is 2 cm before its wall of most y.
const HALF: Vec3 = Vec3::new(2.0, 1.5, 1.2);
const PLANE: f32 = 1.48;
const REFLECTANCE: Vec3 = Vec3::new(0.9, 0.85, 0.8);

fn mirror(is_round: bool) -> Mirror {
    Mirror {
        centre: Vec3::new(0.3, PLANE, 0.1),
        edges: [Vec3::X * 1.4, Vec3::Z * 0.9],
        is_round,
        reflectance: REFLECTANCE,
        num_views: 0,
        explained: 0.0,
    }
}

/// A wall in squares of some 25 cm, whose colours `salt` changes.
fn wall(centre: Vec3, edges: [Vec3; 2], salt: u32) -> impl Iterator<Item = Gaussian> {
    let discs = Surface {
        solid: Solid::Quad { centre, edges },
        material: Material {
            albedo: Vec3::splat(0.5),
            radiance: None,
            gloss: Gloss::NONE,
        },
        spacing: Some(0.08),
    };
    let discs: Vec<Gaussian> = discs.discs().iter().collect();
    discs.into_iter().map(move |disc| {
        let square = (disc.position * 4.0 + 20.0).as_uvec3();
        let number = square.x * 7 + square.y * 13 + square.z * 29 + salt;
        let level = |k: u32| 0.1 + 0.8 * ((number * k) % 11) as f32 / 11.0;
        Gaussian {
            radiance: Vec3::new(level(3), level(5), level(8)),
            ..disc
        }
    })
}

/// The room, around `middle`.
fn room(middle: Vec3, salt: u32) -> Vec<Gaussian> {
    let [x, y, z] = [Vec3::X * HALF.x, Vec3::Y * HALF.y, Vec3::Z * HALF.z];
    [(x, y, z), (y, z, x), (z, x, y)]
        .into_iter()
        .flat_map(|(out, u, v)| [(out, u, v), (-out, v, u)])
        .flat_map(|(out, u, v)| wall(middle + out, [2.0 * u, 2.0 * v], salt))
        .collect()
}

fn is_in(mirror: &Mirror, point: Vec3) -> bool {
    mirror
        .meet(Vec3::new(point.x, 0.0, point.z), Vec3::Y)
        .is_some()
}

/// The room with a hole behind a mirror.
fn open_room(mirror: &Mirror) -> impl Iterator<Item = Gaussian> {
    let is_behind = |g: &Gaussian| g.position.y > 1.4 && is_in(mirror, g.position);
    room(Vec3::ZERO, 0)
        .into_iter()
        .filter(move |g| !is_behind(g))
}

/// A mirror as training has it: the reflected room behind its wall.
fn reflected_room(mirror: &Mirror) -> Gaussians {
    let beyond = room(Vec3::ZERO, 0).into_iter().map(|g| Gaussian {
        position: g.position * Vec3::new(1.0, -1.0, 1.0) + Vec3::Y * 2.0 * PLANE,
        rotation: glam::Quat::from_xyzw(-g.rotation.x, g.rotation.y, -g.rotation.z, g.rotation.w),
        radiance: g.radiance * REFLECTANCE,
        ..g
    });
    // The reflected wall behind the mirror would hide all.
    let beyond = beyond.filter(|g| g.position.y > 1.6);
    open_room(mirror).chain(beyond).collect()
}

/// Or grey paint on its plane.
fn painted_room(mirror: &Mirror) -> Gaussians {
    let [u, v] = mirror.edges;
    let paint = wall(mirror.centre, [u, v], 0).filter(|g| is_in(mirror, g.position));
    let paint = paint.map(|g| Gaussian {
        radiance: Vec3::splat(0.4),
        ..g
    });
    open_room(mirror).chain(paint).collect()
}

fn cameras() -> Vec<Camera> {
    (0..14)
        .map(|i| {
            let angle = 0.45 * f64::from(i);
            let origin = DVec3::new(
                1.1 * angle.cos(),
                0.5 * angle.sin() - 0.3,
                0.3 * angle.sin(),
            );
            let to_mirror = DVec3::new(0.6 * (2.0 * angle).sin(), 1.5, 0.2 * angle.cos());
            let target = if i % 3 == 2 {
                DVec3::new(-1.0, -1.5, 0.0)
            } else {
                to_mirror
            };
            look_at(origin, target, 96, 72)
        })
        .collect()
}

/// A photograph of the room and its `mirror`.
fn photograph(mirror: Option<&Mirror>, camera: Camera) -> View {
    let scene = CpuScene::new(&room(Vec3::ZERO, 0).into_iter().collect());
    let frame = camera.ray_frame();
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    let light = |(x, y): (u32, u32)| {
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        let seen = |origin: Vec3, direction: Vec3| {
            scene
                .trace(&Ray::free(origin.to_array(), direction.to_array()))
                .radiance()
        };
        let met = mirror.and_then(|mirror| mirror.meet(frame.origin, direction));
        let light = met.map_or_else(
            || seen(frame.origin, direction),
            |t| {
                let mirrored = direction * Vec3::new(1.0, -1.0, 1.0);
                REFLECTANCE * seen(frame.origin + direction * t, mirrored)
            },
        );
        light.to_array()
    };
    let radiance = Image::from_pixels(camera.width, camera.height, pixels.map(light).collect());
    View::new(String::new(), camera, radiance.unwrap())
}

/// Mirrors found in photographs of a room with `mirror`, and the photographs, where `trained` is
/// what training has made of it.
fn found(mirror: Option<&Mirror>, trained: &Gaussians) -> (Vec<Mirror>, Vec<View>, Evidence) {
    let tracer = Device::Cpu.scene(trained).unwrap();
    let cameras = cameras();
    let mut evidence = Evidence::new(cameras.iter().map(Camera::num_pixels).sum());
    let views: Vec<View> = cameras
        .iter()
        .map(|camera| photograph(mirror, *camera))
        .collect();
    for view in &views {
        evidence.add(view, &tracer.gbuffer(&view.camera).unwrap());
    }
    (
        find(&evidence, Vec3::Z, &*tracer, 0).unwrap(),
        views,
        evidence,
    )
}

/// Checks place, size, outline and reflectance.
fn check(found: &[Mirror], wanted: &Mirror) {
    assert_eq!(found.len(), 1, "{found:?}");
    let found = &found[0];
    // Outlines are made of cells of 4 cm, and discs of the wall reach 6 cm into its hole.
    assert!(found.centre.distance(wanted.centre) < 0.04, "{found:?}");
    for (found, wanted) in found.edges.iter().zip(wanted.edges) {
        assert!((found.length() - wanted.length()).abs() < 0.16, "{found:?}");
    }
    assert!((found.centre.y - PLANE).abs() < 0.015, "{found:?}");
    assert!(found.normal().dot(Vec3::NEG_Y) > 0.9998, "{found:?}");
    assert_eq!(found.is_round, wanted.is_round);
    let off = (found.reflectance - REFLECTANCE).abs().max_element();
    assert!(off < 0.04, "{found:?}");
}

#[test]
fn a_room_behind_the_wall_becomes_a_mirror_that_shows_the_same() {
    let wanted = mirror(false);
    let trained = reflected_room(&wanted);
    let (found, views, evidence) = found(Some(&wanted), &trained);
    check(&found, &wanted);
    let tracer = Device::Cpu.scene(&trained).unwrap();
    let mut room = Room::new(&found, &evidence, &trained, &*tracer);
    for view in &views {
        room.add(view).unwrap();
    }
    let edit = room.edit();
    let mut scene = edit.applied(&trained);
    let first = scene.len() - edit.fixed.len();
    // Of the reflected room is left what no view shows.
    let num_behind = |scene: &Gaussians| scene.positions.iter().filter(|p| p.y > 1.7).count();
    let (after, before) = (num_behind(&scene), num_behind(&trained));
    assert!(10 * after < 6 * before, "{after} of {before}");
    let own = scene.positions[..first]
        .iter()
        .filter(|p| p.y < 1.4)
        .count();
    assert_eq!(own, trained.positions.iter().filter(|p| p.y < 1.4).count());

    polish(&found, &mut scene, first);
    assert!(scene.gloss[first..].iter().all(Gloss::is_mirror));
    assert!(!scene.gloss[..first].iter().any(Gloss::is_some));
    let tracer = Device::Cpu.scene(&scene).unwrap();
    let (mut num_shown, mut psnrs) = (0, Vec::new());
    for view in &views {
        let rendered = tracer
            .render(
                &view.camera,
                &Integrator::ZeroBounce,
                &LightOptions::default(),
            )
            .unwrap();
        let shown = pixels(&found, &view.camera, &rendered.features);
        let truly = (0..view.camera.num_pixels()).map(|i| {
            let (x, y) = (i as u32 % 96, i as u32 / 96);
            let frame = view.camera.ray_frame();
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            wanted.meet(frame.origin, direction).is_some()
        });
        let Some(shown) = shown else {
            assert!(!truly.clone().any(|shows| shows));
            continue;
        };
        let wrong = shown
            .iter()
            .zip(truly)
            .filter(|(shown, truly)| *shown != truly)
            .count();
        // 7 cm of the rim, three pixels at most, and one that is taken on purpose.
        let rim = 4 * 2 * (96 + 72);
        assert!(wrong < rim, "{wrong}");
        num_shown += shown.iter().filter(|shown| **shown).count();
        psnrs.push(psnr_srgb(&view.radiance, &rendered.radiance));
    }
    // The rim, where the wall's discs reached into the hole, and squares moved by less than 1 cm.
    let psnr = psnrs.iter().sum::<f64>() / psnrs.len() as f64;
    assert!(psnr > 25.0, "{psnr}");
    assert!(num_shown > 5000, "{num_shown}");
}

#[test]
fn paint_on_the_wall_becomes_a_round_mirror() {
    let wanted = mirror(true);
    let (found, ..) = found(Some(&wanted), &painted_room(&wanted));
    check(&found, &wanted);
}

/// Of the squares that it shows, training has learned four of eleven.
#[test]
fn a_large_mirror_is_found_though_it_explains_little() {
    let wanted = mirror(false);
    let is_learned = |g: &Gaussian| {
        let square = (g.position * 4.0 + 20.0).as_uvec3();
        (square.x * 5 + square.y * 3 + square.z * 7) % 11 < 4
    };
    let learned = |g: Gaussian| match is_learned(&g) {
        true => g,
        false => Gaussian {
            radiance: Vec3::splat(0.4),
            ..g
        },
    };
    let trained: Gaussians = painted_room(&wanted).iter().map(learned).collect();
    let (found, ..) = found(Some(&wanted), &trained);
    check(&found, &wanted);
    assert!((0.2..0.35).contains(&found[0].explained), "{found:?}");
}

#[test]
fn an_opening_to_another_room_and_a_wall_are_no_mirrors() {
    let trained: Gaussians = room(Vec3::ZERO, 0).into_iter().collect();
    assert_eq!(found(None, &trained).0, []);

    // Photographed as it is trained: a hole in the wall and a room of other colours behind it.
    let hole = mirror(false);
    let beyond = room(Vec3::Y * 3.1, 5)
        .into_iter()
        .filter(|g| g.position.y > 1.6);
    let trained: Gaussians = open_room(&hole).chain(beyond).collect();
    let tracer = Device::Cpu.scene(&trained).unwrap();
    let cameras = cameras();
    let mut evidence = Evidence::new(cameras.iter().map(Camera::num_pixels).sum());
    for camera in cameras {
        let seen = tracer.gbuffer(&camera).unwrap();
        let view = View {
            radiance: seen.radiance(),
            ..photograph(None, camera)
        };
        evidence.add(&view, &seen);
    }
    assert_eq!(find(&evidence, Vec3::Z, &*tracer, 0).unwrap(), []);
}
