use super::*;
use crate::raw::{Black, CameraColor, Metadata};

const SIDE: u32 = 64;

fn bayer() -> Header {
    Header {
        width: SIDE,
        height: SIDE,
        layout: Layout::Mosaic {
            columns: 2,
            rows: 2,
            channels: vec![0, 1, 1, 2],
        },
        black: Black {
            columns: 1,
            rows: 1,
            levels: vec![0.0],
        },
        white: [1.0; 3],
        color: CameraColor::default(),
        display: None,
        metadata: Metadata::default(),
    }
}

/// A window of an overcast sky in a wall, a little askew, with dark wires about a pixel thick
/// before it, and a small lamp on the wall.
fn light_at(x: f32, y: f32) -> [f32; 3] {
    let (u, v) = (x + 0.04 * y, y - 0.07 * x);
    let wire = |along: f32| (along.rem_euclid(16.0) - 8.0).abs() < 0.6;
    if (12.0..54.0).contains(&u) && (8.0..50.0).contains(&v) {
        if wire(u + 0.2 * v) || wire(v) {
            [0.05, 0.05, 0.055]
        } else {
            [9.5, 10.0, 11.0]
        }
    } else if (x - 59.5).hypot(y - 22.0) < 2.5 {
        [42.0, 40.0, 36.0]
    } else {
        [0.31, 0.3, 0.28]
    }
}

/// Means over pixels.
fn window_with_wires() -> Vec<[f32; 3]> {
    const STEPS: u32 = 4;
    let pixel = |i: u32| {
        let mut sum = [0.0_f32; 3];
        for part in 0..STEPS * STEPS {
            let at = |pixel: u32, part: u32| pixel as f32 + (part as f32 + 0.5) / STEPS as f32;
            let light = light_at(at(i % SIDE, part % STEPS), at(i / SIDE, part / STEPS));
            for (sum, light) in sum.iter_mut().zip(light) {
                *sum += light / (STEPS * STEPS) as f32;
            }
        }
        sum
    };
    (0..SIDE * SIDE).map(pixel).collect()
}

#[test]
fn thin_details_before_a_window_stay_grey() {
    let header = bayer();
    let pixels = window_with_wires();
    let samples: Vec<f32> = (0..pixels.len())
        .map(|i| pixels[i][header.channel(i / SIDE as usize, i % SIDE as usize)])
        .collect();
    for method in [
        Demosaic::Bilinear,
        Demosaic::Mhc,
        Demosaic::Ppg,
        Demosaic::Vng,
        Demosaic::Ahd,
    ] {
        let colors = interpolate(&header, &samples, method, 1e-5);
        let cast = |[r, g, b]: [f32; 3]| [(r / g).ln(), (b / g).ln()];
        let casts = colors.iter().zip(&pixels).map(|(color, truth)| {
            let (found, truth) = (cast(*color), cast(*truth));
            (found[0] - truth[0]).abs().max((found[1] - truth[1]).abs())
        });
        let mut casts: Vec<f32> = casts.collect();
        casts.sort_by(f32::total_cmp);
        // Of 4096 pixels, at most 185 are off by a quarter and 30 by a factor of two, at
        // crossings of wires and tips of the lamp. Without the median of colours it is 393 and
        // 90 for VNG, 502 and 122 for PPG, more for all others.
        let from_top = |num: usize| casts[casts.len() - num].exp();
        let casts = [from_top(280), from_top(45)];
        assert!(casts[0] < 1.25 && casts[1] < 2.0, "{method:?}: {casts:?}");
    }
}
