//! Inputs and results of a training in its record.

use crate::record::{Input, RecordBuilder, SplitRecord};
use anyhow::Result;
use eagpt_scene::Dataset;
use eagpt_scene::dataset::{POINTS_FILE, Subset};
use eagpt_train::job::light_part;
use eagpt_train::{TrainRequest, TrainSummary};

/// Fills the record of a run that is finished or was stopped.
pub(super) fn fill(
    builder: &mut RecordBuilder,
    request: &TrainRequest,
    summary: &TrainSummary,
) -> Result<()> {
    let others = summary.lights.iter().skip(1);
    let parts = std::iter::once("dataset".to_owned()).chain(others.map(|name| light_part(name)));
    let datasets = std::iter::once(&request.dataset).chain(&request.other_lights);
    for (path, part) in datasets.zip(parts) {
        let dataset = Dataset::open(path)?;
        builder.record.inputs.push(Input::of_cameras(&dataset)?);
        let points = dataset.root().join(POINTS_FILE);
        if points.is_file() {
            builder.record.inputs.push(Input::of(&points)?);
        }
        if let (Some(start), "dataset") = (&request.start, part.as_str()) {
            builder.record.inputs.push(Input::of(start)?);
        }
        // The digest that a resumed run compares: the camera file, and names and sizes of all
        // images.
        builder.record.inputs.push(Input {
            path: dataset.root().to_owned(),
            blake3: (summary.fingerprint.part(&part))
                .unwrap_or_default()
                .to_owned(),
        });
    }
    for (stage, seconds) in &summary.stage_seconds {
        builder.took(stage.name(), *seconds);
    }
    let record = &mut builder.record;
    record.seed = Some(request.options.seed);
    record.device = Some(summary.device.clone());
    record.split = Some(SplitRecord::new(&summary.split, Subset::Train));
    record.warnings.clone_from(&summary.warnings);
    record.complete = summary.scene.is_some();
    if let Some(own_light) = &summary.own_light {
        builder.measured("own_light", own_light)?;
    }
    let of_lights = (summary.lights.iter().skip(1)).map(|name| format!("lights/{name}/scene.ply"));
    let outputs = [
        "scene.ply",
        "all-lamps/scene.ply",
        "train.toml",
        "log.jsonl",
    ];
    let outputs = outputs.map(str::to_owned).into_iter().chain(of_lights);
    builder.wrote(outputs.filter(|name| request.out.join(name).is_file()));
    Ok(())
}
