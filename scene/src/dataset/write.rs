//! Writing datasets, as EAG-PT has them.

use super::frame::{
    ALBEDO_DIR, ALPHA_DIR, CLIPPED_DIR, DEPTH_DIR, EMISSION_DIR, NORMAL_DIR, POINTS_FILE,
    RADIANCE_DIR, ROUGHNESS_DIR, SPECULAR_DIR, TRANSFORMS_FILE, VALID_DIR,
};
use super::info::{ALIGNED_KEY, DatasetInfo};
use super::names::is_frame_name;
use super::pose;
use super::view::View;
use crate::camera::Camera;
use crate::error::{Result, SceneError};
use crate::exr::{self, Precision};
use crate::files;
use crate::image::Image;
use crate::ply::{self, PointCloud};
use serde_json::{Map, Value, json};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Writes a dataset view by view. `transforms.json` comes last, so that a folder without one is an
/// unfinished dataset.
///
/// Files that are there are replaced; whether they may be is for the caller to ask.
#[derive(Debug)]
pub struct DatasetWriter {
    root: PathBuf,
    precision: Precision,
    cameras: Vec<(String, Camera)>,
}

impl DatasetWriter {
    /// Starts a dataset in `root`, which is created.
    ///
    /// # Errors
    /// [`SceneError::Io`] with the folder's name.
    pub fn create(root: &Path, precision: Precision) -> Result<Self> {
        files::create_dir(root)?;
        Ok(Self {
            root: root.to_owned(),
            precision,
            cameras: Vec::new(),
        })
    }

    /// Writes the images of `view`, those it has.
    ///
    /// # Errors
    /// As [`exr::write_rgb`], or [`SceneError::Invalid`] for a name that would leave the folder.
    pub fn write_view(&mut self, view: &View) -> Result<()> {
        self.write_images(view)?;
        self.list(&view.name, view.camera);
        Ok(())
    }

    /// Writes the images of `view` without listing its camera: several threads may do so at once.
    /// [`Self::list`] has to follow.
    ///
    /// # Errors
    /// As [`Self::write_view`].
    pub fn write_images(&self, view: &View) -> Result<()> {
        let transforms = self.root.join(TRANSFORMS_FILE);
        check_name(&transforms, self.cameras.len(), &view.name)?;
        self.write_rgb(RADIANCE_DIR, &view.name, Some(&view.radiance))?;
        self.write_rgb(NORMAL_DIR, &view.name, view.normal.as_ref())?;
        self.write_rgb(ALBEDO_DIR, &view.name, view.albedo.as_ref())?;
        self.write_rgb(SPECULAR_DIR, &view.name, view.specular.as_ref())?;
        self.write_single(ROUGHNESS_DIR, &view.name, view.roughness.as_ref())?;
        self.write_single(EMISSION_DIR, &view.name, view.emission.as_ref())?;
        self.write_single(ALPHA_DIR, &view.name, view.alpha.as_ref())?;
        self.write_single(DEPTH_DIR, &view.name, view.depth.as_ref())?;
        self.write_rgb(CLIPPED_DIR, &view.name, view.clipped.as_ref())?;
        // An earlier mask would hide pixels of the new images.
        for (folder, is_there) in [
            (CLIPPED_DIR, view.clipped.is_some()),
            (VALID_DIR, view.valid.is_some()),
        ] {
            if !is_there {
                let earlier = format!("{}.exr", view.name);
                files::remove_if_there(&self.root.join(folder).join(earlier))?;
            }
        }
        self.write_single(VALID_DIR, &view.name, view.valid.as_ref())
    }

    /// Lists a camera: of images that [`Self::write_images`] writes, or of none.
    pub fn list(&mut self, name: &str, camera: Camera) {
        self.cameras.push((name.to_owned(), camera));
    }

    /// Writes the point cloud that training starts from.
    ///
    /// # Errors
    /// As [`ply::write_points`].
    pub fn write_points(&self, points: &PointCloud) -> Result<()> {
        ply::write_points(&self.root.join(POINTS_FILE), points)
    }

    /// Writes `transforms.json`.
    ///
    /// # Errors
    /// As [`write_transforms`].
    pub fn finish(self, info: &DatasetInfo) -> Result<()> {
        write_transforms(&self.root.join(TRANSFORMS_FILE), &self.cameras, info)
    }

