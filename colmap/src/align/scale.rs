//! Metric scale from a known length.

use super::{AlignOptions, Alignment, Mode};
use crate::error::{ColmapError, Result};
use crate::model::{Model, PointId, Similarity};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Source of a metric scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Scale {
    /// A distance between two places.
    Distance {
        /// One.
        from: Anchor,
        /// The other.
        to: Anchor,
        /// Above 0.
        metres: f64,
    },
    /// The median height of the cameras above the floor.
    CameraHeight {
        /// Above 0.
        metres: f64,
    },
}

/// A place of a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Anchor {
    /// The camera of an image.
    Image(String),
    /// A point.
    Point(PointId),
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Distance { from, to, metres } => write!(f, "{from},{to},{metres}"),
            Self::CameraHeight { metres } => write!(f, "{metres}"),
        }
    }
}

impl fmt::Display for Anchor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(name) => f.write_str(name),
            Self::Point(id) => write!(f, "point:{}", id.0),
        }
    }
}

impl std::str::FromStr for Anchor {
    type Err = String;

    /// `point:17`, or the name of an image.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("point:") {
            None if text.is_empty() => Err("no name of an image".to_owned()),
            None => Ok(Self::Image(text.to_owned())),
            Some(number) => number
                .parse()
                .map(|id| Self::Point(PointId(id)))
                .map_err(|_| format!("`{number}` is not the number of a point")),
        }
    }
}

impl Anchor {
    fn position(&self, model: &Model) -> Result<DVec3> {
        let position = match self {
            Self::Image(name) => {
                let image = model.images.iter().find(|image| image.name == *name);
                image.map(|image| image.camera_from_world.centre())
            }
            Self::Point(id) => {
                let point = model.points.iter().find(|point| point.id == *id);
                point.map(|point| point.position)
            }
        };
        position.ok_or_else(|| {
            let problem = match self {
                Self::Image(name) => format!("the model has no image `{}`", name.escape_debug()),
                Self::Point(id) => format!("the model has no point {id}"),
            };
            ColmapError::option("known_distance", problem)
        })
    }
}

impl Scale {
    pub(super) fn validate(&self) -> Result<()> {
        let (option, metres) = match self {
            Self::Distance { metres, .. } => ("known_distance", *metres),
            Self::CameraHeight { metres } => ("camera_height", *metres),
        };
        if metres > 0.0 && metres.is_finite() {
            return Ok(());
        }
        Err(ColmapError::option(
            option,
            format!("{metres:?} m is not above 0"),
        ))
    }

    /// Metres of a unit of the model, whose cameras are `height` units above the floor.
    pub(super) fn factor(&self, model: &Model, height: Option<f64>) -> Result<f64> {
        let (option, metres, units) = match self {
            Self::Distance { from, to, metres } => {
                let units = (from.position(model)? - to.position(model)?).length();
                ("known_distance", *metres, units)
            }
            Self::CameraHeight { metres } => {
                let problem = "the height of the cameras needs a floor";
                let height = height.ok_or_else(|| ColmapError::option("camera_height", problem))?;
                ("camera_height", *metres, height)
            }
        };
        let factor = metres / units;
        if units > 0.0 && factor.is_finite() {
            return Ok(factor);
        }
        Err(ColmapError::option(
            option,
            format!("is {units:?} units in the model"),
        ))
    }
}

/// The unchanged world, except for the scale.
pub(super) fn without_floor(model: &Model, options: &AlignOptions) -> Result<Alignment> {
    let metric = options
        .scale
        .as_ref()
        .map(|scale| scale.factor(model, None))
        .transpose()?;
    Ok(Alignment {
        mode: Mode::None,
        aligned_from_model: Similarity {
            scale: metric.unwrap_or(1.0),
            ..Similarity::IDENTITY
        },
        gravity: None,
        floor: None,
        walls: None,
        reference: None,
        confidence: None,
        is_metric: metric.is_some(),
        camera_height: None,
        warnings: Vec::new(),
    })
}
