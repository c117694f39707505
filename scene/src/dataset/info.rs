//! Statements of a dataset on its world and on its frames as a whole.

use super::json::Object;
use super::up::UpAxis;
use crate::error::Result;

/// Key of the similarity from a model of structure from motion.
pub(super) const ALIGNED_KEY: &str = "aligned_from_model";

/// Properties of a dataset beside its cameras and images.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DatasetInfo {
    /// The world's up axis, if known.
    pub up_axis: Option<UpAxis>,
    /// Length of a scene unit in metres, if known.
    pub metres_per_unit: Option<f64>,
    /// Names of the frames to train on, if the dataset prescribes them.
    pub train_names: Option<Vec<String>>,
    /// Names of the frames to validate on, if the dataset prescribes them; they are tested on where
    /// no others are.
    pub validation_names: Option<Vec<String>>,
    /// Names of the frames to test on, if the dataset prescribes them.
    pub test_names: Option<Vec<String>>,
    /// Rows of the 4×4 similarity from the world of a structure-from-motion model to that of the
    /// dataset, if it came from one.
    pub aligned_from_model: Option<[[f64; 4]; 4]>,
}

impl DatasetInfo {
    /// The lists of names: training, validation, test.
    pub fn lists_mut(&mut self) -> [&mut Option<Vec<String>>; 3] {
        [
            &mut self.train_names,
            &mut self.validation_names,
            &mut self.test_names,
        ]
    }

    /// Keys of our own at the top of a `transforms.json`, without its lists.
    ///
    /// # Errors
    /// [`crate::SceneError::Invalid`] naming the key and its value.
    pub fn of_world(top: &Object<'_>) -> Result<Self> {
        let key = "up_axis";
        let up_axis = top.string(key)?.map(str::parse).transpose();
        Ok(Self {
            up_axis: up_axis.map_err(|problem| top.invalid(key, problem))?,
            metres_per_unit: top.positive("metres_per_unit")?,
            aligned_from_model: top.matrix(ALIGNED_KEY)?,
            ..Self::default()
        })
    }
}
