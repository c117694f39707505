//! Masks for all views of a dataset.

use crate::consistency::{self, Comparison, Sight, Verdict};
use crate::error::Result;
use crate::labels::{self, Labels};
use crate::level::{Histogram, Level};
use crate::mask::{self, Mask, Region};
use crate::options::{Inconsistent, MaskOptions, Source};
use crate::overlay;
use crate::report::{MaskReport, RegionReport, ViewReport, ViewVerdict};
use eagpt_scene::dataset::EMISSION_DIR;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::tonemap::ExposureMeter;
use eagpt_scene::{Camera, Dataset, Image, View, files, ply};
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Folder of overlays and the report, inside of the folder of results.
const REPORT_DIR: &str = "masks";

/// Request of [`make_masks`].
#[derive(Debug, Clone)]
pub struct MaskRequest<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// Where `Emissive-exr/` and `masks/` go: the dataset's folder or another.
    pub out: PathBuf,
    /// The options.
    pub options: MaskOptions,
    /// Folder of labels of lamps.
    pub labels: Option<PathBuf>,
    /// Folder of labels of reflections.
    pub reflections: Option<PathBuf>,
    /// Trained scene that gives depth, where the dataset has none, and emission for
    /// [`Source::Emission`].
    pub scene: Option<PathBuf>,
}

