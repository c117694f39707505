//! A corner of a room under sampled light whose mean is known.

use eagpt_denoise::Frame;
use eagpt_scene::Image;
use eagpt_scene::rng::{Purpose, RandomKey};

/// Size of the picture.
pub(crate) const WIDTH: u32 = 96;
/// Size of the picture.
pub(crate) const HEIGHT: u32 = 64;
/// Samples of a pixel.
pub(crate) const NUM_SAMPLES: u32 = 16;
/// Radiance of the lamp: far above what half precision or a display holds.
pub(crate) const LAMP: f32 = 1e5;

/// A frame and the light that it would have without noise.
pub(crate) struct Known {
    pub(crate) frame: Frame,
    pub(crate) truth: Image<3>,
}

/// Noise-free values of a pixel.
#[derive(Clone, Copy, Default)]
pub(crate) struct Pixel {
    pub(crate) emitted: f32,
    pub(crate) incoming: f32,
    pub(crate) albedo: [f32; 3],
    pub(crate) normal: [f32; 3],
    pub(crate) position: [f32; 3],
    pub(crate) coverage: f32,
}

/// Distribution of samples about the irradiance.
#[derive(Clone, Copy)]
pub(crate) enum Noise {
    #[allow(
        dead_code,
        reason = "not every test binary has a picture without noise"
    )]
    None,
    /// Most samples find little, some find a lot, a few very much: the mean is 1.
    HeavyTailed,
}

/// A picture of `shade(x, y)` with noise.
pub(crate) fn picture(noise: Noise, shade: impl Fn(u32, u32) -> Pixel) -> Known {
    let black = Image::filled(WIDTH, HEIGHT, [0.0; 3]);
    let zero = Image::filled(WIDTH, HEIGHT, [0.0]);
    let mut truth = black.clone();
    let mut frame = Frame {
        emitted: black.clone(),
        reflected: black.clone(),
        albedo: black.clone(),
        normal: black.clone(),
        position: black,
        coverage: zero.clone(),
        second_moment: zero,
        num_samples: NUM_SAMPLES,
    };
    let key = RandomKey::new(11, Purpose::Render, 0);
    for i in 0..(WIDTH * HEIGHT) as usize {
        let p = shade(i as u32 % WIDTH, i as u32 / WIDTH);
        let albedo = p.albedo.map(|a| a * p.coverage);
        let num = (NUM_SAMPLES as f32 * p.coverage).round() as u32;
        let (mut sum, mut squares) = (0.0, 0.0);
        for sample in 0..num {
            let [a, ..] = key.stream(i as u32, sample).next_uniforms();
            let light = p.incoming * factor(noise, a);
            sum += light / num as f32;
            squares += light * light / num as f32;
        }
        frame.emitted.pixels_mut()[i] = [p.emitted; 3];
        frame.reflected.pixels_mut()[i] = albedo.map(|a| a * sum);
        frame.albedo.pixels_mut()[i] = albedo;
        frame.normal.pixels_mut()[i] = p.normal;
        frame.position.pixels_mut()[i] = p.position;
        frame.coverage.pixels_mut()[i] = [p.coverage];
        frame.second_moment.pixels_mut()[i] = [squares];
        truth.pixels_mut()[i] = albedo.map(|a| a * p.incoming + p.emitted);
    }
    Known { frame, truth }
}

fn factor(noise: Noise, u: f32) -> f32 {
    match noise {
        Noise::None => 1.0,
        // 0.55 · 0.5 + 0.4475 · 1.2 + 0.0025 · 75.2 = 1
        Noise::HeavyTailed if u < 0.55 => 0.5,
        Noise::HeavyTailed if u < 0.9975 => 1.2,
        Noise::HeavyTailed => 75.2,
    }
}

/// A wall above a floor, each with tiles; a soft shadow and a hard one; a lamp in front, at whose
/// edge pixels show both.
pub(crate) fn room(x: u32, y: u32) -> Pixel {
    let (u, v) = (x as f32 / WIDTH as f32, y as f32 / HEIGHT as f32);
    let from_lamp = (u - 0.7).hypot((v - 0.3) * HEIGHT as f32 / WIDTH as f32);
    let coverage = ((from_lamp - 0.08) * WIDTH as f32).clamp(0.0, 1.0);
    let emitted = LAMP * (1.0 - coverage);
    if coverage == 0.0 {
        return Pixel {
            emitted,
            ..Pixel::default()
        };
    }
    let tile = if (x / 6 + y / 6).is_multiple_of(2) {
        0.8
    } else {
        0.2
    };
    let wall = v < 0.6;
    let hard_shadow = if wall && u < 0.3 && v > 0.25 {
        0.3
    } else {
        1.0
    };
    let soft_shadow = 1.0 - 0.6 * (-((u - 0.5) / 0.15).powi(2)).exp();
    Pixel {
        emitted,
        incoming: if wall {
            hard_shadow / (1.0 + 4.0 * from_lamp)
        } else {
            2.0 * soft_shadow
        },
        albedo: [tile, 0.5 * tile, 0.9],
        normal: if wall {
            [0.0, -1.0, 0.0]
        } else {
            [0.0, 0.0, 1.0]
        },
        position: if wall {
            [4.0 * u, 3.0, 2.0 * (0.6 - v)]
        } else {
            [4.0 * u, 3.0 - 4.0 * (v - 0.6), 0.0]
        },
        coverage,
    }
}

/// Root of the mean squared error relative to the truth, over pixels that reflect.
pub(crate) fn relative_rmse(known: &Known, image: &Image<3>) -> f64 {
    let (mut sum, mut num) = (0.0, 0.0);
    for i in 0..image.pixels().len() {
        if known.frame.coverage.pixels()[i][0] < 1.0 {
            continue;
        }
        for c in 0..3 {
            let truth = f64::from(known.truth.pixels()[i][c]);
            sum += ((f64::from(image.pixels()[i][c]) - truth) / truth).powi(2);
            num += 1.0;
        }
    }
    (sum / num).sqrt()
}

/// Runs `f` with so many threads.
pub(crate) fn with_threads<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
        .install(f)
}
