//! Datasets: posed linear images of a room, on disk.
//!
//! [`Dataset::open`] reads the folder of EAG-PT (`frames[].file_name`, images in `Radiance-exr/`
//! and beside it) and the `transforms.json` of nerfstudio (`frames[].file_path`, linear EXR images
//! without distortion). Only names, sizes and poses are held; [`Dataset::load_view`] loads one
//! view, [`ViewCache`] the recent ones. Masks, normals, depth and albedo are optional for every
//! view: absent is not zero.
//!
//! The images of a view share the name of its frame:
//!
//! | folder | content |
//! |---|---|
//! | `Radiance-exr` | linear Rec.709 radiance, premultiplied by opacity |
//! | `Emissive-exr` | emission mask, 0 or 1 |
//! | `Normal-exr` | world-space normals |
//! | `Alpha-exr` | opacity, 0 to 1 |
//! | `Depth-exr` | depth along the optical axis, scene units |
//! | `DiffCol` | diffuse albedo |
//! | `GlossCol` | specular reflectance at normal incidence, F0 |
//! | `Roughness` | perceptual roughness, 0 to 1; 0 where F0 is |
//! | `Clipped-exr` | 1 in channels of which the radiance is a lower bound, else 0 |
//! | `Valid-exr` | 1 where the images are known, less where they are not; absent, all is known |
//!
//! Beyond the keys of either format, `up_axis` ("z", "-y", …), `metres_per_unit` and
//! `aligned_from_model` (rows of a 4×4 similarity) are read and written.

mod cache;
mod frame;
mod info;
pub mod intrinsics;
pub mod json;
mod names;
mod open;
pub mod pose;
mod split;
mod up;
mod view;
mod write;

#[cfg(test)]
mod tests;

pub use cache::ViewCache;
pub use frame::{
    ALBEDO_DIR, ALPHA_DIR, BadFrame, CLIPPED_DIR, DEPTH_DIR, EMISSION_DIR, Frame, NORMAL_DIR,
    POINTS_FILE, RADIANCE_DIR, ROUGHNESS_DIR, SPECULAR_DIR, TRANSFORMS_FILE, VALID_DIR, ViewFiles,
};
pub use info::DatasetInfo;
pub use names::{is_frame_name, strip_image_folder};
pub use split::{Split, SplitRule, Subset};
pub use up::UpAxis;
pub use view::{MIN_FACING, MIN_NORMAL_LENGTH, View, check_mask, is_known, refuse, share_facing};
pub use write::{DatasetWriter, write_transforms};

use crate::error::{Result, SceneError};
use crate::ply::{self, PointCloud};
use split::ListedSplit;
use std::path::{Path, PathBuf};

/// A dataset whose cameras are known and whose images are known to be there.
#[derive(Debug, Clone)]
pub struct Dataset {
    root: PathBuf,
    transforms: PathBuf,
    frames: Vec<Frame>,
    up_axis: Option<UpAxis>,
    metres_per_unit: Option<f64>,
    aligned_from_model: Option<[[f64; 4]; 4]>,
    listed: ListedSplit,
    points: Option<PathBuf>,
}

impl Dataset {
    /// The same dataset with the emission masks in `folder/Emissive-exr` in place of its own; a
    /// view without one there has none.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] naming the folder if it has no mask for any view.
    pub fn with_masks(self, folder: &Path) -> Result<Self> {
        self.with_maps(&folder.join(EMISSION_DIR), |files| &mut files.emission)
    }

    /// The same dataset with the normals in `folder/Normal-exr` in place of its own; a view without
    /// any there has none.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] naming the folder if it has no normals for any view.
    pub fn with_normals(self, folder: &Path) -> Result<Self> {
        self.with_maps(&folder.join(NORMAL_DIR), |files| &mut files.normal)
    }

    fn with_maps(
        mut self,
        folder: &Path,
        map_of: impl Fn(&mut ViewFiles) -> &mut Option<PathBuf>,
    ) -> Result<Self> {
        let mut is_any = false;
        for frame in &mut self.frames {
            let path = folder.join(format!("{}.exr", frame.name));
            let map = path.is_file().then_some(path);
            is_any |= map.is_some();
            *map_of(&mut frame.files) = map;
        }
        if is_any {
            return Ok(self);
        }
        Err(SceneError::invalid(
            folder,
            "maps",
            format!("none is called like a view, as {}.exr", self.frames[0].name),
        ))
    }

    /// The folder of the dataset.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The file the cameras were read from.
    pub fn transforms(&self) -> &Path {
        &self.transforms
    }

    /// All frames in the order of the file; never empty.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there are no frames; an opened dataset has some.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Message about a view that does not exist.
    pub fn no_such_view(&self, name: &str) -> String {
        format!(
            "there is no view `{}`; the {} views are called like `{}`",
            name.escape_debug(),
            self.frames.len(),
            self.frames[0].name
        )
    }

    /// The world's up axis as stored in the file, if it is.
    pub fn up_axis(&self) -> Option<UpAxis> {
        self.up_axis
    }

    /// The world's up axis: as stored, else z.
    pub fn up(&self) -> UpAxis {
        self.up_axis.unwrap_or_default()
    }

    /// Length of a scene unit in metres, if the file tells.
    pub fn metres_per_unit(&self) -> Option<f64> {
        self.metres_per_unit
    }

    /// Rows of the 4×4 similarity from the world of a structure-from-motion model to this one, if
    /// the file tells.
    pub fn aligned_from_model(&self) -> Option<&[[f64; 4]; 4]> {
        self.aligned_from_model.as_ref()
    }

    /// Properties of the dataset that a writer keeps beside the frames.
    pub fn info(&self) -> DatasetInfo {
        let names = |indices: &Option<Vec<usize>>| {
            let indices = indices.as_ref()?;
            Some(
                indices
                    .iter()
                    .map(|&i| self.frames[i].name.clone())
                    .collect(),
            )
        };
        DatasetInfo {
            up_axis: self.up_axis,
            metres_per_unit: self.metres_per_unit,
            train_names: names(&self.listed.train),
            validation_names: names(&self.listed.validation),
            test_names: names(&self.listed.test),
            aligned_from_model: self.aligned_from_model,
        }
    }

    /// Loads and checks the images of a frame.
    ///
    /// # Errors
    /// [`SceneError`] naming the image file: unreadable, of another size than the radiance, or with
    /// values that cannot be (with the pixel).
    ///
    /// # Panics
    /// If `index` is not below [`Self::len`].
    pub fn load_view(&self, index: usize) -> Result<View> {
        view::load(&self.frames[index])
    }

    /// The file of the point cloud, if there is one.
    pub fn points_file(&self) -> Option<&Path> {
        self.points.as_deref()
    }

    /// All files of the dataset that are there: the cameras, the points and the images of all
    /// views.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut all = vec![self.transforms.clone()];
        all.extend(self.points.clone());
        for frame in &self.frames {
            all.extend(frame.files.all().map(|(_, file)| file.clone()));
        }
        all
    }

    /// The point cloud of the dataset, if it has one.
    ///
    /// # Errors
    /// As [`ply::read_points`].
    pub fn points(&self) -> Result<Option<PointCloud>> {
        self.points.as_deref().map(ply::read_points).transpose()
    }

    /// Divides the frames into training and test views.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] naming the file, the rule and the numbers if either subset is empty
    /// or the file lacks the lists that the rule needs.
    pub fn split(&self, rule: SplitRule) -> Result<Split> {
        let names: Vec<&str> = self.frames.iter().map(|f| f.name.as_str()).collect();
        split::split((&self.root, &self.transforms), &names, &self.listed, rule)
    }
}
