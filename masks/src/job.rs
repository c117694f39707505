//! Masks for all views of a dataset.

mod finish;
mod level;
mod off;
mod request;

use crate::consistency::{self, Comparison, Sight};
use crate::error::Result;
use crate::labels::{self, Labels};
use crate::mask::Mask;
use crate::options::{Inconsistent, MaskSource};
use crate::report::MaskReport;
use crate::threshold;
use eagpt_scene::dataset::EMISSION_DIR;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::tonemap::ExposureMeter;
use eagpt_scene::{Dataset, View, files, ply};
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use std::path::{Path, PathBuf};

pub use request::{MaskProgress, MaskRequest, MaskSummary};

/// Folder of overlays and the report, inside of the folder of results.
const REPORT_DIR: &str = "masks";
/// Thresholds from which on a pixel is a lamp's however few it has. Measured in a salon, a bistro, a
/// hotel room and a kitchen: lamps of one to three pixels are 37 thresholds and more, glints and
/// other regions of that size 6 at most.
const SURE: f32 = 10.0;

/// Intermediate results of the views, in the order of the dataset.
#[derive(Default)]
struct Masked {
    /// Whether there is a mask.
    is_known: Vec<bool>,
    /// Data for the comparison; `None` without a mask to compare or depth to compare with.
    sights: Vec<Option<Sight>>,
    /// Exposure meter of the overlays.
    meter: ExposureMeter,
}

/// The files that a job writes, relative to its folder; views without a mask have none.
pub fn planned_files(dataset: &Dataset) -> Vec<PathBuf> {
    let names = dataset.frames().iter().map(|frame| frame.name.as_str());
    let of_views = names.flat_map(|name| [mask_file(name), overlay_file(name)]);
    let report = ["report.json", "views.csv", "table.md"];
    let report = report.map(|name| Path::new(REPORT_DIR).join(name));
    of_views.chain(report).collect()
}

fn mask_file(name: &str) -> PathBuf {
    Path::new(EMISSION_DIR).join(format!("{name}.exr"))
}

fn overlay_file(name: &str) -> PathBuf {
    Path::new(REPORT_DIR)
        .join("overlay")
        .join(format!("{name}.png"))
}

/// Makes, compares and writes masks and their overlays. One view is in memory at a time, and of
/// each a reduced copy for the comparison.
///
/// # Errors
/// [`crate::MaskError`]: an option out of range, a folder of labels that fits no view, no level
/// between surfaces and lights, or a file.
pub fn make_masks(
    request: &MaskRequest<'_>,
    progress: &mut dyn FnMut(MaskProgress),
) -> Result<MaskSummary> {
    request.options.validate()?;
    off::check(request)?;
    let mut job = MaskJob::prepare(request, progress)?;
    let level = job.find_level()?;
    let threshold = match request.options.source {
        MaskSource::Auto => level.map(|level| level.level),
        MaskSource::Level(level) => Some(level),
        MaskSource::Emission(_) | MaskSource::None => None,
    };
    let mut masked = job.mask_views(threshold)?;
    let comparison = job.compare(std::mem::take(&mut masked.sights));
    let (views, regions) = job.finish_views(&masked, comparison.as_ref())?;
    let report = MaskReport {
        options: request.options.clone(),
        threshold,
        level,
        views,
        regions,
    };
    report.write(&request.out.join(REPORT_DIR))?;
    let written = planned_files(request.dataset).into_iter();
    Ok(MaskSummary {
        report,
        outputs: written
            .filter(|file| request.out.join(file).is_file())
            .collect(),
        warnings: job.warnings,
    })
}

struct MaskJob<'a> {
    request: &'a MaskRequest<'a>,
    progress: &'a mut dyn FnMut(MaskProgress),
    labels: Option<Labels>,
    reflections: Option<Labels>,
    scene: Option<CpuScene>,
    warnings: Vec<String>,
}

impl<'a> MaskJob<'a> {
    fn prepare(
        request: &'a MaskRequest<'a>,
        progress: &'a mut dyn FnMut(MaskProgress),
    ) -> Result<Self> {
        let labels = |folder: &Option<PathBuf>| {
            let folder = folder.as_deref();
            folder
                .map(|folder| labels::find(folder, request.dataset))
                .transpose()
        };
        let scene = request.scene.as_deref().map(ply::read_gaussians);
        let mut job = Self {
            labels: labels(&request.labels)?,
            reflections: labels(&request.reflections)?,
            scene: scene
                .transpose()?
                .map(|gaussians| CpuScene::new(&gaussians)),
            warnings: Vec::new(),
            request,
            progress,
        };
        let strangers: Vec<String> = [&job.labels, &job.reflections]
            .into_iter()
            .flatten()
            .flat_map(|labels| &labels.strangers)
            .map(|path| path.display().to_string())
            .collect();
        if let Some(first) = strangers.first() {
            let num = strangers.len();
            job.warn(format!(
                "{num} label images match no view, for example {first}"
            ));
        }
        Ok(job)
    }

