//! Distortion in the plane of focal lengths: a radial factor, decentring and thin prisms; and its
//! inverse.
//!
//! The models of OpenCV (`calib3d`) and of Project Aria, of which the radial ones are special
//! cases.

use super::profile::Shape;
use glam::{DMat2, DVec2};
use std::f64::consts::PI;

/// Point at which decentring and prisms are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// At the undistorted point, as OpenCV does.
    OfInput,
    /// At the point that the radial factor has moved, as Aria does.
    AfterRadial,
}

/// Coefficients of a distortion, and how far from the centre it can be inverted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Distortion {
    /// Of r², r⁴, …
    pub(super) numerator: [f64; 6],
    /// Of r², r⁴, r⁶
    pub(super) denominator: [f64; 3],
    /// OpenCV's p1, p2
    pub(super) tangential: DVec2,
    /// Of r² and of r⁴
    pub(super) prism: [DVec2; 2],
    pub(super) order: Order,
    /// Undistorted radius up to which the distorted one grows; the valid field.
    pub(super) max_radius: f64,
}

/// A distorted point and the derivative of it.
struct Moved {
    point: DVec2,
    jacobian: DMat2,
}

/// Steps of the search for the edge of the valid field. A fold between two steps would have to be
/// narrower than 0.05°.
const NUM_ANGLES: u32 = 4096;
/// Newton's method doubles the digits: from a radial start within a few per cent this is far more
/// than it needs.
const MAX_ITERATIONS: u32 = 40;
/// Accepted error of an inverse, focal lengths; a hundredth of the 1e-10 that is promised.
const INVERSE_TOLERANCE: f64 = 1e-12;

impl Distortion {
    /// No distortion.
    pub(super) const NONE: Self = Self {
        numerator: [0.0; 6],
        denominator: [0.0; 3],
        tangential: DVec2::ZERO,
        prism: [DVec2::ZERO; 2],
        order: Order::OfInput,
        max_radius: f64::INFINITY,
    };

    /// Whether points stay where they are.
    pub(super) fn is_none(&self) -> bool {
        self.is_radial() && self.numerator == [0.0; 6] && self.denominator == [0.0; 3]
    }

    fn is_radial(&self) -> bool {
        self.tangential == DVec2::ZERO && self.prism == [DVec2::ZERO; 2]
    }

