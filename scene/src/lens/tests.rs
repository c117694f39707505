//! Lenses against COLMAP's own numbers, and against themselves.

use super::undistort::{Pinhole, distort};
use super::*;
use crate::image::Image;
use glam::DMat3;

/// A lens of `testdata/lenses.json` with the points and pixels of `testdata/lenses.bin`.
struct Reference {
    lens: Lens,
    projections: Vec<(DVec3, DVec2)>,
}

const NUM_POINTS: usize = 250;
const RECORD: usize = 3 * 2 + 2 * 8;

fn references() -> Vec<Reference> {
    let listed: serde_json::Value =
        serde_json::from_str(include_str!("testdata/lenses.json")).unwrap();
    let bytes = include_bytes!("testdata/lenses.bin");
    let listed = listed.as_array().unwrap();
    assert_eq!(bytes.len(), listed.len() * NUM_POINTS * RECORD);
    let lenses = listed.iter().zip(bytes.chunks_exact(NUM_POINTS * RECORD));
    lenses
        .map(|(entry, records)| {
            let model: LensModel = entry["model"].as_str().unwrap().parse().unwrap();
            assert_eq!(i64::from(model.id()), entry["id"].as_i64().unwrap());
            let numbers = entry["params"].as_array().unwrap();
            let params: Vec<f64> = numbers.iter().map(|p| p.as_f64().unwrap()).collect();
            let size = ["width", "height"].map(|key| entry[key].as_u64().unwrap() as u32);
            let records = records.chunks_exact(RECORD);
            Reference {
                lens: Lens::new(model, size.into(), &params).unwrap(),
                projections: records.map(record).collect(),
            }
        })
        .collect()
}

fn record(bytes: &[u8]) -> (DVec3, DVec2) {
    let axis = |at: usize| f64::from(i16::from_le_bytes([bytes[2 * at], bytes[2 * at + 1]]));
    let pixel = |at: usize| f64::from_le_bytes(bytes[6 + 8 * at..14 + 8 * at].try_into().unwrap());
    let point = DVec3::new(axis(0), axis(1), axis(2)) / 8192.0;
    (point, DVec2::new(pixel(0), pixel(1)))
}

#[test]
fn every_model_agrees_with_colmap() {
    let references = references();
    for model in LensModel::all() {
        let of_model = references.iter().filter(|r| r.lens.model() == model);
        let (mut num_points, mut worst_pixel, mut worst_ray) = (0, 0.0_f64, 0.0_f64);
        for Reference { lens, projections } in of_model {
            for &(point, pixel) in projections {
                let own = lens.project(point).unwrap_or(DVec2::INFINITY);
                worst_pixel = worst_pixel.max((own - pixel).length());
                let ray = lens.unproject(pixel).unwrap_or(DVec3::ZERO);
                worst_ray = worst_ray.max((ray - point.normalize()).length());
                num_points += 1;
            }
        }
        assert_eq!(num_points, 1000, "{model}");
        // FOV of omega = 1e-5: COLMAP has a series there, 1e-10 off at the edge. All others agree
        // to 1e-12 of 640 pixels.
        let (max_pixel, max_ray) = if model == LensModel::Fov {
            (1e-7, 1e-9)
        } else {
            (1e-9, 1e-11)
        };
        assert!(worst_pixel < max_pixel, "{model}: {worst_pixel:e} pixels");
        assert!(worst_ray < max_ray, "{model}: {worst_ray:e}");
    }
}

/// Directions all around, evenly spread (a Fibonacci lattice).
fn directions(num: u32) -> impl Iterator<Item = DVec3> {
    (0..num).map(move |i| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(num);
        let angle = f64::from(i) * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let rho = (1.0 - z * z).sqrt();
        DVec3::new(rho * angle.cos(), rho * angle.sin(), z)
    })
}

#[test]
fn unproject_inverts_project_in_the_valid_field() {
    for Reference { lens, .. } in references() {
        let mut num_valid = 0;
        for direction in directions(20_000) {
            let Some(pixel) = lens.project(direction * 1.7) else {
                continue;
            };
            // Far beyond the image a perspective projection keeps few digits of the angle.
            let (width, height) = lens.size();
            let size = DVec2::new(f64::from(width), f64::from(height));
            if !(pixel.abs().cmplt(4.0 * size)).all() {
                continue;
            }
            let ray = lens.unproject(pixel);
            let error = ray.map_or(f64::INFINITY, |ray| (ray - direction).length());
            // 1e-8 is promised. It is met with less, but not where the field ends and the
            // projection hardly moves.
            assert!(
                error < 1e-8,
                "{:?} {direction} {pixel}: {ray:?}",
                lens.model()
            );
            num_valid += 1;
        }
        assert!(num_valid > 400, "{:?} {num_valid}", lens.model());
    }
}

