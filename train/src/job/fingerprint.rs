//! Fingerprint of all that the results of a run depend on.

use super::lights::Light;
use crate::error::Result;
use crate::options::TrainOptions;
use eagpt_scene::files::{self, Key, digest};
use eagpt_scene::{Dataset, SceneError};
use std::path::Path;

/// Everything that decides the result: the datasets, and the options of the stages.
pub(super) fn of(lights: &[Light], options: &TrainOptions) -> Result<Key> {
    let radiance = (
        options.seed,
        options.split,
        options.num_gaussians,
        &options.init,
        &options.radiance,
    );
    let mut key = Key::new().with("dataset", digest_of(&lights[0].dataset)?);
    for light in &lights[1..] {
        key = key.with(&light_part(&light.name), digest_of(&light.dataset)?);
    }
    let key = (key.with_value("radiance", &radiance)?).with_value("albedo", &options.albedo)?;
    Ok(key)
}

/// Part of the fingerprint that is the dataset of another light than the first.
pub fn light_part(name: &str) -> String {
    format!("light {name}")
}

/// Digest of the camera file, and of names and sizes of all images.
fn digest_of(dataset: &Dataset) -> Result<String> {
    let mut inputs = files::read(dataset.transforms())?;
    let images = dataset.frames().iter().flat_map(|frame| {
        let f = &frame.files;
        [
            Some(&f.radiance),
            f.emission.as_ref(),
            f.normal.as_ref(),
            f.alpha.as_ref(),
            f.clipped.as_ref(),
            f.valid.as_ref(),
        ]
        .into_iter()
        .flatten()
    });
    let absolute = |path: &Path| {
        path.canonicalize()
            .map_err(|e| SceneError::io(path, "read", e))
    };
    let root = absolute(dataset.root())?;
    for path in images {
        let size = std::fs::metadata(path)
            .map_err(|e| SceneError::io(path, "read", e))?
            .len();
        // However it is written; a dataset may be moved with its images.
        let whole = absolute(path)?;
        let name = whole.strip_prefix(&root).unwrap_or(&whole);
        inputs.extend_from_slice(format!("{}\0{size}\0", name.display()).as_bytes());
    }
    Ok(digest::of_bytes(&inputs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::dataset::EMISSION_DIR;
    use eagpt_testkit::room;
    use std::path::PathBuf;

    /// One folder of masks, written in two ways, is one dataset; another folder is another.
    #[test]
    fn masks_elsewhere_have_one_name() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("room");
        let options = room::RoomOptions {
            num_views: 2,
            width: 8,
            height: 8,
            num_samples: 1,
            num_points: 10,
            seed: 0,
        };
        room::write(&root, &options, |_| ()).unwrap();
        let masks = dir.path().join("masks");
        std::fs::create_dir(&masks).unwrap();
        std::fs::rename(root.join(EMISSION_DIR), masks.join(EMISSION_DIR)).unwrap();
        let digest_with = |masks: PathBuf| {
            let dataset = Dataset::open(&root).unwrap();
            digest_of(&dataset.with_masks(&masks).unwrap()).unwrap()
        };
        let digest = digest_with(masks.clone());
        assert_eq!(digest_with(root.join("../masks")), digest);
        let others = dir.path().join("others");
        std::fs::rename(&masks, &others).unwrap();
        assert_ne!(digest_with(others), digest);
    }
}