/// Progress messages of the job.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum MaskProgress {
    /// Radiances of views are being counted.
    Measuring {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// A level has been found.
    Level(Level),
    /// Masks are being made.
    Masking {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// Overlays are being written.
    Drawing {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// A warning about the result.
    Warning {
        /// The text, one line.
        text: String,
    },
}

/// Result of the job.
#[derive(Debug, Clone)]
pub struct MaskSummary {
    /// All numbers.
    pub report: MaskReport,
    /// Files written, relative to the folder of results.
    pub outputs: Vec<PathBuf>,
    /// Warnings that were reported.
    pub warnings: Vec<String>,
}

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
/// [`crate::MaskError`]: an option out of range, a folder of labels that fits no view, no level between surfaces and lights, or a file.
pub fn make_masks(
    request: &MaskRequest<'_>,
    progress: &mut dyn FnMut(MaskProgress),
) -> Result<MaskSummary> {
    request.options.validate()?;
    let mut job = Job::prepare(request, progress)?;
    let level = job.find_level()?;
    let threshold = match request.options.source {
        Source::Auto => level.map(|level| level.level),
        Source::Level(level) => Some(level),
        Source::Emission(_) | Source::None => None,
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

struct Job<'a> {
    request: &'a MaskRequest<'a>,
    progress: &'a mut dyn FnMut(MaskProgress),
    labels: Option<Labels>,
    reflections: Option<Labels>,
    scene: Option<CpuScene>,
    warnings: Vec<String>,
}

impl<'a> Job<'a> {
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

    fn find_level(&mut self) -> Result<Option<Level>> {
        if self.request.options.source != Source::Auto {
            return Ok(None);
        }
        let total = self.num_views();
        let mut histogram = Histogram::default();
        for index in 0..total {
            let view = self.request.dataset.load_view(index)?;
            let rule = self.request.options.rule;
            let pixels = view.radiance.pixels().iter();
            histogram.add(pixels.map(|&rgb| rule.value(rgb)));
            let done = index + 1;
            (self.progress)(MaskProgress::Measuring { done, total });
        }
        let level = histogram.level().map_err(|problem| {
            let path = self.request.dataset.root().to_owned();
            crate::MaskError::NoLevel { path, problem }
        })?;
        (self.progress)(MaskProgress::Level(level));
        Ok(Some(level))
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
        let mut mask = match (options.source, &self.scene, threshold) {
            (Source::Emission(least), Some(scene), _) => {
                let emission = scene.gbuffer(&view.camera)?.extract(|s| [s.emission()]);
                let (width, height) = emission.size();
                Some(Mask::from_fn(width, height, |x, y| {
                    emission.get(x, y)[0] >= least
                }))
            }
            (_, _, Some(threshold)) => {
                let values = view.radiance.map(|&rgb| [options.rule.value(rgb)]);
                Some(mask::at_least(&values, threshold, options.border))
            }
            _ => None,
        };
        let size = view.radiance.size();
        if let Some(label) = self.label(index) {
            let label = labels::read(label, size)?;
            mask.get_or_insert_with(|| Mask::empty(size.0, size.1))
                .add(&label);
        }
        let Some(mut mask) = mask else {
            return Ok(None);
        };
        // Growing or closing must not bring back what is labelled as reflection.
        mask.tidy(options);
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
        if let Some(folder) = path.parent() {
            files::create_dir(folder)?;
        }
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
            (_, Some(depth)) => nearest(depth, &camera),
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

    /// Writes overlays, drops inconsistent regions if asked to, and reports on all views.
    fn finish_views(
        &mut self,
        masked: &Masked,
        comparison: Option<&Comparison>,
    ) -> Result<(Vec<ViewReport>, Vec<RegionReport>)> {
        let total = self.num_views();
        let (mut views, mut all_regions) = (Vec::new(), Vec::new());
        for index in 0..total {
            let (view, regions) = self.finish_view(index, masked, comparison)?;
            views.push(view);
            all_regions.extend(regions);
            let done = index + 1;
            (self.progress)(MaskProgress::Drawing { done, total });
        }
        Ok((views, all_regions))
    }

    fn finish_view(
        &self,
        index: usize,
        masked: &Masked,
        comparison: Option<&Comparison>,
    ) -> Result<(ViewReport, Vec<RegionReport>)> {
        let frame = &self.request.dataset.frames()[index];
        let check = self.request.options.check;
        let mask_path = self.request.out.join(mask_file(&frame.name));
        let mask = masked.is_known[index].then(|| read_mask(&mask_path, &frame.camera));
        let mut mask = mask.transpose()?;
        let regions = mask.as_ref().map(Mask::regions).unwrap_or_default();
        let mut reports = Vec::with_capacity(regions.len());
        for (number, region) in regions.iter().enumerate() {
            let support = comparison.map(|found| found.support[index][number].clone());
            let verdict = support.as_ref().map(|s| s.verdict(check.min_support));
            let dropped =
                verdict == Some(Verdict::Inconsistent) && check.inconsistent == Inconsistent::Drop;
            if let (true, Some(mask)) = (dropped, &mut mask) {
                mask.remove(region);
            }
            reports.push(RegionReport {
                view: frame.name.clone(),
                centre: region.centre(),
                num_pixels: region.pixels.len(),
                verdict,
                support: support.unwrap_or_default(),
                dropped,
            });
        }
        if let (true, Some(mask)) = (reports.iter().any(|r| r.dropped), &mask) {
            self.write_mask(&frame.name, mask)?;
        }
        let radiance = exr::read_rgb(&frame.files.radiance)?;
        let verdicts = reports.iter().map(|report| report.verdict);
        let drawn: Vec<(Region, Option<Verdict>)> = regions.into_iter().zip(verdicts).collect();
        let picture = self.place(&overlay_file(&frame.name))?;
        overlay::write(&picture, &radiance, &drawn, masked.meter.stops())?;
        let num_dropped = reports.iter().filter(|r| r.dropped).count();
        let mut view = ViewReport {
            name: frame.name.clone(),
            verdict: ViewVerdict::Unknown,
            num_pixels: mask.as_ref().map(Mask::count),
            coverage: mask.as_ref().map(Mask::coverage),
            num_regions: reports.len() - num_dropped,
            labelled: self.label(index).is_some(),
            num_inconsistent: reports
                .iter()
                .filter(|r| r.verdict == Some(Verdict::Inconsistent))
                .count(),
            missed: comparison.and_then(|found| found.missed[index]),
        };
        view.verdict = view.judge();
        Ok((view, reports))
    }
}

/// A mask that this job has written.
fn read_mask(path: &Path, camera: &Camera) -> Result<Mask> {
    let image = exr::read_single(path)?;
    Ok(Mask::from_fn(camera.width, camera.height, |x, y| {
        image.get(x, y)[0] > 0.5
    }))
}

/// A depth image at the size of `camera`: of each pixel the value in its middle, since depths of
/// different surfaces have no mean.
fn nearest(depth: &Image<1>, camera: &Camera) -> Image<1> {
    let (width, height) = (camera.width, camera.height);
    if depth.size() == (width, height) {
        return depth.clone();
    }
    let scaled = |at: u32, size: u32, full: u32| {
        ((2 * u64::from(at) + 1) * u64::from(full) / (2 * u64::from(size))) as u32
    };
    let pixels = (0..height).flat_map(|y| {
        let row = scaled(y, height, depth.height());
        (0..width).map(move |x| depth.get(scaled(x, width, depth.width()), row))
    });
    Image::from_pixels(width, height, pixels.collect()).expect("one value for each pixel")
}