#[test]
fn pixels_of_the_image_come_back() {
    for Reference { lens, .. } in references() {
        let (width, height) = lens.size();
        let mut num_seen = 0;
        for i in 0..=20 {
            for j in 0..=20 {
                let at = DVec2::new(f64::from(i) / 20.0, f64::from(j) / 20.0);
                let pixel = at * DVec2::new(f64::from(width), f64::from(height));
                let Some(ray) = lens.unproject(pixel) else {
                    continue;
                };
                // At the seam of a sphere both ends are right.
                if lens.model() == LensModel::Equirectangular && ray.z < 0.0 && ray.x.abs() < 1e-9 {
                    continue;
                }
                let back = lens.project(ray).unwrap_or(DVec2::INFINITY);
                assert!(
                    (back - pixel).length() < 1e-8,
                    "{:?} {pixel} {back}",
                    lens.model()
                );
                num_seen += 1;
            }
        }
        assert!(num_seen > 80, "{:?}: {num_seen} of 441", lens.model());
    }
}

#[test]
fn beyond_the_turn_of_a_polynomial_nothing_is_seen() {
    // r (1 − 0.2 r²) grows up to r = √(1 / 0.6) and ends at 2/3 of that.
    let lens = Lens::new(
        LensModel::SimpleRadial,
        (100, 100),
        &[50.0, 50.0, 50.0, -0.2],
    )
    .unwrap();
    let turn = (1.0_f64 / 0.6).sqrt();
    let end = 50.0 + 50.0 * turn * 2.0 / 3.0;
    for (x, seen) in [(0.999, true), (1.001, false), (1.5, false)] {
        let point = DVec3::new(x * turn, 0.0, 1.0);
        assert_eq!(lens.project(point).is_some(), seen, "{x}");
    }
    assert!(lens.unproject(DVec2::new(end - 1e-3, 50.0)).is_some());
    assert!(lens.unproject(DVec2::new(end + 1e-3, 50.0)).is_none());
}

#[test]
fn fisheye_lenses_see_behind_themselves() {
    let lens = Lens::new(LensModel::SimpleFisheye, (640, 640), &[100.0, 320.0, 320.0]).unwrap();
    let (sin, cos) = 2.5_f64.sin_cos();
    let pixel = lens.project(DVec3::new(sin, 0.0, cos)).unwrap();
    assert!((pixel - DVec2::new(570.0, 320.0)).length() < 1e-12 * 570.0);
    let ray = lens.unproject(pixel).unwrap();
    assert!((ray - DVec3::new(sin, 0.0, cos)).length() < 1e-14);
    assert_eq!(lens.unproject(DVec2::new(320.0 + 315.0, 320.0)), None);
    assert_eq!(lens.project(DVec3::new(0.0, 0.0, -1.0)), None);
    for bad in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
        assert_eq!(lens.project(bad).filter(|p| p.is_finite()), None);
    }
}

#[test]
fn a_resized_lens_shows_the_same() {
    for Reference { lens, projections } in references() {
        let (width, height) = lens.size();
        let resized = lens.resized((width / 2, height * 3)).unwrap();
        let scale = DVec2::new(f64::from(width / 2) / f64::from(width), 3.0);
        for &(point, pixel) in projections.iter().step_by(10) {
            let got = resized.project(point).unwrap();
            assert!((got - pixel * scale).length() < 1e-6, "{:?}", lens.model());
        }
        assert_eq!(lens.resized((width, height)), Ok(lens));
    }
}

#[test]
fn parameters_that_cannot_be_are_told() {
    use LensModel::*;
    for (model, size, params, part) in [
        (
            Pinhole,
            (9, 9),
            &[1.0, 1.0, 4.0][..],
            "3 parameters, but PINHOLE has 4: fx, fy, cx, cy",
        ),
        (Pinhole, (9, 0), &[1.0, 1.0, 4.0, 4.0], "9x0"),
        (Pinhole, (9, 9), &[1.0, -1.0, 4.0, 4.0], "not above 0"),
        (SimplePinhole, (9, 9), &[0.0, 4.0, 4.0], "f is [0.0]"),
        (
            SimpleRadial,
            (9, 9),
            &[1.0, 4.0, 4.0, f64::NAN],
            "k1 is NaN",
        ),
        (Fov, (9, 9), &[1.0, 1.0, 4.0, 4.0, 4.0], "omega"),
        (Eucm, (9, 9), &[1.0, 1.0, 4.0, 4.0, 2.0, 1.0], "alpha"),
        (Eucm, (9, 9), &[1.0, 1.0, 4.0, 4.0, 0.5, 0.0], "beta"),
        (Equirectangular, (9, 9), &[0.0, 9.0], "not above 0"),
    ] {
        let problem = Lens::new(model, size, params).unwrap_err();
        assert!(problem.contains(part), "{problem}");
    }
}