    /// The same with its valid field found: the smallest radius at which the distorted radius stops
    /// growing, or where the profile ends.
    pub(super) fn with_field(mut self, shape: &Shape) -> Self {
        if self.is_none() {
            return self;
        }
        let grows = |r: f64| self.radial_slope(r) > 0.0;
        let mut inside = 0.0;
        for step in 1..NUM_ANGLES {
            let angle = PI * f64::from(step) / f64::from(NUM_ANGLES);
            let Some(radius) = shape.radius_at(angle) else {
                break;
            };
            if !grows(radius) {
                let (mut low, mut high) = (inside, radius);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    *(if grows(middle) { &mut low } else { &mut high }) = middle;
                }
                inside = low;
                break;
            }
            inside = radius;
        }
        self.max_radius = inside;
        self
    }

    /// The distorted point; `None` outside of the valid field.
    pub(super) fn distort(&self, point: DVec2) -> Option<DVec2> {
        if self.is_none() {
            return Some(point);
        }
        self.moved(point).map(|moved| moved.point)
    }

    /// The point of the valid field that is distorted to `distorted`; `None` if there is none.
    pub(super) fn undistort(&self, distorted: DVec2) -> Option<DVec2> {
        if self.is_none() {
            return Some(distorted);
        }
        let mut point = self.undistort_radially(distorted);
        for _ in 0..MAX_ITERATIONS {
            let moved = self.moved(point)?;
            let error = distorted - moved.point;
            if error.length() <= INVERSE_TOLERANCE * (1.0 + distorted.length()) {
                // One more step costs little and leaves rounding alone.
                let polished = point + moved.jacobian.inverse() * error;
                return (polished.length() <= self.max_radius).then_some(polished);
            }
            let mut step = moved.jacobian.inverse() * error;
            // A step that leaves the field is shortened until it does not.
            while self.moved(point + step).is_none() {
                step *= 0.5;
                if step.length() <= INVERSE_TOLERANCE * (1.0 + point.length()) || step.is_nan() {
                    return None;
                }
            }
            point += step;
        }
        None
    }

    /// The inverse of the radial factor alone, ended at the edge of the field.
    fn undistort_radially(&self, distorted: DVec2) -> DVec2 {
        let wanted = distorted.length();
        let radius = |r: f64| r * self.radial(r * r)[0];
        if wanted == 0.0 {
            return DVec2::ZERO;
        }
        let (mut low, mut high) = (0.0, self.max_radius);
        let mut r = wanted.min(0.5 * high);
        for _ in 0..100 {
            let error = radius(r) - wanted;
            *(if error < 0.0 { &mut low } else { &mut high }) = r;
            let newton = r - error / self.radial_slope(r);
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            if (next - r).abs() <= 1e-15 * r {
                break;
            }
            r = next;
        }
        distorted * (r / wanted)
    }

    fn moved(&self, point: DVec2) -> Option<Moved> {
        let r2 = point.length_squared();
        if r2.sqrt() > self.max_radius || r2.is_nan() {
            return None;
        }
        let [factor, slope] = self.radial(r2);
        let outer = DMat2::from_cols(point * point.x, point * point.y);
        let radial = Moved {
            point: point * factor,
            jacobian: DMat2::from_diagonal(DVec2::splat(factor)) + outer * (2.0 * slope),
        };
        let moved = if self.is_radial() {
            radial
        } else {
            match self.order {
                Order::OfInput => {
                    let shift = self.decentred(point);
                    Moved {
                        point: radial.point + shift.point,
                        jacobian: radial.jacobian + shift.jacobian,
                    }
                }
                Order::AfterRadial => {
                    let shift = self.decentred(radial.point);
                    Moved {
                        point: radial.point + shift.point,
                        jacobian: (DMat2::IDENTITY + shift.jacobian) * radial.jacobian,
                    }
                }
            }
        };
        // A folded image shows the same ray twice.
        (moved.jacobian.determinant() > 0.0).then_some(moved)
    }

    /// The radial factor at r² and its derivative by r².
    fn radial(&self, r2: f64) -> [f64; 2] {
        let [above, d_above] = polynomial(&self.numerator, r2);
        if self.denominator == [0.0; 3] {
            return [above, d_above];
        }
        let [below, d_below] = polynomial(&self.denominator, r2);
        if below <= 0.0 {
            // Beyond a pole: a slope that no field reaches.
            return [f64::NAN; 2];
        }
        [
            above / below,
            (d_above * below - above * d_below) / (below * below),
        ]
    }

    /// Derivative of the distorted radius by the undistorted one.
    fn radial_slope(&self, r: f64) -> f64 {
        let [factor, slope] = self.radial(r * r);
        factor + 2.0 * slope * r * r
    }

    /// Shift by decentring and thin prisms.
    fn decentred(&self, at: DVec2) -> Moved {
        let DVec2 { x, y } = at;
        let [p1, p2] = self.tangential.to_array();
        let r2 = at.length_squared();
        let [square, fourth] = self.prism;
        let prism = square * r2 + fourth * r2 * r2;
        let d_prism = 2.0 * (square + fourth * (2.0 * r2));
        Moved {
            point: DVec2::new(
                2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
            ) + prism,
            jacobian: DMat2::from_cols(
                DVec2::new(2.0 * p1 * y + 6.0 * p2 * x, 2.0 * p2 * y + 2.0 * p1 * x) + d_prism * x,
                DVec2::new(2.0 * p1 * x + 2.0 * p2 * y, 2.0 * p2 * x + 6.0 * p1 * y) + d_prism * y,
            ),
        }
    }
}

/// 1 + c₀ t + c₁ t² + … and its derivative.
fn polynomial(coefficients: &[f64], t: f64) -> [f64; 2] {
    let (mut value, mut slope) = (0.0, 0.0);
    for c in coefficients.iter().rev() {
        slope = slope * t + value;
        value = (value * t) + c;
    }
    // value is now c₀ + c₁ t + …, slope its derivative.
    [1.0 + t * value, value + t * slope]
}
