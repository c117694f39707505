//! Options of normal maps.

use super::Axes;
use eagpt_scene::Dataset;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The space of a map's vectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Space {
    /// That of the view's camera
    Camera,
    /// That of the dataset
    World,
}

/// Encoding of a map's components.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Encoding {
    /// -1 to 1
    Unit,
    /// 0 to 1: 0.5 n + 0.5
    ZeroToOne,
}

/// Interpretation of maps; absent fields are detected.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct NormalOptions {
    /// Space of the vectors.
    pub space: Option<Space>,
    /// Their axes.
    pub axes: Option<Axes>,
    /// Their encoding.
    pub encoding: Option<Encoding>,
    /// Suffix of a map's file name, between the view's name and the extension.
    pub suffix: String,
}

/// Request of [`crate::normals::make_normals`].
#[derive(Debug, Clone)]
pub struct NormalRequest<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// Folder of maps.
    pub maps: PathBuf,
    /// Where `Normal-exr/` and `normals/` go: the dataset's folder or another.
    pub out: PathBuf,
    /// Interpretation of the maps.
    pub options: NormalOptions,
}
