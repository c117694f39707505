//! Light that the lens loses towards the corners.
//!
//! As a polynomial 1 + a r² + b r⁴ + c r⁶ of the distance r from the middle of the image, which is
//! 1 in the corner, or as a measured flat field: a photograph of an evenly lit surface, smoothed,
//! for each channel.

use crate::merge::{CLIPPED, DARK, Merged};
use crate::raw::Header;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Source of the lens's falloff.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Vignetting {
    /// Left as it is.
    #[default]
    None,
    /// Coefficients a, b, c.
    Polynomial([f32; 3]),
    /// A folder with one stack of an evenly lit surface, taken with the lens and aperture of the
    /// capture.
    FlatField(PathBuf),
    /// As `FlatField`, but only a, b and c are taken from it: unevenness of the surface itself
    /// counts less.
    Fit(PathBuf),
}

/// Relative illumination, 1 in the middle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Falloff {
    /// 1 + a r² + b r⁴ + c r⁶.
    Polynomial([f32; 3]),
    /// Measured on a grid of cells over the image, bilinear between their centres.
    Grid(Grid),
}

/// A measured falloff.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Grid {
    /// Cells across.
    pub columns: usize,
    /// Cells down.
    pub rows: usize,
    /// `[rows, columns, 3]`, 1 in the middle of the image.
    pub cells: Vec<[f32; 3]>,
}

/// Cells of a measured falloff along the longer side: falloff is smooth, and dust is not part of
/// it.
const GRID_CELLS: usize = 48;
/// Least relative illumination of a falloff: below it, only noise would be visible.
const LEAST: f32 = 0.02;

impl Falloff {
    /// Whether the falloff stays above the least everywhere.
    pub(crate) fn is_usable(&self) -> bool {
        match self {
            Self::Polynomial(abc) => (0..=64).all(|i| polynomial(abc, i as f32 / 64.0) > LEAST),
            Self::Grid(grid) => grid.cells.as_flattened().iter().all(|v| *v > LEAST),
        }
    }

    /// Factors of a row of pixels for each channel, `[width]`.
    pub(crate) fn row_factors(&self, width: usize, height: usize, row: usize) -> Vec<[f32; 3]> {
        let (x_of, y) = (|column: usize| column as f32 + 0.5, row as f32 + 0.5);
        match self {
            Self::Polynomial(abc) => {
                let (cx, cy) = (width as f32 / 2.0, height as f32 / 2.0);
                let corner = cx * cx + cy * cy;
                let square = |column| {
                    let (dx, dy) = (x_of(column) - cx, y - cy);
                    (dx * dx + dy * dy) / corner
                };
                (0..width)
                    .map(|column| [1.0 / polynomial(abc, square(column)); 3])
                    .collect()
            }
            Self::Grid(grid) => {
                let v = y / height as f32 * grid.rows as f32 - 0.5;
                (0..width)
                    .map(|column| {
                        let u = x_of(column) / width as f32 * grid.columns as f32 - 0.5;
                        grid.at(u, v).map(|share| 1.0 / share)
                    })
                    .collect()
            }
        }
    }
}

/// The polynomial of the squared distance.
fn polynomial([a, b, c]: &[f32; 3], square: f32) -> f32 {
    1.0 + square * (a + square * (b + square * c))
}