    fn warn(&mut self, text: String) {
        self.warnings.push(text.clone());
        (self.progress)(MaskProgress::Warning { text });
    }

    fn num_views(&self) -> usize {
        self.request.dataset.len()
    }

    fn label(&self, index: usize) -> Option<&Path> {
        self.labels.as_ref()?.of(index)
    }

    fn mask_views(&mut self, threshold: Option<f32>) -> Result<Masked> {
        let total = self.num_views();
        let mut masked = Masked::default();
        for index in 0..total {
            let view = self.request.dataset.load_view(index)?;
            masked.meter.add(&view.radiance);
            let mask = self.mask(index, &view, threshold)?;
            if let Some(mask) = &mask {
                self.write_mask(&view.name, mask)?;
            }
            masked.is_known.push(mask.is_some());
            masked.sights.push(self.sight(&view, mask)?);
            let done = index + 1;
            (self.progress)(MaskProgress::Masking { done, total });
        }
        Ok(masked)
    }

    /// The mask of a view; `None` if nothing is known.
    fn mask(&self, index: usize, view: &View, threshold: Option<f32>) -> Result<Option<Mask>> {
        let options = &self.request.options;
        let size = view.radiance.size();
        let mut sure = Mask::empty(size.0, size.1);
        let mut mask = match (options.source, &self.scene, threshold) {
            (MaskSource::Emission(least), Some(scene), _) => {
                let emission = scene.gbuffer(&view.camera)?.extract(|s| [s.emission()]);
                let (width, height) = emission.size();
                Some(Mask::from_fn(width, height, |x, y| {
                    emission.get(x, y)[0] >= least
                }))
            }
            (_, _, Some(threshold)) => {
                let light = self.request.light(view)?;
                let values = light.map(|light| light.map(|&rgb| [options.rule.value(rgb)]));
                values.map(|values| {
                    let is_sure = |x, y| values.get(x, y)[0] >= SURE * threshold;
                    sure = Mask::from_fn(size.0, size.1, is_sure);
                    threshold::at_least(&values, threshold, options.border)
                })
            }
            _ => None,
        };
        if let Some(label) = self.label(index) {
            let label = labels::read(label, size)?;
            mask.get_or_insert_with(|| Mask::empty(size.0, size.1))
                .add(&label);
        }
        let Some(mut mask) = mask else {
            return Ok(None);
        };
        // Growing or closing must not bring back what is labelled as reflection.
        mask.tidy(options, &sure);
        let reflections = self.reflections.as_ref();
        if let Some(path) = reflections.and_then(|labels| labels.of(index)) {
            mask.subtract(&labels::read(path, size)?);
        }
        Ok(Some(mask))
    }

    fn write_mask(&self, name: &str, mask: &Mask) -> Result<()> {
        let path = self.place(&mask_file(name))?;
        Ok(exr::write_single(&path, &mask.image(), Precision::Half)?)
    }

    fn place(&self, file: &Path) -> Result<PathBuf> {
        let path = self.request.out.join(file);
        files::create_parent(&path)?;
        Ok(path)
    }

    /// Data of a view for the comparison; `None` without a mask to compare or depth to compare
    /// with.
    fn sight(&self, view: &View, mask: Option<Mask>) -> Result<Option<Sight>> {
        if self.request.options.check.inconsistent == Inconsistent::Ignore {
            return Ok(None);
        }
        let camera = consistency::reduced(&view.camera);
        let depth = match (&self.scene, &view.depth) {
            (_, Some(depth)) => consistency::nearest(depth, &camera),
            (Some(scene), None) => scene.gbuffer(&camera)?.depth(&camera),
            (None, None) => return Ok(None),
        };
        let regions = mask.as_ref().map(Mask::regions).unwrap_or_default();
        let mask = mask.map(|mask| consistency::reduced_mask(&mask, &camera));
        let places = |region| match &mask {
            Some(mask) => consistency::places(region, view.radiance.size(), mask, &camera, &depth),
            None => Vec::new(),
        };
        Ok(Some(Sight {
            regions: regions.iter().map(places).collect(),
            mask,
            camera,
            depth,
        }))
    }

    /// The comparison, if all views have depth.
    fn compare(&mut self, sights: Vec<Option<Sight>>) -> Option<Comparison> {
        let check = self.request.options.check;
        if check.inconsistent == Inconsistent::Ignore {
            return None;
        }
        let total = sights.len();
        let sights: Vec<Sight> = sights.into_iter().flatten().collect();
        if sights.len() < total {
            self.warn(format!(
                "masks are not compared between views: {} of {total} views have no depth, and there is no scene to take it from",
                total - sights.len()
            ));
            return None;
        }
        Some(consistency::compare(&sights, check.min_support))
    }
}
