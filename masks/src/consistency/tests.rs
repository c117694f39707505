use super::*;
use glam::{DAffine3, DMat3, DVec3};

/// Cameras side by side that look along +z (x right, y down) at a wall two units away.
fn camera(x: f64) -> Camera {
    Camera {
        width: 40,
        height: 30,
        fx: 40.0,
        fy: 40.0,
        cx: 20.0,
        cy: 15.0,
        world_from_camera: DAffine3::from_mat3_translation(
            DMat3::IDENTITY,
            DVec3::new(x, 0.0, 0.0),
        ),
    }
}

/// A view at `x` of that wall with a lamp at world x from −0.2 to 0.2 and, if it is there, a
/// reflection that moves as the viewer does.
fn sight(x: f64, lamp: bool, reflection: bool) -> Sight {
    let camera = camera(x);
    let depth = Image::filled(40, 30, [2.0]);
    let mask = Mask::from_fn(40, 30, |column, row| {
        let world = 2.0 * (f64::from(column) + 0.5 - 20.0) / 40.0 + x;
        let on_lamp = lamp && world.abs() < 0.2 && (5..10).contains(&row);
        // Twice as far to the side as the viewer: as an image of something behind the wall.
        let on_reflection = reflection && (world - 2.0 * x).abs() < 0.1 && (20..24).contains(&row);
        on_lamp || on_reflection
    });
    let regions = mask.regions();
    let regions = regions.iter();
    Sight {
        regions: regions
            .map(|region| places(region, (40, 30), &mask, &camera, &depth))
            .collect(),
        camera,
        depth,
        mask: Some(mask),
    }
}

#[test]
fn lamps_are_confirmed_and_reflections_are_not() {
    let sights: Vec<Sight> = [-0.4, -0.2, 0.0, 0.2, 0.4]
        .map(|x| sight(x, true, true))
        .into();
    let found = compare(&sights, 0.5);
    for support in &found.support {
        let verdicts: Vec<Verdict> = support.iter().map(|s| s.verdict(0.5)).collect();
        assert_eq!(verdicts, [Verdict::Confirmed, Verdict::Inconsistent]);
        assert_eq!(support[0].share(), Some(1.0));
        assert_eq!(support[0].num_views, 4);
    }
    assert_eq!(found.missed, [None; 5]);
}

#[test]
fn a_view_that_lacks_a_lamp_is_told() {
    let mut sights: Vec<Sight> = [-0.2, 0.0, 0.2].map(|x| sight(x, true, false)).into();
    sights.push(sight(0.1, false, false));
    assert_eq!(compare(&sights, 0.5).missed, [None, None, None, Some(1.0)]);
    // No mask at all is not an empty mask.
    sights[3].mask = None;
    assert_eq!(compare(&sights, 0.5).missed, [None; 4]);
}

#[test]
fn what_is_hidden_or_behind_is_not_seen() {
    let mut sights = vec![sight(0.0, true, false), sight(0.1, false, false)];
    sights[1].depth = Image::filled(40, 30, [1.0]);
    let found = compare(&sights, 0.5);
    assert_eq!(found.support[0][0], Support::default());
    assert_eq!(found.support[0][0].verdict(0.5), Verdict::Unseen);
    let at = |z: f32, step: [Vec3; 2]| {
        let point = Vec3::new(0.0, 0.0, z);
        let neighbours = step.map(|step| point + step);
        sights[0].pixel_of(&Place { point, neighbours })
    };
    let facing = [Vec3::X * 0.05, Vec3::Y * 0.05];
    assert_eq!(at(2.0, facing), Some([20, 15]));
    assert_eq!(at(-2.0, facing), None);
    // From behind, and with a tenth of the area.
    assert_eq!(at(2.0, [facing[1], facing[0]]), None);
    assert_eq!(at(2.0, [facing[0], 0.1 * facing[1]]), None);
}

#[test]
fn large_views_are_compared_at_a_bounded_size() {
    let mut large = camera(0.0);
    (large.width, large.height) = (6000, 4000);
    let small = reduced(&large);
    assert_eq!((small.width, small.height), (540, 360));
    // A single pixel survives.
    let mask = Mask::from_fn(6000, 4000, |x, y| (x, y) == (5999, 3999));
    assert_eq!(
        reduced_mask(&mask, &small),
        Mask::from_fn(540, 360, |x, y| (x, y) == (539, 359))
    );
    let same = reduced(&camera(0.0));
    assert_eq!((same.width, same.height), (40, 30));
}

#[test]
fn places_lie_inside_where_the_pixels_look() {
    let mask = Mask::from_fn(40, 30, |x, y| (10..13).contains(&x) && y < 3);
    let region = &mask.regions()[0];
    let (camera, depth) = (camera(0.0), Image::filled(40, 30, [2.0]));
    let found = places(region, (40, 30), &mask, &camera, &depth);
    // The middle column, and the top row, whose lamp may go on beyond the picture.
    assert_eq!(found.len(), 2);
    let expected = Vec3::new(2.0 * -8.5 / 40.0, 2.0 * -14.5 / 40.0, 2.0);
    assert!((found[0].point - expected).length() < 1e-6, "{found:?}");
    let step = found[0].neighbours[0] - found[0].point;
    assert!((step - Vec3::X * 0.05).length() < 1e-6);
    let unknown = Image::filled(40, 30, [0.0]);
    assert!(places(region, (40, 30), &mask, &camera, &unknown).is_empty());
    let thin = Mask::from_fn(40, 30, |x, y| x > 10 && (4..6).contains(&y));
    assert!(places(&thin.regions()[0], (40, 30), &thin, &camera, &depth).is_empty());
}
