//! The views that tell most of the lights.
//!
//! One after the other, the view is taken that adds most to the determinant of the normal equations
//! of all that were taken (D-optimal designs: Fedorov 1972): a view that shows a lamp which none of
//! them shows adds more than another view of a lamp that is there.

use super::solve::NormalEquations;
use nalgebra::DMatrix;

/// Part of the information of all views that is taken for known before the first: less than what
/// one of thousands of pixels tells.
const PRIOR: f64 = 1e-6;

/// Indices of `num` of the `views`, in order.
pub(super) fn best(views: &[NormalEquations], num: usize) -> Vec<usize> {
    let Some(first) = views.first() else {
        return Vec::new();
    };
    let size = first.squares.nrows();
    let mut all = DMatrix::zeros(size, size);
    for view in views {
        all += &view.squares;
    }
    // In units of what all views tell of each light, so that bright lamps are worth no more than
    // others; nothing tells of a light that is in no view.
    let unit = |i: usize| 1.0 / all[(i, i)].max(f64::MIN_POSITIVE).sqrt();
    let scaled = |squares: &DMatrix<f64>| {
        DMatrix::from_fn(size, size, |i, j| squares[(i, j)] * unit(i) * unit(j))
    };
    let views: Vec<DMatrix<f64>> = views.iter().map(|view| scaled(&view.squares)).collect();
    let mut known = DMatrix::identity(size, size) * PRIOR;
    let mut chosen: Vec<usize> = Vec::with_capacity(num);
    while chosen.len() < num.min(views.len()) {
        let worth = |i: &usize| (&known + &views[*i]).determinant();
        let left = (0..views.len()).rev().filter(|i| !chosen.contains(i));
        // Of equal ones the first.
        let Some(next) = left.max_by(|a, b| worth(a).total_cmp(&worth(b))) else {
            break;
        };
        known += &views[next];
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(rows: &[[f64; 3]]) -> NormalEquations {
        let mut sums = NormalEquations::new(3);
        for row in rows {
            sums.add(row, 1.0, 1.0);
        }
        sums
    }

    #[test]
    fn views_that_show_what_others_do_not_are_chosen() {
        let views = [
            // All lights alike, which tells none of them apart.
            view(&[[0.1, 0.1, 0.1]; 50]),
            view(&[[100.0, 0.0, 0.0]; 9]),
            view(&[[100.0, 0.0, 0.0]; 8]),
            // The second is a hundred times weaker than the first.
            view(&[[0.0, 1.0, 0.0]; 4]),
            view(&[[0.0, 0.0, 7.0], [0.0, 1.0, 1.0]]),
        ];
        assert_eq!(best(&views, 3), [1, 3, 4]);
        assert_eq!(best(&views, 9).len(), 5);
        // The only one of two that tells of the others.
        assert_eq!(best(&views[..2], 1), [0]);
        // A light that is nowhere changes nothing.
        let blind = [
            view(&[[1.0, 0.0, 0.0]]),
            view(&[[2.0, 1.0, 0.0]]),
            view(&[[1.0, 0.0, 0.0]]),
        ];
        assert_eq!(best(&blind, 1), [1]);
    }
}
