//! Gloss of a surface by how its radiance differs with the direction.
//!
//! A point of albedo P seen at cosine μ sends `d (1 − E(μ)) + F₀ A + B` to the eye: A and B are the
//! light of its specular lobe without and with Schlick's factor, E = F₀ a + b the albedo of the
//! lobe, and d, what it scatters, is its own and unknown. Differences from the mean over the views
//! of the same point are left to speak: with d = m − F₀ Ā − B̄, m the mean of what is seen, the
//! model is a polynomial in F₀, `x₀ + F₀ x₁ + F₀² x₂`, whose sums of products add up over points
//! and surfaces.
//!
//! A and B are sampled, twice: products of one half with the other are free of the noise that would
//! make gloss look weaker than it is.

/// Roughnesses that are tried.
pub(super) const ROUGHNESSES: [f32; 7] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65];
pub(super) const NUM: usize = ROUGHNESSES.len();
/// F0 that are tried, from the least to 1 in equal ratios, and some beyond either end: where those
/// explain most, the model does not hold.
const LEAST_SPECULAR: f64 = 0.02;
const NUM_SPECULARS: usize = 40;
const NUM_BEYOND: usize = 4;

/// A surface scatters if more is seen than this many times what its lobe can mirror: the F0 that
/// are tried are 10 % apart.
const BARE_TOLERANCE: f64 = 1.1;

/// Share of what a lobe beyond the ideal mirror explains that the mirror has to.
const MIRROR_SHARE: f64 = 0.95;

/// Share of what a lobe mirrors that has to be seen: the scene that it is predicted from may be too
/// bright where a dark part of it is mirrored.
const LEAST_SHOWN: f64 = 0.5;

/// One view of a point, for one roughness.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lobe {
    /// Light of the lobe without Schlick's factor, A, by half of the samples.
    pub(super) facing: [f64; 2],
    /// With it, B.
    pub(super) edge: [f64; 2],
    /// Albedo of the lobe without it, a, and with it, b.
    pub(super) albedo: [f64; 2],
}

/// One view of a point.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    /// Light that is seen.
    pub(super) light: f64,
    pub(super) weight: f64,
    pub(super) lobes: [Lobe; NUM],
}

/// Sums over views of points, demeaned for each point; for one roughness.
#[derive(Debug, Clone, Copy, Default)]
struct Products {
    /// x₀x₀, x₀x₁, x₀x₂, x₁x₁, x₁x₂, x₂x₂ between the halves of samples.
    across: [f64; 6],
    /// The same within the halves.
    within: [f64; 6],
    /// With what is seen.
    with_light: [f64; 3],
    /// Sums of A and of B, not demeaned.
    level: [f64; 2],
    /// Of what is not demeaned, AA, AB and BB between the halves of samples, and A and B with what
    /// is seen.
    whole: [f64; 5],
}

const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Factors of [`PAIRS`] in the square of the polynomial.
fn square(specular: f64) -> [f64; 6] {
    let f = specular;
    [1.0, 2.0 * f, 2.0 * f * f, f * f, 2.0 * f.powi(3), f.powi(4)]
}

/// Normal equations over views of points; those of several surfaces add up.
#[derive(Debug, Clone, Default)]
pub(super) struct NormalEquations {
    of_light: f64,
    /// Sums of what is seen and of its square, not demeaned.
    level: f64,
    squares: f64,
    lobes: [Products; NUM],
    pub(super) num_seen: usize,
    pub(super) num_points: usize,
}

