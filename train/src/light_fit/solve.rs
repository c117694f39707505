//! Linear least squares for numbers that are not negative, with error bars.
//!
//! Normal equations are kept of every block of pixels by itself. All blocks together give the
//! solution (active set: Lawson and Hanson 1974, chapter 23); how much single blocks pull at it
//! tells its error. Errors of a scene are those of whole surfaces: pixels are no independent
//! measurements, and blocks are nearly so (standard errors that are robust to clusters: Liang and
//! Zeger 1986).

use nalgebra::{DMatrix, DVector};

/// Part of the largest diagonal element that is added to the diagonal: below what f32 images tell.
const RIDGE: f64 = 1e-12;
/// Part of the largest diagonal element below which an unknown has not been seen.
const UNSEEN: f64 = 1e-10;

/// Weighted sums of equations `row · x = target`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NormalEquations {
    /// Σ w row rowᵀ.
    pub(super) squares: DMatrix<f64>,
    /// Σ w row target.
    products: DVector<f64>,
    /// Σ w target².
    pub(super) total: f64,
}

impl NormalEquations {
    /// No equations, of `num` unknowns.
    pub(super) fn new(num: usize) -> Self {
        Self {
            squares: DMatrix::zeros(num, num),
            products: DVector::zeros(num),
            total: 0.0,
        }
    }

    /// Adds an equation.
    pub(super) fn add(&mut self, row: &[f64], target: f64, weight: f64) {
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row.iter().enumerate() {
                self.squares[(i, j)] += weight * a * b;
            }
            self.products[i] += weight * a * target;
        }
        self.total += weight * target * target;
    }

    /// Σ w (row · x − target)².
    fn residual(&self, x: &DVector<f64>) -> f64 {
        let explained = 2.0 * self.products.dot(x) - x.dot(&(&self.squares * x));
        (self.total - explained).max(0.0)
    }
}

/// A solution.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solution {
    /// The numbers, not negative; 0 where nothing was seen.
    pub(super) x: Vec<f64>,
    /// Whether equations tell of each.
    pub(super) is_seen: Vec<bool>,
    /// How much each block pulls, `[blocks, unknowns]`: together, nothing.
    pub(super) pulls: Vec<Vec<f64>>,
    /// Sum of squares that is left, and of all.
    pub(super) residual: f64,
    pub(super) total: f64,
}

/// Standard error of a number from the pulls of blocks at it.
pub(super) fn standard_error(pulls: impl ExactSizeIterator<Item = f64>) -> f64 {
    let num = pulls.len() as f64;
    (pulls.map(|pull| pull * pull).sum::<f64>() * num / (num - 1.0).max(1.0)).sqrt()
}

/// Solves the equations of all `blocks` of `num` unknowns.
pub(super) fn solve(blocks: &[NormalEquations], num: usize) -> Solution {
    let mut all = NormalEquations::new(num);
    for block in blocks {
        all.squares += &block.squares;
        all.products += &block.products;
        all.total += block.total;
    }
    let most = all.squares.diagonal().max();
    let is_seen: Vec<bool> = (0..num)
        .map(|i| all.squares[(i, i)] > UNSEEN * most)
        .collect();
    let (x, free) = active_set(&all, &is_seen, RIDGE * most);
    let inverse = part(&all.squares, &free, RIDGE * most).try_inverse();
    let inverse = inverse.unwrap_or_else(|| DMatrix::zeros(free.len(), free.len()));
    let pulls = blocks.iter().map(|block| {
        let gradient = &block.products - &block.squares * &x;
        let gradient = DVector::from_iterator(free.len(), free.iter().map(|&i| gradient[i]));
        let pull = &inverse * gradient;
        let mut pulls = vec![0.0; num];
        for (&i, pull) in free.iter().zip(pull.iter()) {
            pulls[i] = *pull;
        }
        pulls
    });
    Solution {
        pulls: pulls.collect(),
        residual: all.residual(&x),
        total: all.total,
        x: x.iter().copied().collect(),
        is_seen,
    }
}

/// The least squares solution without negative numbers, and which of them are not 0.
fn active_set(all: &NormalEquations, is_seen: &[bool], ridge: f64) -> (DVector<f64>, Vec<usize>) {
    let num = is_seen.len();
    let mut x = DVector::zeros(num);
    let mut free: Vec<usize> = Vec::new();
    // Every round frees another one; more than this is rounding going in circles.
    for _ in 0..3 * num {
        let gradient = &all.products - &all.squares * &x;
        let worth = |i: &usize| gradient[*i] / all.squares[(*i, *i)].sqrt();
        let bound = (0..num).filter(|i| is_seen[*i] && !free.contains(i));
        let best = bound.max_by(|a, b| worth(a).total_cmp(&worth(b)));
        match best {
            Some(i) if worth(&i) > 1e-9 * all.total.sqrt() => free.push(i),
            _ => break,
        }
        while !free.is_empty() {
            let squares = part(&all.squares, &free, ridge);
            let products =
                DVector::from_iterator(free.len(), free.iter().map(|&i| all.products[i]));
            let Some(solved) = squares.lu().solve(&products) else {
                break;
            };
            // As far towards it as nothing becomes negative.
            let steps = free.iter().zip(solved.iter());
            let steps = steps.filter(|(_, goal)| **goal <= 0.0);
            let step = steps
                .map(|(&i, goal)| x[i] / (x[i] - goal))
                .fold(1.0, f64::min);
            for (&i, goal) in free.iter().zip(solved.iter()) {
                x[i] += step * (goal - x[i]);
            }
            if step == 1.0 {
                break;
            }
            free.retain(|&i| {
                let stays = x[i] > 1e-12;
                if !stays {
                    x[i] = 0.0;
                }
                stays
            });
        }
    }
    free.sort_unstable();
    (x, free)
}

