//! One condition: its checks before any work, then its views.

use super::channels::scene_metrics;
use super::options::EvalOptions;
use super::renders::Renders;
use super::selection::Selection;
use crate::align::{ExposureFit, compare_aligned};
use crate::error::{EvalError, Result};
use crate::evaluation::{Evaluation, Mean};
use crate::flip::magma_rgb8;
use crate::known::{KnownPixels, pack};
use crate::pair::compare_known;
use crate::provenance::Provenance;
use crate::regions::{self, LightChange, Lights, region_metrics};
use crate::report;
use crate::view::{EmittersFrom, ViewMetrics};
use eagpt_scene::dataset::VALID_DIR;
use eagpt_scene::{Dataset, Frame, Image, SceneError, View, files, png};
use std::borrow::Cow;
use std::path::PathBuf;

/// A condition all of whose files exist.
pub(super) struct Prepared<'a> {
    options: &'a EvalOptions,
    selection: Selection,
    renders: Renders,
    before: Option<Earlier>,
    provenance: Provenance,
    /// Warnings about the numbers.
    pub(super) warnings: Vec<String>,
}

/// The dataset under the earlier light, and its frame for each view.
struct Earlier {
    dataset: Dataset,
    indices: Vec<usize>,
}

/// Images of one view to be compared.
struct Loaded {
    view: View,
    render: Image<3>,
    /// Emission and its source, the reference preferred.
    emission: Option<(EmittersFrom, Image<1>)>,
    before: Option<View>,
    /// Pixels known in the reference and the earlier reference; `None`: all.
    known: Option<KnownPixels>,
}

/// The known pixels of a view, for per-pixel metrics.
struct Known<'a> {
    reference: Cow<'a, Image<3>>,
    render: Cow<'a, Image<3>>,
    emission: Option<Cow<'a, Image<1>>>,
    before: Option<(Cow<'a, Image<3>>, Option<Cow<'a, Image<1>>>)>,
}

impl Loaded {
    fn known(&self) -> Known<'_> {
        let known = self.known.as_ref();
        let emission = self.emission.as_ref();
        Known {
            reference: pack(known, &self.view.radiance),
            render: pack(known, &self.render),
            emission: emission.map(|(_, emission)| pack(known, emission)),
            before: self.before.as_ref().map(|view| {
                let emission = view.emission.as_ref().map(|image| pack(known, image));
                (pack(known, &view.radiance), emission)
            }),
        }
    }
}

impl Known<'_> {
    fn lights(&self) -> Lights<'_> {
        Lights {
            after: &self.reference,
            emission: self.emission.as_deref(),
            before: (self.before.as_ref()).map(|(radiance, emission)| regions::Before {
                radiance,
                emission: emission.as_deref(),
            }),
        }
    }
}

/// Statistics over all views of a condition.
#[derive(Default)]
struct Survey {
    exposure: ExposureFit,
    change: LightChange,
}

impl<'a> Prepared<'a> {
    /// Opens everything and reads headers, not pixels.
    pub(super) fn new(options: &'a EvalOptions) -> Result<Self> {
        options.flip.validate()?;
        let selection = Selection::new(options)?;
        let frames: Vec<_> = selection.frames().collect();
        let renders = Renders::find(&options.renders, &frames)?;
        let names: Vec<&str> = frames.iter().map(|frame| frame.name.as_str()).collect();
        let provenance = Provenance::of(&selection.record, &names);
        let before = Earlier::open(options, &selection)?;
        let mut warnings = [selection.warnings.clone(), renders.warnings()].concat();
        let num_masked = frames.iter().filter(|f| f.files.valid.is_some()).count();
        if num_masked > 0 {
            warnings.push(format!(
                "{num_masked} of {} views are measured where {VALID_DIR} says that they are known: errors of pixels and the mean of FLIP there, SSIM \
                 in windows that touch no other pixel",
                frames.len()
            ));
        }
        let unknown = frames
            .iter()
            .filter(|frame| frame.files.emission.is_none() && !renders.has_emission(&frame.name))
            .count();
        if before.is_some() && unknown > 0 {
            warnings.push(format!(
                "emission is not known in {unknown} of {} views: emitters count as surfaces there",
                frames.len()
            ));
        }
        Ok(Self {
            options,
            renders,
            before,
            provenance,
            warnings,
            selection,
        })
    }

    pub(super) fn num_views(&self) -> usize {
        self.selection.indices.len()
    }

    /// Compares all views and writes the results; `done` is told each view's name.
    pub(super) fn run(self, done: &mut dyn FnMut(&str)) -> Result<Evaluation> {
        let survey = self.survey()?;
        let mut views = Vec::with_capacity(self.num_views());
        for position in 0..self.num_views() {
            let loaded = self.load(position)?;
            views.push(self.view_metrics(&loaded, &survey)?);
            done(&loaded.view.name);
        }
        let evaluation = Evaluation {
            name: self.options.condition(),
            provenance: self.provenance,
            means: Mean::of_views(&views),
            exposure_scale: survey.exposure.scale(),
            light_change: survey.change.ratio(),
            regions: regions::pooled(views.iter().map(|view| &view.regions)),
            views,
            num_rendered: self.selection.num_rendered,
            split: self.selection.rule(),
            subset: self.selection.subset,
            warnings: self.warnings,
        };
        report::write(&self.options.out, &evaluation)?;
        Ok(evaluation)
    }

