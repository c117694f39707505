//! Rays against shapes and their tree.

use crate::room::bvh::Bvh;
use crate::room::shape::{Ball, Block, Drum, Ends, Quad, Shape};
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::{Mat3, Vec2, Vec3};

const ANYWHERE: [f32; 2] = [1e-4, f32::INFINITY];

fn stream(element: u32) -> impl FnMut() -> f32 {
    let mut random = RandomKey::new(1, Purpose::Furnish, 0).stream(element, 0);
    let mut left: Vec<f32> = Vec::new();
    move || {
        if left.is_empty() {
            left.extend(random.next_uniforms());
        }
        left.pop().unwrap_or(0.5)
    }
}

fn some_shapes(num: u32) -> Vec<Shape> {
    (0..num)
        .map(|i| {
            let mut next = stream(i);
            let mut vector = |scale: f32| (Vec3::new(next(), next(), next()) - 0.5) * scale;
            let at = vector(4.0);
            let axes = Mat3::from_rotation_z(vector(6.0).x) * Mat3::from_rotation_x(vector(6.0).y);
            let size = vector(0.6).abs() + 0.05;
            match i % 5 {
                0 => Shape::Quad(Quad::new(
                    at,
                    [
                        axes.x_axis * size.x,
                        axes.y_axis * size.y + axes.x_axis * 0.02,
                    ],
                )),
                1 => Shape::Block(Block {
                    centre: at,
                    half: 0.5 * size,
                    axes,
                }),
                2 => Shape::Ball(Ball {
                    centre: at,
                    radius: 0.5 * size.x,
                }),
                k => Shape::Drum(Drum {
                    base: at,
                    axes,
                    height: size.z,
                    radii: [size.x, size.y],
                    ends: if k == 3 { Ends::Open } else { Ends::Closed },
                }),
            }
        })
        .collect()
}

/// A ray at the front of a known point of a face meets that face at that point.
#[test]
fn rays_meet_the_points_they_aim_at() {
    for (index, shape) in (0..).zip(some_shapes(200)) {
        let mut next = stream(1000 + index);
        for face in 0..shape.num_faces() {
            if shape.area(face) == 0.0 {
                continue;
            }
            let st = Vec2::new(0.05 + 0.9 * next(), 0.05 + 0.9 * next());
            let point = shape.point(face, st);
            let [low, high] = shape.bounds();
            let air = Vec3::splat(1e-5);
            assert!(
                (point.position - low + air).min_element() >= 0.0,
                "{shape:?} {face}"
            );
            assert!(
                (high - point.position + air).min_element() >= 0.0,
                "{shape:?} {face}"
            );
            let aside = (Vec3::new(next(), next(), next()) - 0.5).normalize();
            let towards = (point.normal + 0.4 * aside).normalize();
            // Near enough that nothing of a convex shape, and little of an open one, stands
            // between.
            let reach = 0.01;
            let found = shape
                .meet(point.position + towards * reach, -towards, ANYWHERE)
                .unwrap_or_else(|| panic!("{shape:?} face {face} at {st} missed"));
            // Shapes of half a metre in single precision, far from grazing.
            assert!(
                (found.distance - reach).abs() < 2e-5,
                "{shape:?} {face}: {found:?}"
            );
            assert_eq!(found.face, face, "{shape:?}");
            let turned = found.st - st;
            let turned = Vec2::new(turned.x - turned.x.round(), turned.y);
            assert!(
                turned.abs().max_element() < 2e-3,
                "{shape:?} {face}: {} {st}",
                found.st
            );
            assert!(
                found.normal.dot(point.normal).abs() > 0.999,
                "{shape:?} {face}"
            );
        }
    }
}

/// Areas and uniform points: the mean of a linear function over them is its value at the centroid.
#[test]
fn points_are_uniform_over_a_cone() {
    let drum = Shape::Drum(Drum {
        base: Vec3::ZERO,
        axes: Mat3::IDENTITY,
        height: 1.0,
        radii: [0.5, 0.2],
        ends: Ends::Open,
    });
    let num = 4000;
    let mean: f32 = (0..num)
        .map(|i| {
            let uniform = Vec2::new(0.3, (i as f32 + 0.5) / num as f32);
            drum.point(0, drum.uniform_st(0, uniform)).position.z
        })
        .sum::<f32>()
        / num as f32;
    // Height of the centroid of a cone's mantle: h (r0 + 2 r1) / 3 (r0 + r1).
    let wanted = (0.5 + 2.0 * 0.2) / (3.0 * 0.7);
    assert!((mean - wanted).abs() < 1e-4, "{mean} {wanted}");
    // π (r0 + r1) times the slant height.
    let area = std::f32::consts::PI * 0.7 * 1.0_f32.hypot(0.3);
    assert!((drum.area(0) - area).abs() < 1e-6);
}

#[test]
fn the_tree_finds_what_brute_force_finds() {
    let shapes = some_shapes(300);
    let tree = Bvh::new(&shapes);
    let mut num_hits = 0;
    for i in 0..3000 {
        let mut next = stream(5000 + i);
        let mut vector = |scale: f32| (Vec3::new(next(), next(), next()) - 0.5) * scale;
        let (origin, direction) = (vector(6.0), vector(1.0).normalize());
        let range = [1e-4, if i % 3 == 0 { 1.5 } else { f32::INFINITY }];
        let all = shapes
            .iter()
            .filter_map(|shape| shape.meet(origin, direction, range));
        let wanted = all.map(|crossing| crossing.distance).reduce(f32::min);
        let found = tree.nearest(&shapes, origin, direction, range);
        assert_eq!(found.map(|(_, crossing)| crossing.distance), wanted);
        assert_eq!(
            tree.is_free(&shapes, origin, direction, range),
            wanted.is_none()
        );
        num_hits += usize::from(wanted.is_some());
    }
    assert!(num_hits > 500, "{num_hits}");
}
