//! The camera models of COLMAP: one table of ids, names and parameters.

use super::profile::Profile;
use std::fmt;
use std::str::FromStr;

/// Most parameters that a model has.
pub(super) const MAX_PARAMS: usize = 16;

/// A camera model of COLMAP (`sensor/models.h`, up to version 4.1). The value of a variant is its
/// id in binary models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum LensModel {
    /// `f, cx, cy`
    SimplePinhole,
    /// `fx, fy, cx, cy`
    Pinhole,
    /// `f, cx, cy, k`
    SimpleRadial,
    /// `f, cx, cy, k1, k2`
    Radial,
    /// `fx, fy, cx, cy, k1, k2, p1, p2`
    OpenCv,
    /// `fx, fy, cx, cy, k1, k2, k3, k4` (Kannala and Brandt)
    OpenCvFisheye,
    /// `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6`; k4 to k6 in the denominator
    FullOpenCv,
    /// `fx, fy, cx, cy, omega` (Devernay and Faugeras)
    Fov,
    /// `f, cx, cy, k`
    SimpleRadialFisheye,
    /// `f, cx, cy, k1, k2`
    RadialFisheye,
    /// `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1`
    ThinPrismFisheye,
    /// `fx, fy, cx, cy, k0 … k5, p0, p1, s0 … s3` (Project Aria)
    RadTanThinPrismFisheye,
    /// `f, cx, cy, k` (Fitzgibbon)
    SimpleDivision,
    /// `fx, fy, cx, cy, k`
    Division,
    /// `f, cx, cy`
    SimpleFisheye,
    /// `fx, fy, cx, cy`
    Fisheye,
    /// `fx, fy, cx, cy, alpha, beta` (Khomutenko, Garcia and Martinet)
    Eucm,
    /// `w, h`
    Equirectangular,
}

struct ModelRow {
    model: LensModel,
    name: &'static str,
    params: &'static [&'static str],
    profile: Profile,
    /// The same model with a focal length for each axis.
    two_focals: LensModel,
}

use LensModel as M;
#[rustfmt::skip]
const TABLE: [ModelRow; 18] = [
    row(M::SimplePinhole, "SIMPLE_PINHOLE", &["f", "cx", "cy"], Profile::Perspective, M::Pinhole),
    row(M::Pinhole, "PINHOLE", &["fx", "fy", "cx", "cy"], Profile::Perspective, M::Pinhole),
    row(M::SimpleRadial, "SIMPLE_RADIAL", &["f", "cx", "cy", "k1"], Profile::Perspective, M::OpenCv),
    row(M::Radial, "RADIAL", &["f", "cx", "cy", "k1", "k2"], Profile::Perspective, M::OpenCv),
    row(M::OpenCv, "OPENCV", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"], Profile::Perspective, M::OpenCv),
    row(M::OpenCvFisheye, "OPENCV_FISHEYE", &["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"], Profile::Equidistant, M::OpenCvFisheye),
    row(M::FullOpenCv, "FULL_OPENCV", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"], Profile::Perspective, M::FullOpenCv),
    row(M::Fov, "FOV", &["fx", "fy", "cx", "cy", "omega"], Profile::Fov, M::Fov),
    row(M::SimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", &["f", "cx", "cy", "k1"], Profile::Equidistant, M::OpenCvFisheye),
    row(M::RadialFisheye, "RADIAL_FISHEYE", &["f", "cx", "cy", "k1", "k2"], Profile::Equidistant, M::OpenCvFisheye),
    row(M::ThinPrismFisheye, "THIN_PRISM_FISHEYE", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"], Profile::Equidistant, M::ThinPrismFisheye),
    row(M::RadTanThinPrismFisheye, "RAD_TAN_THIN_PRISM_FISHEYE", &["fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3"], Profile::Equidistant, M::RadTanThinPrismFisheye),
    row(M::SimpleDivision, "SIMPLE_DIVISION", &["f", "cx", "cy", "k"], Profile::Division, M::Division),
    row(M::Division, "DIVISION", &["fx", "fy", "cx", "cy", "k"], Profile::Division, M::Division),
    row(M::SimpleFisheye, "SIMPLE_FISHEYE", &["f", "cx", "cy"], Profile::Equidistant, M::Fisheye),
    row(M::Fisheye, "FISHEYE", &["fx", "fy", "cx", "cy"], Profile::Equidistant, M::Fisheye),
    row(M::Eucm, "EUCM", &["fx", "fy", "cx", "cy", "alpha", "beta"], Profile::Eucm, M::Eucm),
    row(M::Equirectangular, "EQUIRECTANGULAR", &["w", "h"], Profile::Equirectangular, M::Equirectangular),
];

const fn row(
    model: LensModel,
    name: &'static str,
    params: &'static [&'static str],
    profile: Profile,
    two_focals: LensModel,
) -> ModelRow {
    ModelRow {
        model,
        name,
        params,
        profile,
        two_focals,
    }
}

impl LensModel {
    /// All models, in the order of their ids.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| row.model)
    }

    /// The model of an id, as in `cameras.bin`.
    pub fn from_id(id: i32) -> Option<Self> {
        let row = TABLE.get(usize::try_from(id).ok()?)?;
        Some(row.model)
    }

    /// The id, as in `cameras.bin`.
    pub fn id(self) -> i32 {
        self as i32
    }

    /// The name, as in `cameras.txt`.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Names of the parameters in their order. A lone radial coefficient is called `k1`.
    pub fn param_names(self) -> &'static [&'static str] {
        self.row().params
    }

    /// The model with a focal length for each axis that can be all that this one can.
    pub(super) fn with_two_focals(self) -> Self {
        self.row().two_focals
    }

    pub(super) fn profile(self) -> Profile {
        self.row().profile
    }

    fn row(self) -> &'static ModelRow {
        &TABLE[self as usize]
    }
}

impl fmt::Display for LensModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for LensModel {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let row = TABLE.iter().find(|row| row.name == name);
        row.map(|row| row.model)
            .ok_or_else(|| format!("`{}` is no camera model of COLMAP", name.escape_debug()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_ids() {
        for (id, model) in LensModel::all().enumerate() {
            assert_eq!(model.id(), id as i32);
            assert_eq!(LensModel::from_id(id as i32), Some(model));
            assert_eq!(model.name().parse(), Ok(model));
            assert!(model.param_names().len() <= MAX_PARAMS);
            // A model of two focal lengths has a place for every parameter of the model it stands
            // in for.
            let wide = model.with_two_focals();
            assert_eq!(wide.with_two_focals(), wide);
            for name in model.param_names().iter().filter(|&&name| name != "f") {
                assert!(wide.param_names().contains(name), "{model} {name}");
            }
        }
        assert_eq!(LensModel::from_id(18), None);
        assert_eq!(LensModel::from_id(-1), None);
        assert!(
            "opencv"
                .parse::<LensModel>()
                .unwrap_err()
                .contains("`opencv`")
        );
    }
}