    /// Reading all views twice costs little beside FLIP, and keeping them would cost memory.
    fn survey(&self) -> Result<Survey> {
        let mut survey = Survey::default();
        for position in 0..self.num_views() {
            let loaded = self.load(position)?;
            let known = loaded.known();
            let emission = known.emission.as_deref();
            survey
                .exposure
                .add(&known.reference, &known.render, emission);
            survey.change.add(&known.lights());
        }
        Ok(survey)
    }

    fn load(&self, position: usize) -> Result<Loaded> {
        let Selection {
            dataset, indices, ..
        } = &self.selection;
        let view = dataset.load_view(indices[position])?;
        let of_render = || self.renders.emission(&view.name);
        let before = self
            .before
            .as_ref()
            .map(|earlier| earlier.dataset.load_view(earlier.indices[position]))
            .transpose()?;
        let masks = [Some(&view), before.as_ref()].into_iter().flatten();
        let known = KnownPixels::in_all(masks.filter_map(|view| view.valid.as_ref()));
        if known.as_ref().is_some_and(|known| known.num() == 0) {
            let path = dataset.frames()[indices[position]].files.valid.as_deref();
            let path = path.unwrap_or(dataset.root());
            return Err(SceneError::invalid(path, "pixels", "none is known").into());
        }
        Ok(Loaded {
            render: self.renders.radiance(&view.name)?,
            emission: match &view.emission {
                Some(mask) => Some((EmittersFrom::Reference, mask.clone())),
                None => of_render()?.map(|image| (EmittersFrom::Render, image)),
            },
            before,
            known,
            view,
        })
    }

    fn view_metrics(&self, loaded: &Loaded, survey: &Survey) -> Result<ViewMetrics> {
        let (view, render, flip) = (&loaded.view, &loaded.render, &self.options.flip);
        let reference = &view.radiance;
        let known = loaded.known.as_ref();
        let comparison = compare_known(reference, render, known, flip)?;
        let error = &comparison.flip_hdr_error;
        let map_path = map_path(self.options, &view.name);
        if let Some(folder) = map_path.parent() {
            files::create_dir(folder)?;
        }
        png::write_rgb8(&map_path, error.width(), error.height(), &magma_rgb8(error))?;
        let aligned = survey
            .exposure
            .scale()
            .map(|scale| compare_aligned(reference, render, scale, known, flip))
            .transpose()?;
        let pixels = loaded.known();
        Ok(ViewMetrics {
            name: view.name.clone(),
            image: comparison.metrics,
            aligned,
            scene: scene_metrics(view, known, &self.renders)?,
            emitters_from: loaded.emission.as_ref().map(|(from, _)| *from),
            regions: region_metrics(&pixels.lights(), &pixels.render, survey.change.ratio()),
        })
    }
}

impl Earlier {
    /// The earlier light of the selected views; `None` if there is none but their own.
    ///
    /// # Errors
    /// [`SceneError`] if the earlier dataset lacks a view, or has it in another size.
    fn open(options: &EvalOptions, selection: &Selection) -> Result<Option<Self>> {
        let Some(path) = &options.before else {
            return Ok(None);
        };
        let before = Self::matched(Dataset::open(path)?, selection)?;
        let real = |dataset: &Dataset| dataset.transforms().canonicalize().ok();
        Ok(Some(before).filter(|before| real(&before.dataset) != real(selection.dataset())))
    }

    fn matched(before: Dataset, selection: &Selection) -> Result<Self> {
        let frame_of = |frame: &Frame| {
            let invalid = |problem| {
                EvalError::from(SceneError::invalid(
                    before.transforms(),
                    &frame.name,
                    problem,
                ))
            };
            let mut frames = before.frames().iter();
            let found = frames.position(|earlier| earlier.name == frame.name);
            let found = found.ok_or_else(|| {
                let expected = selection.dataset().transforms().display();
                invalid(format!("no such view, but {expected} has it"))
            })?;
            let camera = &before.frames()[found].camera;
            if (camera.width, camera.height) != (frame.camera.width, frame.camera.height) {
                return Err(invalid(format!(
                    "{}x{} pixels, the view after it has {}x{}",
                    camera.width, camera.height, frame.camera.width, frame.camera.height
                )));
            }
            Ok(found)
        };
        let indices = selection.frames().map(frame_of).collect::<Result<_>>()?;
        Ok(Self {
            dataset: before,
            indices,
        })
    }
}

fn map_path(options: &EvalOptions, view: &str) -> PathBuf {
    options.out.join("flip").join(format!("{view}.png"))
}
