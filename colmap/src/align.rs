//! Up direction, floor and direction of the walls, from a sparse model alone.
//!
//! 1. **Gravity** (`gravity`): cameras are held level, so the horizontal axes of their images lie
//!    in one plane of the world, whose normal is vertical. The tops of the images decide its sign.
//! 2. **Floor** ([`floor`]): horizontal planes among the points below the cameras, by RANSAC. The
//!    lowest one with support, extent and no mirror above it is the floor; its normal, together
//!    with the cameras', is the final vertical.
//! 3. **Walls** ([`walls`]): the yaw at which the points, seen from above, concentrate on the
//!    fewest lines along two axes.
//!
//! The aligned world has z up, the floor on z = 0, x along the longer side of the room, and its
//! origin below the median of the cameras. Nothing depends on the unit of the model: lengths derive
//! from its size. The result is a bit-exact function of model and options.

pub mod floor;
pub(crate) mod gravity;
mod manual;
mod numeric;
mod reference;
mod scale;
pub mod walls;

#[cfg(test)]
mod tests;

pub use manual::Manual;
pub(crate) use reference::ReferenceReport;
pub use reference::{KnownCamera, similarity};
pub use scale::{Anchor, Scale};

use crate::error::{ColmapError, Result};
use crate::model::{Model, Similarity};
use floor::FloorReport;
use glam::{DMat3, DQuat, DVec3};
use gravity::{Gravity, GravityReport};
use serde::{Deserialize, Serialize};
use walls::WallReport;

/// Method of finding the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Mode {
    /// From cameras and points
    #[default]
    Floor,
    /// From --floor-points or --floor-at
    ///
    /// Points or positions that the user names.
    Manual,
    /// To the cameras of --like
    ///
    /// The world becomes that of cameras with known positions.
    #[cfg_attr(feature = "clap", value(name = "like"))]
    Reference,
    /// Not at all
    ///
    /// The world is unchanged.
    None,
}

/// Options of [`align`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AlignOptions {
    /// Method of finding the floor.
    pub mode: Mode,
    /// The user's statements.
    pub manual: Manual,
    /// Cameras with known positions, for [`Mode::Reference`].
    pub known_cameras: Vec<KnownCamera>,
    /// Source of the metric scale.
    pub scale: Option<Scale>,
    /// Align walls with the axes; otherwise yaw stays as near to the model's as the floor permits.
    pub walls: bool,
    /// Least confidence of a floor that is accepted, 0 to 1.
    pub min_confidence: f64,
    /// Fewest observations of a point that counts.
    pub min_track: u32,
    /// Largest reprojection error of a point that counts, pixels.
    pub max_error_px: f64,
    /// Seed of the search.
    pub seed: u64,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self {
            mode: Mode::Floor,
            manual: Manual::default(),
            known_cameras: Vec::new(),
            scale: None,
            walls: true,
            min_confidence: 0.2,
            min_track: 3,
            max_error_px: 2.0,
            seed: 0,
        }
    }
}

impl AlignOptions {
    /// Checks ranges and combinations.
    ///
    /// # Errors
    /// The option and its value.
    pub fn validate(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.min_confidence) {
            let problem = format!("{:?} is not 0 to 1", self.min_confidence);
            return Err(ColmapError::option("min_confidence", problem));
        }
        if self.max_error_px.is_nan() || self.max_error_px <= 0.0 {
            let problem = format!("{:?} is not above 0", self.max_error_px);
            return Err(ColmapError::option("max_error_px", problem));
        }
        if self.mode == Mode::Reference && self.scale.is_some() {
            let problem = "the world of known cameras has its scale";
            return Err(ColmapError::option("scale", problem));
        }
        self.manual.validate(self.mode)?;
        self.scale.as_ref().map_or(Ok(()), Scale::validate)
    }
}