impl NormalEquations {
    /// Adds the views of one point; a single one says nothing.
    pub(super) fn add_point(&mut self, views: &[Seen]) {
        let total: f64 = views.iter().map(|view| view.weight).sum();
        if views.len() < 2 || total <= 0.0 {
            return;
        }
        let mean_of = |value: &dyn Fn(&Seen) -> f64| {
            views.iter().map(|v| v.weight * value(v)).sum::<f64>() / total
        };
        let mean = mean_of(&|view| view.light);
        self.num_seen += views.len();
        self.num_points += 1;
        for view in views {
            self.of_light += view.weight * (view.light - mean).powi(2);
            self.level += view.weight * view.light;
            self.squares += view.weight * view.light.powi(2);
        }
        for (k, products) in self.lobes.iter_mut().enumerate() {
            let both = |halves: [f64; 2]| 0.5 * (halves[0] + halves[1]);
            let facing = mean_of(&|view| both(view.lobes[k].facing));
            let edge = mean_of(&|view| both(view.lobes[k].edge));
            products.level[0] += total * facing;
            products.level[1] += total * edge;
            for view in views {
                let Lobe { facing, edge, .. } = view.lobes[k];
                let sums = [
                    facing[0] * facing[1],
                    0.5 * (facing[0] * edge[1] + facing[1] * edge[0]),
                    edge[0] * edge[1],
                    view.light * both(facing),
                    view.light * both(edge),
                ];
                for (sum, product) in products.whole.iter_mut().zip(sums) {
                    *sum += view.weight * product;
                }
            }
            let left = mean - edge;
            let terms = |view: &Seen| {
                let lobe = &view.lobes[k];
                let [a, b] = lobe.albedo;
                [0, 1].map(|half| {
                    [
                        lobe.edge[half] - left * b,
                        lobe.facing[half] - left * a + facing * b,
                        facing * a,
                    ]
                })
            };
            let mut means = [[0.0; 3]; 2];
            let rows: Vec<[[f64; 3]; 2]> = views.iter().map(terms).collect();
            for (view, row) in views.iter().zip(&rows) {
                for (mean, value) in means.as_flattened_mut().iter_mut().zip(row.as_flattened()) {
                    *mean += view.weight / total * value;
                }
            }
            for (view, row) in views.iter().zip(&rows) {
                let x = |half: usize, term: usize| row[half][term] - means[half][term];
                for (sums, (i, j)) in (0..6).zip(PAIRS) {
                    let across = x(0, i) * x(1, j) + x(1, i) * x(0, j);
                    let within = x(0, i) * x(0, j) + x(1, i) * x(1, j);
                    products.across[sums] += 0.5 * view.weight * across;
                    products.within[sums] += 0.5 * view.weight * within;
                }
                let light = view.light - mean;
                for (term, sum) in products.with_light.iter_mut().enumerate() {
                    *sum += view.weight * light * 0.5 * (x(0, term) + x(1, term));
                }
            }
        }
    }

    /// Adds sums over other points.
    pub(super) fn add(&mut self, other: &Self) {
        self.of_light += other.of_light;
        self.level += other.level;
        self.squares += other.squares;
        self.num_seen += other.num_seen;
        self.num_points += other.num_points;
        for (sum, more) in self.lobes.iter_mut().zip(&other.lobes) {
            let add = |sums: &mut [f64], more: &[f64]| {
                sums.iter_mut()
                    .zip(more)
                    .for_each(|(sum, more)| *sum += more);
            };
            add(&mut sum.across, &more.across);
            add(&mut sum.within, &more.within);
            add(&mut sum.with_light, &more.with_light);
            add(&mut sum.level, &more.level);
            add(&mut sum.whole, &more.whole);
        }
    }

    /// Share of the differences between views that a lobe explains: 1 for all of them, negative
    /// where it predicts others.
    pub(super) fn explained(&self, lobe: Fit) -> f64 {
        if self.of_light <= 0.0 {
            return 0.0;
        }
        let f = lobe.specular;
        let products = &self.lobes[lobe.roughness];
        let [x0, x1, x2] = products.with_light;
        let predicted = sum_of(&products.across, f);
        (2.0 * (x0 + f * x1 + f * f * x2) - predicted) / self.of_light
    }

    /// Part of what is predicted that is not noise of samples, 0 to 1.
    pub(super) fn certainty(&self, lobe: Fit) -> f64 {
        let products = &self.lobes[lobe.roughness];
        let within = sum_of(&products.within, lobe.specular);
        if within <= 0.0 {
            return 0.0;
        }
        (sum_of(&products.across, lobe.specular) / within).clamp(0.0, 1.0)
    }

