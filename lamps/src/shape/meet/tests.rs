use super::*;
use glam::Quat;
use std::f32::consts::PI;

#[test]
fn the_rays_of_a_pixel_are_in_rows_and_columns_of_their_own() {
    let middles: Vec<f32> = (0..16_u8).map(|i| (f32::from(i) + 0.5) / 16.0).collect();
    for axis in [0, 1] {
        let mut places = PLACES.map(|place| place[axis]);
        places.sort_by(f32::total_cmp);
        assert_eq!(places.as_slice(), middles);
    }
}

/// Whole rows of pixels across shapes: as many rays of each are met as one by one.
#[test]
fn what_a_pixel_shows_is_what_its_rays_meet() {
    let rotation = Quat::from_scaled_axis(Vec3::new(0.4, -0.2, 0.3));
    let (centre, size) = (Vec3::new(0.02, -0.01, 1.0), [0.5, 0.3]);
    let flat = Flat {
        centre,
        // Towards the point that sees it.
        rotation: rotation * Quat::from_rotation_x(PI),
        size,
    };
    let tube = Shape::Tube {
        centre,
        rotation,
        radius: 0.2,
        length: 0.4,
        taper: -0.3,
        is_open: false,
    };
    let ball = Shape::Ball {
        centre,
        radius: 0.25,
    };
    let cuboid = Shape::Box {
        centre,
        rotation,
        size: Vec3::new(0.3, 0.4, 0.35),
    };
    for shape in [
        Shape::Rectangle(flat),
        Shape::Ellipse(flat),
        tube,
        ball,
        cuboid,
    ] {
        let seen = ShapeFrom::new(&shape, Vec3::ZERO);
        let mut nums = [0; 3];
        for i in 0..4096 {
            let (x, y) = ((i % 64) as f32 - 32.0, (i / 64) as f32 - 32.0);
            let direction =
                |[dx, dy]: [f32; 2]| Vec3::new(0.02 * (x + dx), 0.02 * (y + dy), 1.0).normalize();
            let rays = PLACES.map(direction);
            let met: Vec<f32> = rays.iter().filter_map(|ray| seen.meet(*ray)).collect();
            let (share, farthest) = seen.cover(&PixelRays::new(direction));
            assert_eq!(share, met.len() as f32 / 16.0, "{shape:?} {x} {y}");
            assert_eq!(farthest, met.iter().copied().fold(0.0, f32::max));
            nums[usize::from(share > 0.0) + usize::from(share == 1.0)] += 1;
        }
        assert!(nums.iter().all(|num| *num > 50), "{nums:?}");
    }
}

/// The mean projected area of a convex body over all directions is a quarter of its surface
/// (Cauchy): of rays in random directions through a large ball as many meet it.
#[test]
fn as_many_rays_meet_a_shape_as_its_area_says() {
    let ball = Shape::Ball {
        centre: Vec3::new(0.1, -0.2, 0.3),
        radius: 0.5,
    };
    let tube = Shape::Tube {
        centre: Vec3::new(-0.1, 0.1, 0.0),
        rotation: Quat::from_scaled_axis(Vec3::new(0.4, -0.7, 0.2)),
        radius: 0.2,
        length: 1.1,
        taper: 0.4,
        is_open: false,
    };
    let flat = Flat {
        centre: Vec3::new(0.2, 0.0, -0.1),
        rotation: Quat::from_scaled_axis(Vec3::new(-0.3, 0.9, 0.5)),
        size: [0.8, 0.5],
    };
    let cuboid = Shape::Box {
        centre: Vec3::new(0.1, 0.05, -0.2),
        rotation: Quat::from_scaled_axis(Vec3::new(-0.2, 0.5, 0.9)),
        size: Vec3::new(0.3, 0.5, 0.9),
    };
    for shape in [
        ball,
        tube,
        cuboid,
        Shape::Rectangle(flat),
        Shape::Ellipse(flat),
    ] {
        let num = 200_000;
        let mut met = 0;
        for i in 0..num {
            // A spiral of directions, and for each a point of the disc of radius 1 across it.
            let z = 1.0 - (2 * i + 1) as f32 / num as f32;
            let angle = (f64::from(i) * 2.399_963_229_728_653).rem_euclid(std::f64::consts::TAU);
            let (sin, cos) = (angle as f32).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            let direction = Vec3::new(flat * cos, flat * sin, z);
            let (a, b) = direction.any_orthonormal_pair();
            let r = (f64::from(i) * 0.754_877_666_246_69).fract().sqrt() as f32;
            let turn = (f64::from(i) * 0.569_840_290_998_05).fract() as f32 * 2.0 * PI;
            let origin = a * (r * turn.cos()) + b * (r * turn.sin()) - direction * 3.0;
            met += u32::from(shape.meet(origin, direction).is_some());
        }
        let projected = met as f32 / num as f32 * PI;
        // A flat shape is met from one side alone: half of its area's quarter of both sides.
        let expected = 0.25 * shape.area();
        assert!(
            (projected / expected - 1.0).abs() < 0.02,
            "{shape:?}: {projected} instead of {expected}"
        );
    }
}

/// A disc looks as large as the ball of its radius from where it faces, and half as large in the
/// mean; what is convex, a quarter of its surface.
#[test]
fn mean_projections_are_those_of_closed_forms() {
    let disc = Flat {
        centre: Vec3::ZERO,
        rotation: Quat::IDENTITY,
        size: [0.6; 2],
    };
    let ball = Shape::Ball {
        centre: Vec3::ZERO,
        radius: 0.3,
    };
    let cube = Shape::Box {
        centre: Vec3::ZERO,
        rotation: Quat::IDENTITY,
        size: Vec3::splat(0.2),
    };
    let circle = PI * 0.09;
    for (shape, wanted) in [
        (Shape::Ellipse(disc), 0.5 * circle),
        (ball, circle),
        (cube, 1.5 * 0.04),
    ] {
        assert!((shape.mean_projection() / wanted - 1.0).abs() < 1e-6);
    }
}

/// Through the open end of a tube its inside is seen, which does not shine, from afar and from near.
#[test]
fn open_tubes_are_met_from_without_alone() {
    let tube = |is_open: bool| Shape::Tube {
        centre: Vec3::new(0.0, 0.0, 1.0),
        rotation: Quat::IDENTITY,
        radius: 0.2,
        length: 0.4,
        taper: -0.2,
        is_open,
    };
    let cases = [
        // From the side, and from above onto the outside of the wider end.
        (Vec3::new(2.0, 0.0, 1.0), Vec3::new(0.0, 0.0, 1.0), true),
        (Vec3::new(2.0, 0.0, 2.0), Vec3::new(0.2, 0.0, 1.0), true),
        // Into either end, and out through the other one.
        (Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.05, 0.0, 1.2), false),
        (Vec3::new(0.5, 0.0, 0.0), Vec3::new(-0.05, 0.0, 0.8), false),
        (Vec3::new(0.0, 0.0, 2.0), Vec3::new(0.0, 0.0, 0.0), false),
    ];
    for (eye, at, is_met) in cases {
        let direction = (at - eye).normalize();
        let closed = tube(false).meet(eye, direction);
        assert!(closed.is_some(), "{eye} {at}");
        let met = tube(true).meet(eye, direction);
        assert_eq!(met, closed.filter(|_| is_met), "{eye} {at}");
    }
    assert!(tube(true).area() < tube(false).area());
    assert_eq!(tube(false).opened(), Some(tube(true)));
    assert_eq!(tube(true).opened(), None);
}
