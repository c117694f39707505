//! Shares of shapes in patches of rays that are known.

use super::*;

/// A patch about a lamp has a part of the pixels of a ball that is larger.
#[test]
fn the_share_of_a_ball_that_is_shown_is_of_the_whole_ball() {
    let width = 0.01;
    let ball = Shape::Ball {
        centre: Vec3::new(0.0, 0.0, 2.0),
        radius: 0.5,
    };
    let patch = |rows: std::ops::Range<i16>| {
        let pixels = rows.flat_map(|y| (-40..40_i16).map(move |x| (f32::from(x), f32::from(y))));
        let targets = pixels.map(|(x, y)| Target {
            rays: PixelRays::new(|[u, v]| {
                Vec3::new(width * (x + u), width * (y + v), 1.0).normalize()
            }),
            cover: 1.0,
            weight: 1.0,
            solid_angle: width * width / Vec3::new(width * x, width * y, 1.0).length().powi(3),
            hidden_from: f32::INFINITY,
        });
        Patch {
            origin: Vec3::ZERO,
            targets: targets.collect(),
            distances: Vec::new(),
        }
    };
    // Pixels at the edge are covered to a sixteenth.
    for (rows, share) in [(-40..40, 1.0), (0..40, 0.5), (-40..0, 0.5), (-60..-50, 0.0)] {
        let shown = patch(rows.clone()).share_shown(&ball);
        assert!((shown - share).abs() < 0.01, "{rows:?}: {shown}");
    }
}