    /// The lobe that explains most, of those that are certain enough; `None` without any. Beyond
    /// the ideal mirror there is nothing: where that explains most, and the mirror nearly as much,
    /// the lobe is the mirror's.
    pub(super) fn fit(&self, certainty: f64) -> Option<Fit> {
        let all = (0..NUM).flat_map(|roughness| speculars().map(move |f| Fit::new(roughness, f)));
        let best = self.best(all.filter(|&lobe| self.certainty(lobe) >= certainty))?;
        let mirror = Fit::new(best.roughness, best.specular.min(1.0));
        let is_as_good = self.explained(mirror) >= MIRROR_SHARE * self.explained(best);
        Some(if is_as_good { mirror } else { best })
    }

    /// Whether as much is seen, about, as a lobe mirrors: a surface that has it sends at least
    /// that.
    pub(super) fn shows(&self, lobe: Fit) -> bool {
        let [facing, edge] = self.lobes[lobe.roughness].level;
        self.level >= LEAST_SHOWN * (lobe.specular * facing + edge)
    }

    /// Share of the differences between views that a lobe explains alone, nothing being scattered:
    /// 0 where it tells what is seen no better than the mean of each point.
    pub(super) fn explained_alone(&self, lobe: Fit) -> f64 {
        let f = lobe.specular;
        let [aa, ab, bb, al, bl] = self.lobes[lobe.roughness].whole;
        let error = self.squares - 2.0 * (f * al + bl) + f * f * aa + 2.0 * f * ab + bb;
        1.0 - error / self.of_light.max(f64::MIN_POSITIVE)
    }

    /// The lobe of a bare metal, with the F0 at which it mirrors all that is seen if that is as
    /// well explained as any; `None` where more is seen than it may mirror.
    ///
    /// Where the scene is a little off, so are the mirror images that are predicted, and the F0
    /// that explains most is too small, by no more than what is left unexplained.
    pub(super) fn bare(&self, lobe: Fit) -> Option<Fit> {
        let [facing, edge] = self.lobes[lobe.roughness].level;
        let specular = (self.level - edge) / facing;
        let most = lobe.specular / self.explained(lobe);
        let is_best = (lobe.specular..=most).contains(&specular);
        let bare = match is_best {
            true => Fit::new(lobe.roughness, specular.min(1.0)),
            false => lobe,
        };
        (specular <= BARE_TOLERANCE * most).then_some(bare)
    }

    /// The F0 that explains most for one of [`ROUGHNESSES`].
    pub(super) fn fit_specular(&self, roughness: usize) -> f64 {
        let all = speculars().map(|f| Fit::new(roughness, f));
        self.best(all).map_or(LEAST_SPECULAR, |fit| fit.specular)
    }

    fn best(&self, lobes: impl Iterator<Item = Fit>) -> Option<Fit> {
        lobes.max_by(|&a, &b| self.explained(a).total_cmp(&self.explained(b)))
    }
}

fn sum_of(products: &[f64; 6], specular: f64) -> f64 {
    let factors = square(specular);
    products.iter().zip(factors).map(|(sum, f)| sum * f).sum()
}

fn speculars() -> impl Iterator<Item = f64> {
    let step = |i: usize| (i as f64 - 1.0) / (NUM_SPECULARS - 1) as f64;
    (0..NUM_SPECULARS + 1 + NUM_BEYOND).map(move |i| LEAST_SPECULAR.powf(1.0 - step(i)))
}

/// A lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Index in [`ROUGHNESSES`].
    pub(super) roughness: usize,
    /// F0.
    pub(super) specular: f64,
}

impl Fit {
    fn new(roughness: usize, specular: f64) -> Self {
        Self {
            roughness,
            specular,
        }
    }

    /// Whether its F0 lies within the range of surfaces.
    pub(super) fn is_sound(self) -> bool {
        let tolerance = 1.0 + 1e-6;
        (LEAST_SPECULAR / tolerance..=tolerance).contains(&self.specular)
    }
}

#[cfg(test)]
mod tests;