/// Rows and columns of some unknowns.
fn part(squares: &DMatrix<f64>, of: &[usize], ridge: f64) -> DMatrix<f64> {
    DMatrix::from_fn(of.len(), of.len(), |row, column| {
        let on_diagonal = if row == column { ridge } else { 0.0 };
        squares[(of[row], of[column])] + on_diagonal
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};

    const NUM: usize = 3;

    /// Equations with solution `x`, in `num_blocks` blocks of 50; the targets of a block are off by
    /// the same random number of standard deviation `deviation`.
    fn blocks(x: [f64; NUM], num_blocks: u32, deviation: f64, seed: u64) -> Vec<NormalEquations> {
        let key = RandomKey::new(seed, Purpose::Initialise, 0);
        let block = |b: u32| {
            let mut sums = NormalEquations::new(NUM);
            let normal: f32 = key
                .stream(b, 0)
                .next_uniforms()
                .iter()
                .map(|u| u - 0.5)
                .sum();
            let off = f64::from(normal) * 3_f64.sqrt() * deviation;
            let mut stream = key.stream(b, 1);
            for _ in 0..50 {
                let [p, q, r, w] = stream.next_uniforms().map(f64::from);
                let row = [p, q * q, 1.0 - r * p];
                let target: f64 = row.iter().zip(x).map(|(a, x)| a * x).sum();
                sums.add(&row, target + off, 0.5 + w);
            }
            sums
        };
        (0..num_blocks).map(block).collect()
    }

    #[test]
    fn exact_equations_have_exact_solutions() {
        for x in [[0.5, 2.0, 1.0], [0.0, 3.0, 0.25], [0.0, 0.0, 0.0]] {
            let found = solve(&blocks(x, 20, 0.0, 1), NUM);
            for (found, x) in found.x.iter().zip(x) {
                assert!((found - x).abs() < 1e-8, "{found} not {x}");
            }
            assert!(found.residual <= 1e-10 * found.total);
        }
    }

    #[test]
    fn nothing_is_negative_and_the_others_make_the_best_of_it() {
        let all = blocks([1.0, -0.4, 2.0], 20, 0.0, 2);
        let found = solve(&all, NUM);
        assert_eq!(found.x[1], 0.0);
        assert!(found.x[0] > 0.0 && found.x[2] > 0.0);
        assert!(found.pulls.iter().all(|pulls| pulls[1] == 0.0));
        // No point nearby that may be is better.
        let residual = |x: &[f64]| -> f64 {
            let x = DVector::from_column_slice(x);
            all.iter().map(|block| block.residual(&x)).sum()
        };
        let least = residual(&found.x);
        for i in 0..NUM {
            for step in [-1e-3, 1e-3] {
                let mut other = found.x.clone();
                other[i] += step;
                assert!(other[i] < 0.0 || residual(&other) > least, "{i} {step}");
            }
        }
    }

    #[test]
    fn what_no_equation_tells_of_is_unseen() {
        let mut sums = NormalEquations::new(NUM);
        for (a, b) in [(1.0, 0.0), (1.0, 2.0), (0.0, 1.0)] {
            sums.add(&[a, 0.0, b], 2.0 * a + 3.0 * b, 1.0);
        }
        let found = solve(&[sums], NUM);
        assert_eq!(found.is_seen, [true, false, true]);
        assert_eq!(found.x[1], 0.0);
        assert!((found.x[0] - 2.0).abs() < 1e-9 && (found.x[2] - 3.0).abs() < 1e-9);
    }

    /// Errors that are the same over a block: the bars tell how far solutions scatter.
    #[test]
    fn error_bars_are_the_scatter_of_solutions() {
        let x = [0.5, 2.0, 1.0];
        let found: Vec<Solution> = (0..300)
            .map(|seed| solve(&blocks(x, 60, 0.1, seed), NUM))
            .collect();
        for i in 0..NUM {
            let squares = found.iter().map(|one| (one.x[i] - x[i]).powi(2));
            let scatter = (squares.sum::<f64>() / found.len() as f64).sqrt();
            let told = found
                .iter()
                .map(|one| standard_error(one.pulls.iter().map(|pulls| pulls[i])).powi(2));
            let told = (told.sum::<f64>() / found.len() as f64).sqrt();
            // 300 solutions tell their scatter within 4 %; bars of 60 blocks are a little short.
            assert!((told / scatter - 1.0).abs() < 0.15, "{i}: {told} {scatter}");
        }
    }
}