impl Grid {
    fn at(&self, u: f32, v: f32) -> [f32; 3] {
        let split = |position: f32, count: usize| {
            let position = position.clamp(0.0, (count - 1) as f32);
            let low = (position as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), position - low as f32)
        };
        let (left, right, s) = split(u, self.columns);
        let (top, bottom, t) = split(v, self.rows);
        let cell = |row: usize, column: usize| self.cells[row * self.columns + column];
        [0, 1, 2].map(|c| {
            let upper = cell(top, left)[c] * (1.0 - s) + cell(top, right)[c] * s;
            let lower = cell(bottom, left)[c] * (1.0 - s) + cell(bottom, right)[c] * s;
            upper * (1.0 - t) + lower * t
        })
    }

    /// Means of a merged photograph of an even surface over cells, each channel over its value in
    /// the middle; `None` if too much of it is clipped or dark.
    pub(crate) fn measure(header: &Header, merged: &Merged) -> Option<Self> {
        let (width, height) = (header.width as usize, header.height as usize);
        let long = width.max(height);
        let cells_of = |side: usize| (side * GRID_CELLS / long).clamp(3, side / 12 + 3);
        let (columns, rows) = (cells_of(width), cells_of(height));
        let mut sums = vec![[(0.0_f64, 0_u32); 3]; columns * rows];
        let per_pixel = header.row_len() / width;
        for row in 0..height {
            for sample in 0..header.row_len() {
                let index = row * header.row_len() + sample;
                if merged.flags[index] & (CLIPPED | DARK) == 0 {
                    let cell =
                        (row * rows / height) * columns + sample / per_pixel * columns / width;
                    let sum = &mut sums[cell][header.channel(row, sample)];
                    *sum = (sum.0 + f64::from(merged.radiance[index]), sum.1 + 1);
                }
            }
        }
        let mean = |(sum, count): (f64, u32)| (count > 0).then(|| sum / f64::from(count));
        let middle = sums[(rows / 2) * columns + columns / 2];
        let middle = [mean(middle[0])?, mean(middle[1])?, mean(middle[2])?];
        let cells: Option<Vec<[f32; 3]>> = sums
            .iter()
            .map(|cell| {
                let share = |c: usize| Some((mean(cell[c])? / middle[c]) as f32);
                Some([share(0)?, share(1)?, share(2)?])
            })
            .collect();
        Some(Self {
            columns,
            rows,
            cells: cells?,
        })
    }

    /// The polynomial fitted to the green of the cells, up to one factor; `None` if it is
    /// undetermined.
    pub(crate) fn fit(&self, width: usize, height: usize) -> Option<[f32; 3]> {
        // share = s (1 + a r² + b r⁴ + c r⁶) is linear in (s, s a, s b, s c). s is taken out first:
        // the share where r is least is 1 by construction, but noisy, so the constant is fitted by
        // a second round.
        let (w, h) = (width as f64, height as f64);
        let corner = (w * w + h * h) / 4.0;
        let squares: Vec<(f64, f64)> = (0..self.rows * self.columns)
            .map(|index| {
                let x = ((index % self.columns) as f64 + 0.5) / self.columns as f64 * w - w / 2.0;
                let y = ((index / self.columns) as f64 + 0.5) / self.rows as f64 * h - h / 2.0;
                ((x * x + y * y) / corner, f64::from(self.cells[index][1]))
            })
            .collect();
        let mut constant = 1.0;
        let mut abc = DVec3::ZERO;
        for _ in 0..50 {
            let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
            for (square, share) in &squares {
                let basis = DVec3::new(*square, square * square, square * square * square);
                normal += DMat3::from_cols(basis * basis.x, basis * basis.y, basis * basis.z);
                right += basis * (share / constant - 1.0);
            }
            if normal.determinant().abs() < 1e-12 {
                return None;
            }
            abc = normal.inverse() * right;
            let model = |square: f64| 1.0 + square * (abc.x + square * (abc.y + square * abc.z));
            let sum: f64 = squares
                .iter()
                .map(|(square, share)| share / model(*square))
                .sum();
            constant = sum / squares.len() as f64;
        }
        Some([abc.x as f32, abc.y as f32, abc.z as f32])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_polynomial_is_1_in_the_middle_and_its_sum_in_the_corner() {
        let falloff = Falloff::Polynomial([-0.22, 0.05, -0.01]);
        let rows = [0, 50, 100].map(|row| falloff.row_factors(151, 101, row));
        assert!((rows[1][75][0] - 1.0).abs() < 1e-6);
        // Half a pixel from the corner: r² = 1 − (151 + 101 − 1)·2 / (151² + 101²) to first order.
        let square = (75.0_f32 * 75.0 + 50.0 * 50.0) / (75.5 * 75.5 + 50.5 * 50.5);
        let expected = 1.0 - 0.22 * square + 0.05 * square * square - 0.01 * square.powi(3);
        for corner in [rows[0][0], rows[0][150], rows[2][0], rows[2][150]] {
            assert!((corner[2] - 1.0 / expected).abs() < 1e-5);
        }
        assert!(falloff.is_usable());
        assert!(!Falloff::Polynomial([-1.5, 0.0, 0.0]).is_usable());
    }

    #[test]
    fn a_polynomial_is_found_from_cells() {
        let abc = [-0.3, 0.08, -0.02];
        let (columns, rows) = (48, 32);
        let cells = (0..rows * columns).map(|index| {
            let x = ((index % columns) as f32 + 0.5) / columns as f32 * 600.0 - 300.0;
            let y = ((index / columns) as f32 + 0.5) / rows as f32 * 400.0 - 200.0;
            // A lamp that is 3 % too bright changes nothing about the falloff.
            [1.03 * polynomial(&abc, (x * x + y * y) / (300.0 * 300.0 + 200.0 * 200.0)); 3]
        });
        let grid = Grid {
            columns,
            rows,
            cells: cells.collect(),
        };
        let found = grid.fit(600, 400).unwrap();
        for square in [0.1_f32, 0.4, 0.8, 1.0] {
            assert!((polynomial(&found, square) - polynomial(&abc, square)).abs() < 2e-3);
        }
    }
}
