//! Outlines of mirrors on a wall that is divided into cells.

use glam::Vec2;

/// Sizes of ellipses that are tried, in those of the rectangle: in a disc whose surroundings count
/// as much against it as its inside does for it, the best square is 1.6 radii wide.
const ROUND: [f32; 5] = [1.05, 1.13, 1.2, 1.27, 1.35];

/// A rectangle or an ellipse along two axes, in cells where nothing else is said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outline {
    pub(crate) lower: Vec2,
    pub(crate) upper: Vec2,
    pub(crate) is_round: bool,
}

impl Outline {
    /// The outline of this size around the origin.
    pub(crate) fn centred(size: Vec2, is_round: bool) -> Self {
        Self {
            lower: -0.5 * size,
            upper: 0.5 * size,
            is_round,
        }
    }

    /// Middle, in cells.
    pub(crate) fn centre(&self) -> Vec2 {
        0.5 * (self.lower + self.upper)
    }

    /// Whole width and height, in cells.
    pub(crate) fn size(&self) -> Vec2 {
        self.upper - self.lower
    }

    /// Whether a place on the wall, in cells, lies in it.
    pub(crate) fn has(&self, at: Vec2) -> bool {
        let off = (at - self.centre()) / (0.5 * self.size());
        match self.is_round {
            true => off.length_squared() <= 1.0,
            false => off.abs().max_element() <= 1.0,
        }
    }
}

/// Scores of the cells of a wall, row by row: positive where it is rather a mirror.
#[derive(Debug, Clone)]
pub(crate) struct Scores {
    pub(crate) width: usize,
    pub(crate) cells: Vec<f32>,
}

impl Scores {
    /// Middles of the cells, row by row.
    pub(crate) fn middles(&self) -> impl Iterator<Item = Vec2> {
        let width = self.width;
        (0..self.cells.len())
            .map(move |i| Vec2::new((i % width) as f32 + 0.5, (i / width) as f32 + 0.5))
    }

    /// Sum within an outline.
    fn within(&self, outline: &Outline) -> f32 {
        let cells = self.middles().zip(&self.cells);
        let within = cells.filter(|(at, _)| outline.has(*at));
        within.map(|(_, score)| score).sum()
    }

    /// The outline with the largest sum, and that sum; `None` where no cell has a positive score.
    pub(crate) fn best(&self) -> Option<(f32, Outline)> {
        let (sum, rectangle) = self.best_rectangle()?;
        let round = |factor: f32| {
            let half = 0.5 * factor * rectangle.size();
            let ellipse = Outline {
                lower: rectangle.centre() - half,
                upper: rectangle.centre() + half,
                is_round: true,
            };
            (self.within(&ellipse), ellipse)
        };
        let (most, ellipse) = (ROUND.map(round).into_iter()).max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(match most > sum {
            true => (most, ellipse),
            false => (sum, rectangle),
        })
    }

    /// The rectangle of cells with the largest sum: for each range of rows, the best range of
    /// columns (Bentley, "Programming pearls: algorithm design techniques", CACM 1984).
    fn best_rectangle(&self) -> Option<(f32, Outline)> {
        let height = self.cells.len() / self.width;
        let mut best = (0.0, [0; 4]);
        for first in 0..height {
            let mut columns = vec![0.0; self.width];
            for last in first..height {
                let (mut sum, mut start) = (0.0, 0);
                for (x, column) in columns.iter_mut().enumerate() {
                    *column += self.cells[last * self.width + x];
                    if sum <= 0.0 {
                        (sum, start) = (0.0, x);
                    }
                    sum += *column;
                    if sum > best.0 {
                        best = (sum, [start, first, x + 1, last + 1]);
                    }
                }
            }
        }
        let (sum, [left, bottom, right, top]) = best;
        let outline = Outline {
            lower: Vec2::new(left as f32, bottom as f32),
            upper: Vec2::new(right as f32, top as f32),
            is_round: false,
        };
        (sum > 0.0).then_some((sum, outline))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 60;

    fn scores(is_mirror: impl Fn(Vec2) -> bool) -> Scores {
        let mut scores = Scores {
            width: WIDTH,
            cells: vec![0.0; WIDTH * 40],
        };
        // A tenth of the cells says the opposite.
        let cells = scores.middles().enumerate();
        let score = |(i, at)| match is_mirror(at) != (i * 7 % 10 == 3) {
            true => 1.0,
            false => -1.0,
        };
        scores.cells = cells.map(score).collect();
        scores
    }

    #[test]
    fn a_rectangle_is_found_among_cells_that_err() {
        let found = scores(|at| at.x > 11.0 && at.x < 43.0 && at.y > 8.0 && at.y < 20.0);
        let (sum, outline) = found.best().unwrap();
        assert!(!outline.is_round);
        let off = (outline.lower - Vec2::new(11.0, 8.0)).abs()
            + (outline.upper - Vec2::new(43.0, 20.0)).abs();
        assert!(off.max_element() <= 1.0, "{outline:?}");
        assert!((sum - 0.8 * 32.0 * 12.0).abs() < 40.0, "{sum}");
    }

    #[test]
    fn a_disc_is_round_and_keeps_its_size() {
        let centre = Vec2::new(27.0, 19.0);
        let found = scores(|at| at.distance(centre) < 14.0);
        let (_, outline) = found.best().unwrap();
        assert!(outline.is_round, "{outline:?}");
        assert!(outline.centre().distance(centre) < 1.5, "{outline:?}");
        let off = (outline.size() - 28.0).abs().max_element();
        assert!(off < 3.0, "{outline:?}");
    }

    #[test]
    fn a_wall_without_a_mirror_has_no_outline() {
        let mut none = scores(|_| false);
        none.cells.fill(-0.1);
        assert_eq!(none.best(), None);
    }
}
