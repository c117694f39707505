//! Colours of patterns and their noise.

use super::PatternPoint;
use glam::{Vec2, Vec3};

/// Fractal noise gathers around 0.5: stretched towards both ends.
pub(super) fn contrast(value: f32) -> f32 {
    (2.0 * (value - 0.5) + 0.5).clamp(0.0, 1.0)
}

/// The cell of a brick bond that a point is in, and the place within it, 0 to 1.
fn bond(p: Vec2, size: Vec2, shift: impl Fn(f32) -> f32) -> (Vec2, Vec2) {
    let row = (p.y / size.y).floor();
    let along = p.x / size.x + shift(row);
    let cell = Vec2::new(along.floor(), row);
    (cell, Vec2::new(along, p.y / size.y) - cell)
}

pub(super) fn bricks(point: &PatternPoint, colors: &[Vec3; 2], size: Vec2, joint: f32) -> Vec3 {
    let (cell, within) = bond(point.place, size, |row| 0.5 * row.rem_euclid(2.0));
    let edge = (within.min(1.0 - within) * size).min_element();
    if edge < 0.5 * joint {
        return colors[1];
    }
    let own = random(cell, point.seed);
    let uneven = fractal(point.place / 0.03, point.seed, 3);
    colors[0] * (0.75 + 0.35 * own + 0.3 * (uneven - 0.5))
}

pub(super) fn wood(point: &PatternPoint, colors: &[Vec3; 2], size: Vec2) -> Vec3 {
    let seed = point.seed;
    let shift = |row: f32| random(Vec2::new(row, 0.5), seed);
    let (cell, within) = bond(point.place, size, shift);
    let own = random(cell, seed ^ 0x9e37);
    // Fibres: noise that is drawn out along the board, different on every board.
    let fibre = Vec2::new(point.place.x / 0.6, point.place.y / 0.012) + own * 57.0;
    let rings = Vec2::new(point.place.x / 1.1, point.place.y / 0.05) + own * 23.0;
    let tone = 0.45 * own + 0.3 * fractal(fibre, seed, 3) + 0.35 * fractal(rings, seed ^ 7, 2);
    let color = colors[0].lerp(colors[1], tone.clamp(0.0, 1.0));
    let edge = (within.min(1.0 - within) * size).min_element();
    if edge < 0.0025 { color * 0.45 } else { color }
}

pub(super) fn rug(point: &PatternPoint, colors: &[Vec3; 4], size: f32) -> Vec3 {
    let [ground, border, lozenge, heart] = *colors;
    let edge = point.place.min(point.extent - point.place).min_element() / size;
    let weave = 0.9 + 0.2 * fractal(point.place / 0.015, point.seed, 2);
    let color = if edge < 0.08 || (0.38..0.46).contains(&edge) {
        border
    } else if edge < 0.38 {
        // A running zigzag within the border.
        let along = (point.place.x + point.place.y) / size * 4.0;
        if (along.fract() - 0.5).abs() * 0.5 + 0.1 > (edge - 0.08).abs() {
            heart
        } else {
            lozenge
        }
    } else {
        let from_middle = (point.place - 0.5 * point.extent) / size;
        let within = (from_middle - from_middle.round()).abs();
        match within.x + within.y {
            d if d < 0.13 => heart,
            d if d < 0.3 => lozenge,
            d if d < 0.36 => border,
            _ => ground,
        }
    };
    color * weave
}

pub(super) fn landscape(at: Vec2, seed: u32) -> Vec3 {
    let sky = Vec3::new(0.35, 0.52, 0.75).lerp(Vec3::new(0.85, 0.72, 0.5), (1.0 - at.y).powi(2));
    let sun = Vec2::new(0.25 + 0.5 * random(Vec2::ONE, seed), 0.72);
    let mut color = if (at - sun).length() < 0.07 {
        Vec3::new(0.95, 0.75, 0.3)
    } else {
        let cloud = fractal(at * Vec2::new(3.0, 9.0), seed ^ 3, 4);
        sky.lerp(Vec3::splat(0.85), contrast(cloud) * 0.5)
    };
    let hills = [
        Vec3::new(0.42, 0.5, 0.55),
        Vec3::new(0.3, 0.42, 0.26),
        Vec3::new(0.17, 0.28, 0.12),
        Vec3::new(0.45, 0.36, 0.14),
    ];
    for (layer, hill) in hills.into_iter().enumerate() {
        let number = layer as f32;
        let ridge = fractal(Vec2::new(at.x * (2.0 + number), 7.3 * number), seed, 4);
        if at.y < 0.62 - 0.17 * number + 0.3 * (ridge - 0.5) {
            let strokes = fractal(at * Vec2::new(40.0, 12.0), seed ^ layer as u32, 3);
            color = hill * (0.7 + 0.6 * strokes);
        }
    }
    color
}

pub(super) fn motif(at: Vec2, colors: &[Vec3; 2], seed: u32) -> Vec3 {
    let row = at.y.floor();
    let shifted = at + Vec2::new(0.5 * row.rem_euclid(2.0), 0.0);
    let cell = shifted.floor();
    let turn = std::f32::consts::TAU * random(cell, seed);
    let from = shifted - cell - 0.5;
    let angle = from.y.atan2(from.x) + turn;
    let petal = 0.16 + 0.1 * (2.5 * angle).cos().abs();
    if from.length() < petal {
        colors[1]
    } else {
        colors[0]
    }
}

/// Value noise in octaves, 0 to 1.
pub(super) fn fractal(p: Vec2, seed: u32, octaves: u32) -> f32 {
    let (mut total, mut weight, mut sum, mut at) = (0.0, 1.0, 0.0, p);
    for octave in 0..octaves {
        sum += weight * smooth(at, seed.wrapping_add(octave));
        total += weight;
        weight *= 0.5;
        at = at * 2.03 + 17.17;
    }
    sum / total
}

/// Random values on a grid, joined smoothly.
fn smooth(p: Vec2, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (3.0 - 2.0 * f);
    let corner = |x: f32, y: f32| random(cell + Vec2::new(x, y), seed);
    let low = corner(0.0, 0.0) * (1.0 - f.x) + corner(1.0, 0.0) * f.x;
    let high = corner(0.0, 1.0) * (1.0 - f.x) + corner(1.0, 1.0) * f.x;
    low * (1.0 - f.y) + high * f.y
}

/// A number from 0 to 1 for a cell: the finaliser of MurmurHash3 (Appleby) over its coordinates.
fn random(cell: Vec2, seed: u32) -> f32 {
    let mut h = seed.wrapping_mul(0x9e37_79b1);
    for word in [cell.x.to_bits(), cell.y.to_bits()] {
        h ^= word;
        h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
        h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
        h ^= h >> 16;
    }
    eagpt_scene::rng::unit_from_bits(h)
}
