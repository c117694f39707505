//! Our own datasets, those of EAG-PT among them: to be rotated, downsampled or rewritten.

use super::{Depth, Emission, SourceDataset, SourceFiles, SourceFormat, SourceFrame};
use crate::error::{Problem, Result};
use eagpt_scene::lens::LensModel;
use eagpt_scene::{Dataset, Frame, Lens, SceneError};
use std::path::Path;

pub(super) fn read(path: &Path) -> Result<SourceDataset> {
    let (dataset, bad) = Dataset::survey(path)?;
    let mut source = SourceDataset::new(
        SourceFormat::Eagpt,
        dataset.root(),
        dataset.transforms().to_owned(),
    );
    source.info = dataset.info();
    source.points = dataset.points_file().map(Path::to_owned);
    let problems = bad.iter().map(|bad| Problem::new(&bad.name, &bad.error));
    source.problems.extend(problems);
    for frame in dataset.frames() {
        let camera = &frame.camera;
        let params = [camera.fx, camera.fy, camera.cx, camera.cy];
        let size = (camera.width, camera.height);
        let lens = Lens::new(LensModel::Pinhole, size, &params)
            .map_err(|problem| SceneError::invalid(dataset.transforms(), &frame.name, problem));
        let built = lens.map(|lens| SourceFrame {
            name: frame.name.clone(),
            lens,
            world_from_camera: camera.world_from_camera,
            files: files_of(frame),
        });
        source.add(&frame.name, built.map_err(Into::into));
    }
    Ok(source)
}

fn files_of(frame: &Frame) -> SourceFiles {
    let files = &frame.files;
    SourceFiles {
        radiance: files.radiance.clone(),
        emission: files.emission.clone().map(Emission::Mask),
        normal: files.normal.clone(),
        alpha: files.alpha.clone(),
        depth: files.depth.clone().map(|path| Depth { path, unit: 1.0 }),
        albedo: files.albedo.clone(),
        clipped: files.clipped.clone(),
        valid: files.valid.clone(),
    }
}
