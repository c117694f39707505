//! Provenance of renders, from the `record.json` that `eagpt render` writes beside them.

use crate::error::Result;
use crate::scene_metrics::mean;
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_scene::files::digest;
use eagpt_scene::{Dataset, SceneError, files};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The `record.json` of renders; empty where `eagpt render` has left none.
#[derive(Debug, Default)]
pub(crate) struct RenderRecord(Option<Value>);

impl RenderRecord {
    /// Reads the record in `folder`.
    ///
    /// # Errors
    /// [`SceneError`] if there is a record that cannot be read or is no JSON.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join("record.json");
        if !path.is_file() {
            return Ok(Self(None));
        }
        let record: Value = serde_json::from_slice(&files::read(&path)?)
            .map_err(|error| SceneError::invalid(&path, "JSON", error.to_string()))?;
        Ok(Self(Some(record).filter(|of| of["command"] == "render")))
    }

    /// The folder or file of the dataset whose cameras were rendered.
    pub(crate) fn cameras(&self) -> Option<PathBuf> {
        let path = self.0.as_ref()?["options"]["cameras"].as_str()?;
        Some(path.into())
    }

    /// The dataset whose cameras were rendered, if it is still there, and the same.
    pub(crate) fn dataset(&self) -> Option<Dataset> {
        let dataset = Dataset::open_cameras(&self.cameras()?).ok()?;
        let now = digest::of_file(dataset.transforms()).ok()?;
        let mut inputs = self.0.as_ref()?["inputs"].as_array()?.iter();
        inputs
            .any(|input| input["blake3"] == now.as_str())
            .then_some(dataset)
    }

    /// The rule by which views were chosen.
    pub(crate) fn rule(&self) -> Option<SplitRule> {
        serde_json::from_value(self.0.as_ref()?["split"]["rule"].clone()).ok()
    }

    /// The subset that was rendered.
    pub(crate) fn subset(&self) -> Option<Subset> {
        serde_json::from_value(self.0.as_ref()?["split"]["subset"].clone()).ok()
    }

    /// Number of views that were rendered.
    pub(crate) fn num_views(&self) -> Option<usize> {
        let num = self.0.as_ref()?["split"]["num_views"].as_u64()?;
        usize::try_from(num).ok()
    }
}

/// Provenance of renders. Each part is `None` where the record lacks it, as for renders of other
/// programs.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Provenance {
    /// `0-bounce`, `1-bounce` or `path`.
    pub mode: Option<String>,
    /// Samples of light in a pixel; `None` for a mode that takes none.
    pub spp: Option<u64>,
    /// Mean wall time of the evaluated views, in seconds.
    pub seconds_per_frame: Option<f64>,
    /// The denoiser that ran.
    pub denoiser: Option<String>,
    /// The scene's file, as it was named.
    pub scene: Option<String>,
}

impl Provenance {
    /// Takes it from a record; `views` are the names of those that are evaluated.
    pub(crate) fn of(record: &RenderRecord, views: &[&str]) -> Self {
        let Some(record) = &record.0 else {
            return Self::default();
        };
        let (options, seconds) = (&record["options"], &record["seconds"]);
        let text = |value: &Value| value.as_str().map(str::to_owned);
        let per_ray = options["integrator"]["num_samples"].as_u64();
        let rays_per_axis = options["rays_per_axis"].as_u64();
        let times = views
            .iter()
            .filter_map(|name| seconds[format!("views/{name}")].as_f64());
        Self {
            mode: text(&options["integrator"]["mode"]),
            spp: per_ray
                .zip(rays_per_axis)
                .and_then(|(num, axis)| axis.checked_pow(2)?.checked_mul(num)),
            seconds_per_frame: mean(times),
            denoiser: text(&options["denoise"]["ran"]["name"]),
            scene: text(&options["scene"]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(record: Option<&str>) -> Result<Provenance> {
        let dir = tempfile::tempdir().unwrap();
        if let Some(text) = record {
            std::fs::write(dir.path().join("record.json"), text).unwrap();
        }
        let record = RenderRecord::read(dir.path())?;
        Ok(Provenance::of(&record, &["a", "b", "c"]))
    }

    #[test]
    fn a_record_tells_mode_samples_and_times() {
        let record = json!({
            "command": "render",
            "options": {
                "scene": "runs/kitchen/scene.ply",
                "integrator": {"mode": "path", "num_samples": 16, "max_bounces": 7},
                "rays_per_axis": 2,
                "denoise": {"asked": "auto", "ran": {"name": "oidn", "version": "2.3.0"}},
            },
            "seconds": {"total": 99.0, "views/a": 2.0, "views/b": 4.0, "views/d": 60.0},
        });
        let expected = Provenance {
            mode: Some("path".to_owned()),
            spp: Some(64),
            seconds_per_frame: Some(3.0),
            denoiser: Some("oidn".to_owned()),
            scene: Some("runs/kitchen/scene.ply".to_owned()),
        };
        assert_eq!(read(Some(&record.to_string())).unwrap(), expected);
    }

    #[test]
    fn what_a_record_does_not_tell_is_unknown() {
        assert_eq!(read(None).unwrap(), Provenance::default());
        for text in [
            r#"{"command": "train", "options": {"scene": "a"}}"#,
            r#"{"command": "render"}"#,
            r#"{"command": "render", "options": {"scene": 3, "denoise": {"ran": null}}}"#,
            "[]",
        ] {
            assert_eq!(read(Some(text)).unwrap(), Provenance::default(), "{text}");
        }
        let message = read(Some("{")).unwrap_err().to_string();
        assert!(message.contains("record.json: JSON"), "{message}");
    }
}