    fn path(&self, folder: &str, name: &str) -> Result<PathBuf> {
        let path = self.root.join(folder).join(format!("{name}.exr"));
        files::create_parent(&path)?;
        Ok(path)
    }

    fn write_rgb(&self, folder: &str, name: &str, image: Option<&Image<3>>) -> Result<()> {
        let Some(image) = image else { return Ok(()) };
        exr::write_rgb(&self.path(folder, name)?, image, self.precision)
    }

    fn write_single(&self, folder: &str, name: &str, image: Option<&Image<1>>) -> Result<()> {
        let Some(image) = image else { return Ok(()) };
        exr::write_single(&self.path(folder, name)?, image, self.precision)
    }
}

/// Writes named cameras as the `transforms.json` of EAG-PT; atomic, exact in double precision.
///
/// Intrinsics that all cameras share stand at the top level, others in each frame.
///
/// # Errors
/// [`SceneError::Io`], or [`SceneError::Invalid`] for a name that is no relative path or comes
/// twice, or a camera with a value that is not finite, which JSON cannot hold.
pub fn write_transforms(
    path: &Path,
    cameras: &[(String, Camera)],
    info: &DatasetInfo,
) -> Result<()> {
    let mut top = Map::new();
    let shared = cameras.first().map(|(_, camera)| intrinsics(camera));
    let shared = shared.filter(|first| cameras.iter().all(|(_, c)| intrinsics(c) == *first));
    top.extend(shared.clone().into_iter().flatten());
    if let Some(axis) = info.up_axis {
        top.insert("up_axis".to_owned(), json!(axis.name()));
    }
    if let Some(metres) = info.metres_per_unit {
        top.insert("metres_per_unit".to_owned(), json!(metres));
    }
    if let Some(rows) = &info.aligned_from_model {
        if rows.as_flattened().iter().any(|value| !value.is_finite()) {
            let problem = format!("{rows:?} is not finite");
            return Err(SceneError::invalid(path, ALIGNED_KEY, problem));
        }
        top.insert(ALIGNED_KEY.to_owned(), json!(rows));
    }
    for (key, names) in [
        ("train_filenames", &info.train_names),
        ("val_filenames", &info.validation_names),
        ("test_filenames", &info.test_names),
    ] {
        if let Some(names) = names {
            top.insert(key.to_owned(), json!(names));
        }
    }
    let mut frames = Vec::with_capacity(cameras.len());
    let mut seen = HashSet::new();
    for (index, (name, camera)) in cameras.iter().enumerate() {
        check_name(path, index, name)?;
        if !seen.insert(name.as_str()) {
            let field = format!("frames[{index}].file_name");
            return Err(SceneError::invalid(path, field, format!("`{name}` twice")));
        }
        let numbers = [camera.fx, camera.fy, camera.cx, camera.cy];
        if !camera.world_from_camera.is_finite() || numbers.iter().any(|n| !n.is_finite()) {
            return Err(SceneError::invalid(
                path,
                format!("frames[{index}]"),
                format!("the camera of {name} is not finite: {camera:?}"),
            ));
        }
        let mut frame = Map::new();
        frame.insert("file_name".to_owned(), json!(name));
        if shared.is_none() {
            frame.extend(intrinsics(camera));
        }
        let matrix = pose::to_json(&camera.world_from_camera);
        frame.insert("transform_matrix".to_owned(), matrix);
        frames.push(Value::Object(frame));
    }
    top.insert("frames".to_owned(), Value::Array(frames));
    files::write_json(path, &top)
}

fn check_name(path: &Path, index: usize, name: &str) -> Result<()> {
    if is_frame_name(name) {
        return Ok(());
    }
    Err(SceneError::invalid(
        path,
        format!("frames[{index}].file_name"),
        format!("`{}` is not a relative name", name.escape_debug()),
    ))
}

fn intrinsics(camera: &Camera) -> Map<String, Value> {
    let entries = [
        ("fx", json!(camera.fx)),
        ("fy", json!(camera.fy)),
        ("cx", json!(camera.cx)),
        ("cy", json!(camera.cy)),
        ("w", json!(camera.width)),
        ("h", json!(camera.height)),
    ];
    entries
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect()
}
