//! The world's up axis.

use glam::Vec3;
use std::fmt;
use std::str::FromStr;

/// An axis of the world that points up. Files and options spell it "x", "-x", "y", "-y", "z", "-z".
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize,
)]
pub enum UpAxis {
    /// +x
    #[serde(rename = "x")]
    X,
    /// −x
    #[serde(rename = "-x")]
    NegX,
    /// +y
    #[serde(rename = "y")]
    Y,
    /// −y
    #[serde(rename = "-y")]
    NegY,
    /// +z, the convention of this workspace
    #[default]
    #[serde(rename = "z")]
    Z,
    /// −z
    #[serde(rename = "-z")]
    NegZ,
}

impl UpAxis {
    const ALL: [(Self, &'static str, Vec3); 6] = [
        (Self::X, "x", Vec3::X),
        (Self::NegX, "-x", Vec3::NEG_X),
        (Self::Y, "y", Vec3::Y),
        (Self::NegY, "-y", Vec3::NEG_Y),
        (Self::Z, "z", Vec3::Z),
        (Self::NegZ, "-z", Vec3::NEG_Z),
    ];

    /// Unit vector, world space.
    pub fn vector(self) -> Vec3 {
        Self::ALL[self as usize].2
    }

    /// The spelling in files and options.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

impl fmt::Display for UpAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for UpAxis {
    type Err = String;

    /// Also takes a leading "+" and capitals.
    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = text.to_ascii_lowercase();
        let wanted = wanted.strip_prefix('+').unwrap_or(&wanted);
        Self::ALL
            .iter()
            .find(|(_, name, _)| *name == wanted)
            .map(|(axis, ..)| *axis)
            .ok_or_else(|| format!("`{text}` is none of x, -x, y, -y, z, -z"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_has_its_own_row() {
        for (axis, name, vector) in UpAxis::ALL {
            assert_eq!(axis.name().parse(), Ok(axis));
            assert_eq!(
                (axis.to_string().as_str(), axis.vector()),
                (name, vector),
                "{axis:?}"
            );
        }
        assert_eq!("+Y".parse(), Ok(UpAxis::Y));
        assert!("w".parse::<UpAxis>().unwrap_err().contains("`w`"));
    }
}
