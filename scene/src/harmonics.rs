//! Light that differs with the direction it is seen from: spherical harmonics of degrees 1 and 2.
//!
//! The radiance of a Gaussian towards an eye is its mean radiance times `exp(Σ cₖ Yₖ(ω))`, where ω
//! points from the eye to the centre of the Gaussian. The functions Yₖ, their signs and their order
//! are those of 3D Gaussian Splatting (Kerbl et al. 2023); there they add to a colour that may
//! become negative, here they are in the exponent, where light stays light and a factor on the
//! radiance scales it all.

pub mod fit;

use glam::{Mat3, Quat, Vec3};

/// Functions of degrees 1 and 2.
pub const NUM_FUNCTIONS: usize = 8;

/// Coefficients of one Gaussian: [`NUM_FUNCTIONS`] for each of three channels.
pub const NUM_COEFFICIENTS: usize = 3 * NUM_FUNCTIONS;

/// The highest degree there is.
pub const MAX_DEGREE: u32 = 2;

/// Exponents end here, at a factor of 3000: coefficients of any size give finite light.
pub const MAX_EXPONENT: f32 = 8.0;

/// √(3 / 4π).
const LINEAR: f32 = 0.488_602_52;
/// √(15 / 4π).
const PRODUCT: f32 = 1.092_548_5;
/// √(5 / 16π).
const ZONAL: f32 = 0.315_391_57;
/// √(15 / 16π).
const DIFFERENCE: f32 = 0.546_274_24;

/// The numbers of the functions, with their names in kernels.
pub const FUNCTION_CONSTANTS: [(&str, f32); 4] = [
    ("HARMONIC_LINEAR", LINEAR),
    ("HARMONIC_PRODUCT", PRODUCT),
    ("HARMONIC_ZONAL", ZONAL),
    ("HARMONIC_DIFFERENCE", DIFFERENCE),
];

/// Number of functions of degrees 1 to `degree`.
pub fn num_functions(degree: u32) -> usize {
    (degree * (degree + 2)) as usize
}

/// The functions in a unit `direction`.
#[inline]
pub fn functions(direction: Vec3) -> [f32; NUM_FUNCTIONS] {
    let Vec3 { x, y, z } = direction;
    [
        -LINEAR * y,
        LINEAR * z,
        -LINEAR * x,
        PRODUCT * (x * y),
        -PRODUCT * (y * z),
        ZONAL * (2.0 * z * z - x * x - y * y),
        -PRODUCT * (x * z),
        DIFFERENCE * (x * x - y * y),
    ]
}

/// The functions in the direction from `eye` to a Gaussian at `position`; all zero where these are
/// one point.
#[inline]
pub fn functions_from(eye: Vec3, position: Vec3) -> [f32; NUM_FUNCTIONS] {
    functions((position - eye).normalize_or_zero())
}

/// Coefficient k of channel c at `3 k + c`.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Harmonics(pub [f32; NUM_COEFFICIENTS]);

impl Harmonics {
    /// The same light in all directions.
    pub const NONE: Self = Self([0.0; NUM_COEFFICIENTS]);

