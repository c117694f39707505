//! Synthetic scenes of FIPT: rendered with Blender, with ground truth for every pixel.
//!
//! `train/` and `val/` each have a `transforms.json` (`camera_angle_x`, Blender's axes) and, for
//! frame i of it, `Image/`, `DiffCol/` and `Emit/` as `{i:03}_0001.exr`. `DiffCol/` is the diffuse
//! albedo, `albedo/{i:03}.exr` in its place where that is missing; pixels above 0 in `Emit/` are
//! emitters. Frames are called `train_000` and `val_000`, and the dataset's own split is that.
//!
//! `Roughness/`, `IndexMA/` and `segmentation/` are not read.

use super::{
    Emission, SourceDataset, SourceFiles, SourceFormat, SourceFrame, if_there, lens, points_beside,
    size_of,
};
use crate::error::Result;
use crate::options::ImportOptions;
use eagpt_scene::dataset::json::Object;
use eagpt_scene::dataset::{TRANSFORMS_FILE, UpAxis, pose};
use eagpt_scene::files;
use std::path::Path;

/// Folders of the splits.
const SPLITS: [&str; 2] = ["train", "val"];

pub(super) fn read(root: &Path, _options: &ImportOptions) -> Result<SourceDataset> {
    let first = root.join(SPLITS[0]).join(TRANSFORMS_FILE);
    let mut source = SourceDataset::new(SourceFormat::FiptSynthetic, root, first);
    source.info.up_axis = Some(UpAxis::Z);
    source.points = points_beside(root);
    let mut names = [Vec::new(), Vec::new()];
    for (split, names) in SPLITS.into_iter().zip(&mut names) {
        let folder = root.join(split);
        let path = folder.join(TRANSFORMS_FILE);
        if split != SPLITS[0] && !path.is_file() {
            source.warnings.push(format!(
                "{}: is not there: no {split} views",
                path.display()
            ));
            continue;
        }
        if split != SPLITS[0] {
            source.more_cameras.push(path.clone());
        }
        let value = files::read_json(&path)?;
        let top = Object::root(&path, &value)?;
        for (index, object) in top.objects("frames")?.iter().enumerate() {
            let name = format!("{split}_{index:03}");
            let frame = frame(&folder, &top, object, (index, &name));
            source.add(&name, frame);
            names.push(name);
        }
    }
    let [train, test] = names;
    source.info.train_names = Some(train);
    source.info.test_names = (!test.is_empty()).then_some(test);
    Ok(source)
}

fn frame(
    folder: &Path,
    top: &Object<'_>,
    object: &Object<'_>,
    (index, name): (usize, &str),
) -> Result<SourceFrame> {
    let numbered = |kind: &str| folder.join(kind).join(format!("{index:03}_0001.exr"));
    let radiance = numbered("Image");
    let size = size_of(&radiance)?;
    let albedo = if_there(numbered("DiffCol"))
        .or_else(|| if_there(folder.join("albedo").join(format!("{index:03}.exr"))));
    Ok(SourceFrame {
        name: name.to_owned(),
        lens: lens::from_json(top, object, size)?,
        world_from_camera: pose::read(object)?,
        files: SourceFiles {
            radiance,
            albedo,
            emission: if_there(numbered("Emit")).map(Emission::Radiance),
            ..SourceFiles::default()
        },
    })
}