/// A smooth picture of directions.
fn picture(lens_size: (u32, u32), ray: impl Fn(DVec2) -> Option<DVec3>) -> Image<1> {
    let pixels = (0..lens_size.1)
        .flat_map(|y| (0..lens_size.0).map(move |x| DVec2::new(f64::from(x), f64::from(y)) + 0.5))
        .map(|pixel| {
            let value = ray(pixel).map_or(0.0, |ray| {
                let d = ray.normalize();
                1.0 + 0.5 * (9.0 * d.x).sin() * (7.0 * d.y).cos()
            });
            [value as f32]
        })
        .collect();
    Image::from_pixels(lens_size.0, lens_size.1, pixels).unwrap()
}

/// Whether the pixels around the image of a direction show something too: beyond the valid field
/// the picture is 0.
fn is_well_inside(lens: &Lens, direction: DVec3) -> bool {
    let at = lens.project(direction).unwrap();
    let corners = [(-3.0, -3.0), (3.0, -3.0), (-3.0, 3.0), (3.0, 3.0)];
    let mut around = corners.into_iter().map(|(x, y)| at + DVec2::new(x, y));
    around.all(|pixel| lens.unproject(pixel).is_some())
}

#[test]
fn undistorted_images_show_what_a_pinhole_sees() {
    for Reference { lens, .. } in references().into_iter().skip(1).step_by(4) {
        let (width, height) = lens.size();
        let size = (width / 4, height / 4);
        let lens = lens.resized(size).unwrap();
        let taken = picture(size, |pixel| lens.unproject(pixel));
        for field in [Field::Inside, Field::All, Field::Same] {
            let options = UndistortOptions {
                field,
                ..UndistortOptions::default()
            };
            let model = lens.model();
            let undistortion = Undistortion::new(&lens, &options).unwrap();
            let got = undistortion.apply(&taken).unwrap();
            let camera = undistortion.camera(DAffine3::IDENTITY);
            assert_eq!(got.image.size(), (camera.width, camera.height));
            if field == Field::Inside {
                assert_eq!(got.num_unknown(), 0, "{model} {:?}", lens.params());
            }
            let focal = DVec2::new(camera.fx, camera.fy);
            let wanted = picture(got.image.size(), |pixel| {
                Some(((pixel - DVec2::new(camera.cx, camera.cy)) / focal).extend(1.0))
            });
            let mut worst = 0.0_f32;
            for (at, known) in got.valid.values().iter().enumerate() {
                let (x, y) = (at as u32 % camera.width, at as u32 / camera.width);
                let pixel = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                let direction = ((pixel - DVec2::new(camera.cx, camera.cy)) / focal).extend(1.0);
                if *known == 1.0 && is_well_inside(&lens, direction) {
                    worst = worst.max((got.image.values()[at] - wanted.values()[at]).abs());
                }
            }
            // Focal lengths are from 30 pixels: a slope of 4.5/30 a pixel, half a pixel of which is
            // missing at the edge, where pixels are repeated. Inside Catmull-Rom is far better.
            assert!(
                worst < 0.08,
                "{model} {field:?} {:?}: {worst}",
                lens.params()
            );
        }
    }
}

#[test]
fn an_image_survives_being_distorted_and_undistorted() {
    let params = [300.0, 305.0, 160.0, 118.0, -0.2, 0.05, 1e-3, -5e-4];
    let lens = Lens::new(LensModel::OpenCv, (320, 240), &params).unwrap();
    let wide = Camera {
        width: 480,
        height: 360,
        fx: 300.0,
        fy: 300.0,
        cx: 240.0,
        cy: 180.0,
        world_from_camera: DAffine3::from_mat3(DMat3::IDENTITY),
    };
    let focal = DVec2::new(wide.fx, wide.fy);
    let ideal = |camera: &Camera, size| {
        let centre = DVec2::new(camera.cx, camera.cy);
        picture(size, |pixel| Some(((pixel - centre) / focal).extend(1.0)))
    };
    let taken = distort(&ideal(&wide, (480, 360)), &wide, &lens).unwrap();
    assert_eq!(taken.num_unknown(), 0);
    let undistortion = Undistortion::new(&lens, &UndistortOptions::default()).unwrap();
    let back = undistortion.apply(&taken.image).unwrap();
    let camera = undistortion.camera(DAffine3::IDENTITY);
    let size = back.image.size();
    // Barrel distortion: the corners are cut, not the middles of the sides.
    assert!(size.0 > 300 && size.1 > 220, "{size:?}");
    let focal = DVec2::new(camera.fx, camera.fy);
    let wanted = picture(size, |pixel| {
        Some(((pixel - DVec2::new(camera.cx, camera.cy)) / focal).extend(1.0))
    });
    let worst = back.image.values().iter().zip(wanted.values());
    let worst = worst.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // Two filters, a wave of 200 pixels, and half a pixel repeated at the edge: 4.5/300 · 0.5.
    assert!(worst < 0.01, "{worst}");
    let message = undistortion.apply(&wanted).unwrap_err();
    assert!(message.contains("320x240"), "{message}");
}