    /// Factor on the radiance, for the `functions` of a direction.
    #[inline]
    pub fn factor(&self, functions: &[f32; NUM_FUNCTIONS]) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (coefficients, value) in self.0.as_chunks::<3>().0.iter().zip(functions) {
            sum += Vec3::from(*coefficients) * *value;
        }
        sum.clamp(Vec3::splat(-MAX_EXPONENT), Vec3::splat(MAX_EXPONENT))
            .map(f32::exp)
    }

    /// Radiance that a Gaussian of this `radiance` at `position` emits towards `eye`.
    #[inline]
    pub fn seen(&self, radiance: Vec3, position: Vec3, eye: Vec3) -> Vec3 {
        radiance * self.factor(&functions_from(eye, position))
    }

    /// As of a Gaussian that was turned by `rotation`, unit, together with its light.
    pub fn rotated(&self, rotation: Quat) -> Self {
        let frame = Mat3::from_quat(rotation);
        let mut out = Self::NONE;
        for channel in 0..3 {
            let c = |k: usize| self.0[3 * k + channel];
            // Degree 1 is a linear form of the direction, degree 2 a quadratic one without a trace.
            let linear = frame * (LINEAR * Vec3::new(-c(2), -c(0), c(1)));
            let (xy, yz, xz) = (
                0.5 * PRODUCT * c(3),
                -0.5 * PRODUCT * c(4),
                -0.5 * PRODUCT * c(6),
            );
            let (zonal, difference) = (ZONAL * c(5), DIFFERENCE * c(7));
            let quadratic = Mat3::from_cols(
                Vec3::new(difference - zonal, xy, xz),
                Vec3::new(xy, -difference - zonal, yz),
                Vec3::new(xz, yz, 2.0 * zonal),
            );
            let m = frame * quadratic * frame.transpose();
            let turned = [
                -linear.y / LINEAR,
                linear.z / LINEAR,
                -linear.x / LINEAR,
                2.0 * m.x_axis.y / PRODUCT,
                -2.0 * m.y_axis.z / PRODUCT,
                0.5 * m.z_axis.z / ZONAL,
                -2.0 * m.x_axis.z / PRODUCT,
                0.5 * (m.x_axis.x - m.y_axis.y) / DIFFERENCE,
            ];
            for (k, value) in turned.into_iter().enumerate() {
                out.0[3 * k + channel] = value;
            }
        }
        out
    }
}

impl Default for Harmonics {
    fn default() -> Self {
        Self::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, RandomKey};

    /// Directions spread evenly over the sphere (a Fibonacci lattice).
    fn directions(num: usize) -> impl Iterator<Item = Vec3> {
        (0..num).map(move |i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / num as f32;
            let angle = 2.399_963_2 * i as f32;
            let radius = (1.0 - z * z).sqrt();
            Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
        })
    }

    fn sample() -> Harmonics {
        let mut stream = RandomKey::new(3, Purpose::Initialise, 0).stream(0, 0);
        let mut coefficients = [0.0; NUM_COEFFICIENTS];
        for four in coefficients.as_chunks_mut::<4>().0 {
            *four = stream.next_uniforms().map(|u| u - 0.5);
        }
        Harmonics(coefficients)
    }

    #[test]
    fn the_functions_are_orthonormal_and_have_no_mean() {
        let num = 20_000;
        let mut products = [[0.0_f64; NUM_FUNCTIONS]; NUM_FUNCTIONS];
        let mut means = [0.0_f64; NUM_FUNCTIONS];
        for y in directions(num).map(functions) {
            for k in 0..NUM_FUNCTIONS {
                means[k] += f64::from(y[k]);
                for l in 0..NUM_FUNCTIONS {
                    products[k][l] += f64::from(y[k] * y[l]);
                }
            }
        }
        let area = 4.0 * std::f64::consts::PI / num as f64;
        for k in 0..NUM_FUNCTIONS {
            // The lattice integrates polynomials of degree 4 to about one part in a thousand of the
            // number of its points.
            assert!((means[k] * area).abs() < 1e-3);
            for l in 0..NUM_FUNCTIONS {
                let wanted = f64::from(u8::from(k == l));
                assert!((products[k][l] * area - wanted).abs() < 1e-3, "{k} {l}");
            }
        }
    }

    #[test]
    fn light_turns_with_what_it_leaves() {
        let (harmonics, turn) = (sample(), Quat::from_xyzw(0.1, -0.7, 0.3, 0.6).normalize());
        let turned = harmonics.rotated(turn);
        for direction in directions(100) {
            let before = harmonics.factor(&functions(direction));
            let after = turned.factor(&functions(turn * direction));
            assert!((before - after).abs().max_element() < 1e-5, "{direction}");
        }
        let same = harmonics.rotated(Quat::IDENTITY).0;
        let off = same.iter().zip(harmonics.0).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-6);
    }

    #[test]
    fn no_coefficient_makes_light_that_is_no_number() {
        let wild = Harmonics([1e30; NUM_COEFFICIENTS]);
        for direction in directions(20) {
            assert!(wild.factor(&functions(direction)).is_finite());
        }
        assert_eq!(Harmonics::NONE.factor(&functions(Vec3::X)), Vec3::ONE);
        assert_eq!(functions_from(Vec3::ONE, Vec3::ONE), [0.0; NUM_FUNCTIONS]);
    }
}