/// The result of alignment: findings and the transform.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alignment {
    /// The mode used.
    pub mode: Mode,
    /// The world of the dataset from that of the model.
    pub aligned_from_model: Similarity,
    /// The vertical before the floor was known; null if the user gave it.
    pub(crate) gravity: Option<GravityReport>,
    /// The floor; null without one.
    pub floor: Option<FloorReport>,
    /// The walls; null if they were not requested or not found.
    pub walls: Option<WallReport>,
    /// Fit to known cameras; null if there were none.
    pub(crate) reference: Option<ReferenceReport>,
    /// Confidence of the floor, 0 to 1; 1 if the user gave it, null without a floor.
    pub confidence: Option<f64>,
    /// Whether a unit of the aligned world is a metre.
    pub is_metric: bool,
    /// Median height of the cameras above the floor, aligned units; null without a floor.
    pub camera_height: Option<f64>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// The points and cameras that alignment uses.
pub(crate) struct Evidence {
    /// Points seen often and well enough.
    pub(crate) points: Vec<DVec3>,
    /// Centres of the cameras.
    pub(crate) centres: Vec<DVec3>,
    /// Axes of the cameras in the world: columns right, down, forward.
    pub(crate) axes: Vec<DMat3>,
    /// Scene size: twice the distance from the median of the points within which nine tenths of
    /// them lie.
    pub(crate) size: f64,
}

/// Fewest points for a search of the floor.
const MIN_POINTS: usize = 30;

impl Evidence {
    fn new(model: &Model, options: &AlignOptions) -> Self {
        let counts = |point: &&crate::model::ModelPoint| {
            point.track_length >= options.min_track && point.error_px <= options.max_error_px
        };
        let points: Vec<DVec3> = model
            .points
            .iter()
            .filter(counts)
            .map(|p| p.position)
            .collect();
        let poses = model.images.iter().map(|image| &image.camera_from_world);
        Self {
            size: numeric::size(&points),
            points,
            centres: poses.clone().map(crate::Rigid::centre).collect(),
            axes: poses
                .map(|pose| DMat3::from_quat(pose.rotation.inverse()))
                .collect(),
        }
    }
}

/// Starting point of a search for the floor.
pub(crate) struct Seen {
    /// Points that count.
    pub(crate) num_points: usize,
    /// The cameras' vertical.
    pub(crate) gravity: Option<GravityReport>,
    /// Points above all cameras, between them, and below them.
    pub(crate) points_by_height: Option<[usize; 3]>,
}

/// Looks at cameras and points without asking for a floor.
pub(crate) fn look(model: &Model, options: &AlignOptions) -> Seen {
    let evidence = Evidence::new(model, options);
    let gravity = match options.manual.up() {
        Some(up) => Some(Gravity::said(up)),
        None => gravity::find(&evidence).ok(),
    };
    let by_height = gravity.as_ref().map(|gravity| {
        let heights = evidence.centres.iter().map(|c| c.dot(gravity.up));
        let low = heights.clone().fold(f64::INFINITY, f64::min);
        let high = heights.fold(f64::NEG_INFINITY, f64::max);
        let mut counts = [0; 3];
        for point in &evidence.points {
            let height = point.dot(gravity.up);
            let at = if height > high {
                0
            } else if height >= low {
                1
            } else {
                2
            };
            counts[at] += 1;
        }
        counts
    });
    Seen {
        num_points: evidence.points.len(),
        gravity: gravity.map(|gravity| gravity.report),
        points_by_height: by_height,
    }
}

