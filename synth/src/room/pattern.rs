//! Colours of surfaces: plain, or a pattern laid out on them in metres.

mod paint;

use glam::{Vec2, Vec3};
use paint::{bricks, contrast, fractal, landscape, motif, rug, wood};

/// A diffuse colour that varies over a surface.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Pattern {
    /// One colour.
    Plain(Vec3),
    /// Squares of two colours.
    Checker {
        /// The colours.
        colors: [Vec3; 2],
        /// Edge of a square, metres.
        size: f32,
    },
    /// Stripes along the second coordinate, each of the next colour.
    Stripes {
        /// The colours, at least one.
        colors: Vec<Vec3>,
        /// Width of a stripe, metres.
        size: f32,
    },
    /// Clouds between two colours.
    Noise {
        /// The colours.
        colors: [Vec3; 2],
        /// Size of the largest features, metres.
        size: f32,
    },
    /// Rows of bricks or tiles, every other one shifted by half of one.
    Bricks {
        /// Colours of brick and joint.
        colors: [Vec3; 2],
        /// Length and height of a brick, metres.
        size: Vec2,
        /// Width of the joints, metres.
        joint: f32,
    },
    /// Boards with grain along the first coordinate.
    Wood {
        /// Light and dark wood.
        colors: [Vec3; 2],
        /// Length and width of a board, metres.
        size: Vec2,
    },
    /// A rug: borders around rows of lozenges, fitted to the surface.
    Rug {
        /// Ground, border, lozenges and their hearts.
        colors: [Vec3; 4],
        /// Size of a lozenge and twice the width of the border, metres.
        size: f32,
    },
    /// A painted landscape, fitted to the surface.
    Landscape {
        /// Number of the landscape.
        seed: u32,
    },
    /// Small flowers or stars on a ground, as on wallpaper.
    Motif {
        /// Ground and motif.
        colors: [Vec3; 2],
        /// Distance of the motifs, metres.
        size: f32,
    },
}

/// A pattern with unevenness of its own.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Texture {
    /// The pattern.
    pub(crate) pattern: Pattern,
    /// Fine unevenness: largest relative deviation of the colour, 0 to 1.
    pub(crate) grain: f32,
}

/// A point on a surface, as patterns see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PatternPoint {
    /// Coordinates along the surface, metres.
    pub(crate) place: Vec2,
    /// Extent of the surface, metres.
    pub(crate) extent: Vec2,
    /// Tells surfaces apart, so that no two have the same boards.
    pub(crate) seed: u32,
}

/// Size of the grain's largest features, metres.
const GRAIN_SIZE: f32 = 0.05;

impl Texture {
    /// One colour, perfectly even.
    pub(crate) fn plain(albedo: Vec3) -> Self {
        Self {
            pattern: Pattern::Plain(albedo),
            grain: 0.0,
        }
    }

    /// Diffuse albedo at a point, 0 to 1.
    pub(crate) fn albedo(&self, point: &PatternPoint) -> Vec3 {
        let color = self.pattern.color(point);
        if self.grain == 0.0 {
            return color;
        }
        let uneven = fractal(point.place / GRAIN_SIZE, point.seed ^ 0x51ed_270b, 3);
        (color * (1.0 + self.grain * (2.0 * uneven - 1.0))).clamp(Vec3::ZERO, Vec3::ONE)
    }
}

impl Pattern {
    fn color(&self, point: &PatternPoint) -> Vec3 {
        let (p, seed) = (point.place, point.seed);
        match self {
            Self::Plain(color) => *color,
            Self::Checker { colors, size } => {
                let cell = (p / size).floor();
                colors[(cell.x + cell.y).rem_euclid(2.0) as usize % 2]
            }
            Self::Stripes { colors, size } => {
                let stripe = (p.x / size).floor().rem_euclid(colors.len() as f32);
                colors[stripe as usize % colors.len()]
            }
            Self::Noise { colors, size } => {
                colors[0].lerp(colors[1], contrast(fractal(p / size, seed, 5)))
            }
            Self::Bricks {
                colors,
                size,
                joint,
            } => bricks(point, colors, *size, *joint),
            Self::Wood { colors, size } => wood(point, colors, *size),
            Self::Rug { colors, size } => rug(point, colors, *size),
            Self::Landscape { seed } => landscape(p / point.extent, *seed),
            Self::Motif { colors, size } => motif(p / size, colors, seed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, y: f32) -> PatternPoint {
        PatternPoint {
            place: Vec2::new(x, y),
            extent: Vec2::new(2.0, 1.5),
            seed: 3,
        }
    }

    #[test]
    fn checkers_and_stripes_are_where_they_should_be() {
        let colors = [Vec3::ZERO, Vec3::ONE];
        let checker = Pattern::Checker { colors, size: 0.5 };
        assert_eq!(checker.color(&at(0.1, 0.1)), Vec3::ZERO);
        assert_eq!(checker.color(&at(0.6, 0.1)), Vec3::ONE);
        assert_eq!(checker.color(&at(-0.1, -0.1)), Vec3::ZERO);
        let colors = vec![Vec3::X, Vec3::Y, Vec3::Z];
        let stripes = Pattern::Stripes { colors, size: 0.1 };
        for (x, color) in [
            (0.05, Vec3::X),
            (0.15, Vec3::Y),
            (0.35, Vec3::X),
            (-0.05, Vec3::Z),
        ] {
            assert_eq!(stripes.color(&at(x, 0.7)), color);
        }
    }

    #[test]
    fn every_pattern_is_an_albedo_everywhere() {
        let two = [Vec3::new(0.9, 0.8, 0.7), Vec3::new(0.3, 0.2, 0.1)];
        let four = [two[0], two[1], two[0], two[1]];
        let size = Vec2::new(0.3, 0.1);
        for pattern in [
            Pattern::Noise {
                colors: two,
                size: 0.2,
            },
            Pattern::Bricks {
                colors: two,
                size,
                joint: 0.01,
            },
            Pattern::Wood { colors: two, size },
            Pattern::Rug {
                colors: four,
                size: 0.3,
            },
            Pattern::Landscape { seed: 1 },
            Pattern::Motif {
                colors: two,
                size: 0.1,
            },
        ] {
            let texture = Texture {
                pattern,
                grain: 0.3,
            };
            let mut seen = std::collections::BTreeSet::new();
            for i in 0..400 {
                let point = at(2.0 * (i as f32 * 0.618) % 2.0, i as f32 / 270.0);
                let albedo = texture.albedo(&point);
                assert!(albedo.min_element() >= 0.0 && albedo.max_element() <= 1.0);
                assert_eq!(albedo, texture.albedo(&point));
                seen.insert(albedo.x.to_bits());
            }
            assert!(seen.len() > 50, "{:?} has {}", texture.pattern, seen.len());
        }
    }
}