#[test]
fn a_camera_that_is_given_is_taken() {
    let params = [300.0, 305.0, 160.0, 118.0, -0.2, 0.05, 1e-3, -5e-4];
    let lens = Lens::new(LensModel::OpenCv, (320, 240), &params).unwrap();
    let given = Pinhole {
        width: 100,
        height: 90,
        fx: 140.0,
        fy: 150.0,
        cx: 40.0,
        cy: 50.0,
    };
    let options = UndistortOptions {
        pinhole: Some(given),
        ..UndistortOptions::default()
    };
    assert!(!options.shows_known_pixels_only());
    let undistortion = Undistortion::new(&lens, &options).unwrap();
    let camera = undistortion.camera(DAffine3::IDENTITY);
    assert_eq!(Pinhole::of(&camera), given);
    // Of a lens that is a pinhole already, too.
    let plain = Lens::new(LensModel::Pinhole, (320, 240), &params[..4]).unwrap();
    let same = Undistortion::new(&plain, &options).unwrap();
    assert_eq!(Pinhole::of(&same.camera(DAffine3::IDENTITY)), given);
    let taken = picture(lens.size(), |pixel| lens.unproject(pixel));
    let got = undistortion.apply(&taken).unwrap();
    assert_eq!(got.num_unknown(), 0);
    let centre = DVec2::new(given.cx, given.cy);
    let focal = DVec2::new(given.fx, given.fy);
    let wanted = picture((given.width, given.height), |pixel| {
        Some(((pixel - centre) / focal).extend(1.0))
    });
    let worst = got.image.values().iter().zip(wanted.values());
    let worst = worst.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // A pixel is 2.1 of the lens's; a wave of 4.5 a radian, averaged over 1/140 of it:
    // (4.5/140)²/24 and what Catmull-Rom adds.
    assert!(worst < 0.002, "{worst}");
}

#[test]
fn a_shrunk_pinhole_image_shows_the_same() {
    let lens = Lens::new(
        LensModel::OpenCv,
        (64, 48),
        &[50.0, 52.0, 31.0, 25.0, -0.1, 0.02, 0.001, 0.0],
    )
    .unwrap();
    let whole = Undistortion::new(&lens, &UndistortOptions::default()).unwrap();
    let camera = whole.camera(DAffine3::IDENTITY);
    let (width, height) = (camera.width, camera.height);
    let half = whole.resized((width / 2, height)).unwrap();
    let at = DVec2::new(f64::from(width), f64::from(height));
    for share in [DVec2::new(0.1, 0.9), DVec2::new(0.5, 0.3)] {
        let position = at * share;
        let squeezed = position * DVec2::new(f64::from(width / 2) / f64::from(width), 1.0);
        let (a, b) = (
            whole.source_from_target(position),
            half.source_from_target(squeezed),
        );
        assert!((a.unwrap() - b.unwrap()).length() < 1e-12);
    }
    assert!(whole.resized((0, 4)).is_err());
    // Nearest pixels are pixels of the source; a pinhole that stays a pinhole keeps all.
    let mut stripes = Image::filled(64, 48, [1.0]);
    for x in (0..64).step_by(2) {
        (0..48).for_each(|y| stripes.pixels_mut()[y * 64 + x] = [7.0]);
    }
    let picked = half.apply_nearest(&stripes).unwrap();
    assert!(picked.values().iter().all(|v| [1.0, 7.0].contains(v)));
    let pinhole = Lens::new(LensModel::Pinhole, (64, 48), &[50.0, 52.0, 31.0, 25.0]).unwrap();
    let same = Undistortion::new(&pinhole, &UndistortOptions::default()).unwrap();
    assert_eq!(same.apply_nearest(&stripes).unwrap(), stripes);
}