/// Finds the transform to a world with z up and the floor on z = 0.
///
/// # Errors
/// [`ColmapError::Align`] with the reason where no floor is found with sufficient confidence, and
/// the options that help; [`ColmapError::Option`].
pub fn align(model: &Model, options: &AlignOptions) -> Result<Alignment> {
    options.validate()?;
    let evidence = Evidence::new(model, options);
    let mut warnings = Vec::new();
    let (found, confidence) = match options.mode {
        Mode::None => (None, None),
        Mode::Reference => return reference::align(model, &evidence, &options.known_cameras),
        Mode::Manual => {
            let (plane, gravity) = manual::plane(model, &evidence, &options.manual)?;
            (Some((plane, gravity, None)), Some(1.0))
        }
        Mode::Floor => {
            let found = automatic(&evidence, options, &mut warnings)?;
            let confidence = found.2.as_ref().map(|report| report.confidence);
            (Some(found), confidence)
        }
    };
    let Some((plane, gravity, floor)) = found else {
        return scale::without_floor(model, options);
    };
    let walls = if options.walls {
        walls::find(&evidence, plane)
    } else {
        None
    };
    if options.walls && walls.is_none() {
        warnings.push("no walls were found: the yaw is that of the model".to_owned());
    }
    let rotation = rotation(&evidence, plane, walls.as_ref());
    let upright = Similarity {
        scale: 1.0,
        rotation,
        translation: DVec3::ZERO,
    };
    let centres: Vec<DVec3> = evidence.centres.iter().map(|c| upright.apply(*c)).collect();
    let median = |axis: usize| numeric::median(centres.iter().map(|c| c[axis]).collect());
    let floor_height = plane.normal.dot(plane.point);
    let origin = DVec3::new(median(0), median(1), floor_height);
    let height = median(2) - floor_height;
    let metric = options
        .scale
        .as_ref()
        .map(|scale| scale.factor(model, Some(height)))
        .transpose()?;
    let factor = metric.unwrap_or(1.0);
    Ok(Alignment {
        mode: options.mode,
        aligned_from_model: Similarity {
            scale: factor,
            rotation,
            translation: -factor * origin,
        },
        gravity: gravity.map(|gravity| gravity.report),
        floor,
        walls,
        reference: None,
        confidence,
        is_metric: metric.is_some(),
        camera_height: Some(factor * height),
        warnings,
    })
}

/// A plane, its normal turned up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plane {
    /// A point of it.
    pub point: DVec3,
    /// Unit length.
    pub normal: DVec3,
}

impl Plane {
    /// Distance above the plane.
    pub(crate) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.point)
    }

    /// The other side of the mirror.
    pub(crate) fn mirrored(&self, point: DVec3) -> DVec3 {
        point - 2.0 * self.height(point) * self.normal
    }
}

type Found = (Plane, Option<Gravity>, Option<FloorReport>);

fn automatic(
    evidence: &Evidence,
    options: &AlignOptions,
    warnings: &mut Vec<String>,
) -> Result<Found> {
    if evidence.points.len() < MIN_POINTS || evidence.size <= 0.0 {
        return Err(ColmapError::Align(format!(
            "{} points with at least {} observations and at most {} pixels of error are too few to find a floor among; \
             say where it is, or take the world as it is",
            evidence.points.len(),
            options.min_track,
            options.max_error_px
        )));
    }
    let gravity = match options.manual.up() {
        Some(up) => Gravity::said(up),
        None => gravity::find(evidence)?,
    };
    warnings.extend(gravity.warning.clone());
    let (plane, report) = floor::find(evidence, &gravity, options)?;
    if report.confidence < options.min_confidence {
        return Err(ColmapError::Align(format!(
            "the lowest plane is no floor to be sure of: confidence {:.2} is below {}; {} inliers, {:.0} % of the room covered, \
             {} points below it, {:.1}° from the cameras' vertical; name the floor, or say what is up",
            report.confidence,
            options.min_confidence,
            report.num_inliers,
            100.0 * report.coverage,
            report.num_below,
            report.tilt_from_gravity_deg
        )));
    }
    let said = options.manual.up().is_some();
    Ok((plane, (!said).then_some(gravity), Some(report)))
}

/// The rotation that turns the plane's normal to z and a wall to x.
fn rotation(evidence: &Evidence, plane: Plane, walls: Option<&WallReport>) -> DQuat {
    let to_z = DQuat::from_rotation_arc(plane.normal, DVec3::Z);
    let Some(walls) = walls else { return to_z };
    let [x, y, z] = walls.direction;
    let mut along = DVec3::new(x, y, z);
    let across = plane.normal.cross(along);
    let extent =
        |axis: DVec3| numeric::spread(evidence.points.iter().map(|p| p.dot(axis)).collect());
    if extent(across) > extent(along) {
        along = across;
    }
    // Of the two remaining rotations, the one in which cameras look towards positive y on average.
    let forward: DVec3 = evidence.axes.iter().map(|axes| axes.z_axis).sum();
    if plane.normal.cross(along).dot(forward) < 0.0 {
        along = -along;
    }
    let rows = DMat3::from_cols(along, plane.normal.cross(along), plane.normal);
    DQuat::from_mat3(&rows.transpose()).normalize()
}
