//! The lights of a run: datasets of one place, and where the results of each go.

use super::request::TrainRequest;
use crate::error::{Result, TrainError};
use eagpt_scene::dataset::{Split, Subset};
use eagpt_scene::{Dataset, Gaussians};
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::path::Path;
use std::sync::Arc;

/// A light that the place was photographed in.
pub(super) struct Light {
    /// Name of the folder of its dataset.
    pub(super) name: String,
    pub(super) dataset: Arc<Dataset>,
    pub(super) split: Split,
}

impl Light {
    /// Its dataset with the frames to train on.
    pub(super) fn views(&self) -> (Arc<Dataset>, Vec<usize>) {
        (Arc::clone(&self.dataset), self.split.indices(Subset::Train))
    }
}

/// Opens the datasets of all lights with the masks and normals of the request, which of several
/// lights are in a folder of each one's name.
///
/// # Errors
/// If one cannot be read or two have the same name.
pub(super) fn open(request: &TrainRequest) -> Result<Vec<Light>> {
    let mut lights = vec![light(&request.dataset, request)?];
    for path in &request.other_lights {
        let other = light(path, request)?;
        if lights.iter().any(|known| known.name == other.name) {
            return Err(TrainError::Dataset {
                path: path.clone(),
                problem: format!(
                    "another light is called {:?}, too: lights have the names of their folders",
                    other.name
                ),
            });
        }
        lights.push(other);
    }
    Ok(lights)
}

/// Name of the light of a dataset: that of its folder, which may be named by its camera file.
pub fn light_name(dataset: &Path) -> String {
    let path = std::path::absolute(dataset).unwrap_or_else(|_| dataset.to_owned());
    let folder = match path.is_file() {
        true => path.parent(),
        false => Some(path.as_path()),
    };
    let name = folder.and_then(Path::file_name);
    name.map_or_else(
        || "light".to_owned(),
        |name| name.to_string_lossy().into_owned(),
    )
}

fn light(path: &Path, request: &TrainRequest) -> Result<Light> {
    let mut dataset = Dataset::open(path)?;
    let name = light_name(dataset.root());
    let of_light = |folder: &Path| match request.other_lights.is_empty() {
        true => folder.to_owned(),
        false => folder.join(&name),
    };
    if let Some(masks) = &request.masks {
        dataset = dataset.with_masks(&of_light(masks))?;
    }
    if let Some(normals) = &request.normals {
        dataset = dataset.with_normals(&of_light(normals))?;
    }
    Ok(Light {
        name,
        split: dataset.split(request.options.split)?,
        dataset: Arc::new(dataset),
    })
}

/// The Gaussians of the first of `scenes` with the light of each other one, that of the Gaussian
/// nearest to each.
pub(super) fn light_of_nearest(scenes: &[Gaussians]) -> Vec<Gaussians> {
    let Some((first, others)) = scenes.split_first() else {
        return Vec::new();
    };
    let lit = |other: &Gaussians| {
        let places: Vec<[f32; 3]> = other.positions.iter().map(Vec3::to_array).collect();
        let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&places);
        let mut lit = first.clone();
        for i in 0..lit.len() {
            let place = lit.positions[i].to_array();
            let nearest = tree.nearest_one::<SquaredEuclidean>(&place).item as usize;
            lit.radiances[i] = other.radiances[nearest];
            lit.emissions[i] = other.emissions[nearest];
        }
        lit
    };
    others.iter().map(lit).collect()
}
