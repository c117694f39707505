//! The rectangle that a pinhole image shows, in the plane at distance 1.

use super::options::Field;
use crate::lens::Lens;
use glam::DVec2;

/// Positions along an edge of the image that are tested; finer than any lens bends within a
/// pixel of its size.
const NUM_EDGE_POINTS: u32 = 512;

/// A rectangle in the plane at distance 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) low: DVec2,
    pub(super) high: DVec2,
}

/// The rectangle inside of the image's edges, or around them, as seen from the axis.
pub(super) fn edge_bounds(lens: &Lens, field: Field) -> Bounds {
    let (width, height) = lens.size();
    let (width, height) = (f64::from(width), f64::from(height));
    let plane = |x: f64, y: f64| {
        let ray = lens.unproject(DVec2::new(x, y)).filter(|ray| ray.z > 0.0)?;
        Some(ray.truncate() / ray.z)
    };
    // The larger of two bounds is the inner one on the low side.
    let inner = field == Field::Inside;
    let edge = |at: &dyn Fn(f64) -> Option<f64>, is_low: bool| {
        let along = (0..=NUM_EDGE_POINTS).map(|i| f64::from(i) / f64::from(NUM_EDGE_POINTS));
        let chosen =
            (along.filter_map(at)).reduce(|a, b| if inner == is_low { a.max(b) } else { a.min(b) });
        let open = if is_low {
            f64::NEG_INFINITY
        } else {
            f64::INFINITY
        };
        chosen.unwrap_or(open)
    };
    Bounds {
        low: DVec2::new(
            edge(&|t| Some(plane(0.0, t * height)?.x), true),
            edge(&|t| Some(plane(t * width, 0.0)?.y), true),
        ),
        high: DVec2::new(
            edge(&|t| Some(plane(width, t * height)?.x), false),
            edge(&|t| Some(plane(t * width, height)?.y), false),
        ),
    }
}

impl Bounds {
    pub(super) fn clamped(self, limit: f64) -> Self {
        Self {
            low: self.low.max(DVec2::splat(-limit)),
            high: self.high.min(DVec2::splat(limit)),
        }
    }

    /// Moves the sides inwards until all of them lie in the lens's image: its corners may be beyond
    /// what the edges' middles show.
    pub(super) fn shrunk_to_known(mut self, lens: &Lens, focal: DVec2) -> Self {
        const NUM_STEPS: f64 = 512.0;
        let step = ((self.high - self.low) / NUM_STEPS).max(1.0 / focal);
        let known = |p: DVec2| {
            let pixel = lens.project(p.extend(1.0));
            pixel.is_some_and(|pixel| lens.contains(pixel))
        };
        while self.low.cmplt(self.high).all() {
            let sides = self.unknown_on_sides(known);
            let worst = sides.into_iter().max().unwrap_or(0);
            if worst == 0 {
                break;
            }
            let [left, right, top, bottom] = sides.map(|num| f64::from(u8::from(num == worst)));
            self.low += step * DVec2::new(left, top);
            self.high -= step * DVec2::new(right, bottom);
        }
        self
    }

    /// Numbers of unknown positions on the left, right, upper and lower side.
    fn unknown_on_sides(&self, known: impl Fn(DVec2) -> bool) -> [usize; 4] {
        let size = self.high - self.low;
        let along = (0..=NUM_EDGE_POINTS).map(|i| f64::from(i) / f64::from(NUM_EDGE_POINTS));
        let count =
            |start: DVec2, way: DVec2| along.clone().filter(|&t| !known(start + way * t)).count();
        let (across, down) = (DVec2::new(size.x, 0.0), DVec2::new(0.0, size.y));
        [
            count(self.low, down),
            count(self.low + across, down),
            count(self.low, across),
            count(self.low + down, across),
        ]
    }
}
