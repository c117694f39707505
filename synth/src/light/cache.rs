//! Light that has been bounced already: irradiance on a grid over all surfaces, solved once for the
//! room (`solve.rs`).
//!
//! It is read where a ray from a pixel's surface ends, never at the pixel itself, so that the grid
//! does not show.

use crate::room::{Hit, MAX_CONDITIONS, PerCondition};
use glam::{Vec2, Vec3};

/// Irradiance over π in each condition and cell.
#[derive(Debug, Clone)]
pub(crate) struct Cache {
    pub(super) grids: Vec<Grid>,
    /// Index into `grids` of each surface's first face.
    pub(super) first_grid: Vec<u32>,
    pub(super) light: Vec<Vec<Vec3>>,
    /// Whether cells are close to a light.
    pub(super) is_near: Vec<bool>,
}

/// The cells of a face.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) surface: u32,
    pub(super) face: u32,
    pub(super) size: [u32; 2],
    pub(super) first_cell: u32,
}

impl Grid {
    pub(super) fn num_cells(&self) -> u32 {
        self.size[0] * self.size[1]
    }

    /// Coordinates on the face of a place in a cell, 0 to 1 along its sides.
    pub(super) fn st(&self, cell: u32, within: Vec2) -> Vec2 {
        let corner = Vec2::new((cell % self.size[0]) as f32, (cell / self.size[0]) as f32);
        (corner + within) / Vec2::new(self.size[0] as f32, self.size[1] as f32)
    }
}

impl Cache {
    /// Number of cells.
    pub(crate) fn num_cells(&self) -> usize {
        self.grids
            .last()
            .map_or(0, |grid| (grid.first_cell + grid.num_cells()) as usize)
    }

    /// Irradiance over π at a point; `None` close to a light, where it is not known.
    pub(crate) fn irradiance(&self, hit: &Hit) -> Option<PerCondition> {
        let Some(cell) = self.cell(hit) else {
            return Some([Vec3::ZERO; MAX_CONDITIONS]);
        };
        let cell = cell as usize;
        let of = |condition: usize| self.light.get(condition).map_or(Vec3::ZERO, |l| l[cell]);
        (!self.is_near[cell]).then(|| std::array::from_fn(of))
    }

    /// The cell of a point; `None` inside of things and on faces without an area.
    pub(super) fn cell(&self, hit: &Hit) -> Option<u32> {
        let grid = &self.grids[(self.first_grid[hit.surface as usize] + hit.face) as usize];
        let [columns, rows] = grid.size;
        if hit.is_inside || columns * rows == 0 {
            return None;
        }
        let column = ((hit.st.x * columns as f32) as u32).min(columns - 1);
        let row = ((hit.st.y * rows as f32) as u32).min(rows - 1);
        Some(grid.first_cell + row * columns + column)
    }
}
