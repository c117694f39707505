//! Axes of normal maps: interpretation of a stored vector, and the best one.

use super::Space;
use glam::{DMat3, DVec3};
use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Which component of a stored vector, with which sign, is x, y and z.
///
/// In the camera's space x is right, y down, z forward; in the world they are the dataset's.
/// Spelled `x,-y,-z`, or by a name:
///
/// | name | stored x y z | |
/// |---|---|---|
/// | `opencv` | right, down, forward | `x,y,z` |
/// | `opengl` | right, up, to the viewer | `x,-y,-z` |
/// | `directx` | right, down, to the viewer | `x,y,-z` |
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axes([(usize, i8); 3]);

const NAMES: [(&str, Axes); 3] = [
    ("opencv", Axes([(0, 1), (1, 1), (2, 1)])),
    ("opengl", Axes([(0, 1), (1, -1), (2, -1)])),
    ("directx", Axes([(0, 1), (1, 1), (2, -1)])),
];
const LETTERS: [&str; 3] = ["x", "y", "z"];

impl Axes {
    /// Vectors as they are stored.
    pub const IDENTITY: Self = NAMES[0].1;

    /// The matrix that reads a stored vector.
    pub fn matrix(self) -> DMat3 {
        let row = |(component, sign): (usize, i8)| DVec3::AXES[component] * f64::from(sign);
        let [x, y, z] = self.0.map(row);
        DMat3::from_cols(x, y, z).transpose()
    }

    /// The candidate readings: in camera space any signs, as estimators disagree about each; in the
    /// world any rotation that permutes axes, as worlds are rotated but not mirrored.
    pub(super) fn candidates(space: Space) -> Vec<Self> {
        let orders: &[[usize; 3]] = match space {
            Space::Camera => &[[0, 1, 2]],
            Space::World => &[
                [0, 1, 2],
                [1, 2, 0],
                [2, 0, 1],
                [0, 2, 1],
                [2, 1, 0],
                [1, 0, 2],
            ],
        };
        let signs =
            (0..8).map(|bits: u8| [0, 1, 2].map(|k| if bits >> k & 1 == 0 { 1 } else { -1 }));
        let all = orders.iter().flat_map(|order| {
            let signs = signs.clone();
            signs.map(|signs| Self([0, 1, 2].map(|k| (order[k], signs[k]))))
        });
        all.filter(|axes| space == Space::Camera || axes.matrix().determinant() > 0.0)
            .collect()
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((name, _)) = NAMES[1..].iter().find(|(_, axes)| axes == self) {
            return f.write_str(name);
        }
        let parts = self.0.map(|(component, sign)| {
            let sign = if sign < 0 { "-" } else { "" };
            format!("{sign}{}", LETTERS[component])
        });
        f.write_str(&parts.join(","))
    }
}

impl FromStr for Axes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((_, axes)) = NAMES.iter().find(|(name, _)| *name == text) {
            return Ok(*axes);
        }
        let parse = |part: &str| {
            let (sign, letter) = part.strip_prefix('-').map_or((1, part), |rest| (-1, rest));
            let component = LETTERS.iter().position(|l| *l == letter)?;
            Some((component, sign))
        };
        let parts: Option<Vec<(usize, i8)>> = text.split(',').map(|p| parse(p.trim())).collect();
        let axes = parts
            .and_then(|parts| <[(usize, i8); 3]>::try_from(parts).ok())
            .map(Self);
        axes.filter(|axes| axes.matrix().determinant() != 0.0)
            .ok_or_else(|| {
                format!(
                    "`{}` is none of opencv, opengl, directx, nor three different axes as x,-y,-z",
                    text.escape_debug()
                )
            })
    }
}

impl Serialize for Axes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Sums over places where both a stored vector and a reference are known. The mean cosine between
/// them under any axes follows from these, as a cosine is linear in the stored vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Agreement {
    in_camera: DMat3,
    in_world: DMat3,
    num: u64,
}

impl Agreement {
    /// Of no places.
    pub(super) const NONE: Self = Self {
        in_camera: DMat3::ZERO,
        in_world: DMat3::ZERO,
        num: 0,
    };

    /// Adds a stored unit vector and the reference's unit normal in both spaces.
    pub(super) fn add(&mut self, stored: DVec3, reference_camera: DVec3, reference_world: DVec3) {
        let outer = |a: DVec3| DMat3::from_cols(a * stored.x, a * stored.y, a * stored.z);
        self.in_camera += outer(reference_camera);
        self.in_world += outer(reference_world);
        self.num += 1;
    }

    pub(super) fn and(mut self, other: &Self) -> Self {
        self.in_camera += other.in_camera;
        self.in_world += other.in_world;
        self.num += other.num;
        self
    }

    pub(super) fn num(&self) -> u64 {
        self.num
    }

    /// Mean cosine between references and stored vectors that are read by `axes`.
    pub(super) fn mean_cosine(&self, space: Space, axes: Axes) -> f64 {
        let sum = match space {
            Space::Camera => self.in_camera,
            Space::World => self.in_world,
        };
        let matrix = axes.matrix();
        let products = (0..3).map(|c| sum.col(c).dot(matrix.col(c)));
        products.sum::<f64>() / self.num.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_letters_are_read_and_written() {
        for text in ["opengl", "directx", "x,y,z", "-z,x,-y"] {
            assert_eq!(text.parse::<Axes>().unwrap().to_string(), text);
        }
        assert_eq!("opencv".parse(), Ok(Axes::IDENTITY));
        for text in ["x,y", "x,x,z", "x,y,w", "", "x,y,z,x"] {
            assert!(text.parse::<Axes>().is_err(), "{text}");
        }
        let stored = DVec3::new(1.0, 2.0, 3.0);
        let axes: Axes = "-z,x,-y".parse().unwrap();
        assert_eq!(axes.matrix() * stored, DVec3::new(-3.0, 1.0, -2.0));
        assert_eq!(Axes::candidates(Space::Camera).len(), 8);
        assert_eq!(Axes::candidates(Space::World).len(), 24);
    }

    #[test]
    fn sums_give_the_mean_cosine_of_any_axes() {
        let pairs = [
            (DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, 0.6, -0.8)),
            (DVec3::new(0.0, -0.6, 0.8), DVec3::new(1.0, 0.0, 0.0)),
        ];
        let mut agreement = Agreement::NONE;
        for (stored, reference) in pairs {
            agreement.add(stored, reference, -reference);
        }
        for axes in Axes::candidates(Space::World) {
            let cosines = pairs.map(|(stored, reference)| reference.dot(axes.matrix() * stored));
            let mean = (cosines[0] + cosines[1]) / 2.0;
            assert!((agreement.mean_cosine(Space::Camera, axes) - mean).abs() < 1e-14);
            assert!((agreement.mean_cosine(Space::World, axes) + mean).abs() < 1e-14);
        }
    }
}
