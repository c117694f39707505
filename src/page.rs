//! A scene as a page for a browser.

use crate::args;
use crate::terminal;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use eagpt_scene::dataset::{Frame, UpAxis};
use eagpt_scene::spread::evenly;
use eagpt_scene::tonemap::{Display, ToneMap};
use eagpt_scene::{Dataset, Gaussians, Lamps, LightBasis, lamps, light_basis};
use eagpt_viewer::pack::Pack;
use eagpt_viewer::page::{PageContent, PageKind, PageView};
use eagpt_viewer::{page, photograph};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Views that a page has unless more are asked for.
const DEFAULT_VIEWS: u32 = 24;
/// Longest edge of a photograph, pixels, unless another is asked for.
const DEFAULT_PHOTOGRAPH: u32 = 480;

/// Content of a page beside the scene.
#[derive(Debug, Clone, Default, Args, Serialize)]
#[command(next_help_heading = "Page")]
pub(crate) struct PageArgs {
    /// Dataset whose cameras and photographs the page has: a folder with a transforms.json, or that
    /// file [default: none, the page opens in the middle of the scene]
    #[arg(long, value_name = "DATASET")]
    dataset: Option<PathBuf>,
    /// Names of the views, separated by commas [default: up to 24, evenly spread]
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    views: Vec<String>,
    /// Number of views, evenly spread, 1 to 1000 [default: 24]
    #[arg(long, value_name = "N", conflicts_with = "views", value_parser = clap::value_parser!(u32).range(1..=1000))]
    max_views: Option<u32>,
    /// Longest edge of the photographs in pixels, 0 to 4096; 0 leaves them out [default: 480]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(0..=4096))]
    photograph_size: Option<u32>,
    /// Lamps of the scene [default: lamps.json in its folder, if it is there]
    #[arg(long, value_name = "LAMPS.json")]
    lamps: Option<PathBuf>,
    /// Basis of light, as `eagpt bake --per-light` writes it: lamps get sliders of power and colour
    /// [default: SCENE.lights beside the scene, if it is there]
    #[arg(long, value_name = "SCENE.lights")]
    lights: Option<PathBuf>,
    /// Leave out the SCENE.lights beside the scene
    #[arg(long, conflicts_with = "lights")]
    no_lights: bool,
    /// Exposure that the page opens with, stops, -8 to 8 [default: 0]
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = args::within(-8.0_f32..=8.0))]
    exposure: Option<f32>,
    /// Tone map that the page opens with [default: srgb]
    #[arg(long, value_name = "CURVE", value_enum)]
    tone_map: Option<ToneMap>,
    /// Title of the page [default: the name of the scene's file]
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
}

impl PageArgs {
    /// The same for the scene of a run: with `dataset` unless another is asked for, and the name of
    /// its folder as title.
    pub(crate) fn for_run(&self, run: Option<&Path>, dataset: Option<PathBuf>) -> Self {
        let name = run.and_then(|run| Some(run.file_name()?.to_string_lossy().into_owned()));
        Self {
            dataset: self.dataset.clone().or(dataset),
            title: self.title.clone().or(name),
            ..self.clone()
        }
    }

    pub(crate) fn dataset(&self) -> Option<&Path> {
        self.dataset.as_deref()
    }

    /// Refuses what says which of a dataset's views a page has, where there is no dataset.
    fn refuse_views(&self) -> Result<()> {
        refuse(&self.of_views(), "needs --dataset")
    }

    fn of_views(&self) -> [(&'static str, bool); 3] {
        [
            ("--views", !self.views.is_empty()),
            ("--max-views", self.max_views.is_some()),
            ("--photograph-size", self.photograph_size.is_some()),
        ]
    }

    /// Refuses options of a page where none is written.
    ///
    /// # Errors
    /// If one was given.
    pub(crate) fn refuse(&self) -> Result<()> {
        let given = [
            ("--dataset", self.dataset.is_some()),
            ("--lamps", self.lamps.is_some()),
            ("--lights", self.lights.is_some()),
            ("--no-lights", self.no_lights),
            ("--exposure", self.exposure.is_some()),
            ("--tone-map", self.tone_map.is_some()),
            ("--title", self.title.is_some()),
        ];
        let given: Vec<_> = given.into_iter().chain(self.of_views()).collect();
        refuse(&given, "only a page has it: --format html")
    }
}

/// Refuses the first of `options` that is given.
fn refuse(options: &[(&str, bool)], reason: &str) -> Result<()> {
    match options.iter().find(|(_, is_given)| *is_given) {
        Some((name, _)) => bail!("{name}: {reason}"),
        None => Ok(()),
    }
}

/// A scene packed, with all that its page shows.
pub(crate) struct ScenePage {
    pub(crate) pack: Pack,
    pub(crate) lamps: Lamps,
    /// Light by lamps, if it is on the page.
    pub(crate) basis: Option<LightBasis>,
    title: String,
    up: UpAxis,
    views: Vec<PageView>,
    display: Display,
}

impl ScenePage {
    /// Packs the Gaussians of the file `scene` and gathers what stands beside it.
    ///
    /// # Errors
    /// If dataset, lamps or photographs cannot be read, a view is not there, or the scene cannot be
    /// packed.
    pub(crate) fn new(scene: &Path, gaussians: &Gaussians, args: &PageArgs) -> Result<Self> {
        let lamps = read_lamps(scene, args.lamps.as_deref())?;
        let (views, up) = match &args.dataset {
            None => {
                args.refuse_views()?;
                (Vec::new(), UpAxis::default())
            }
            Some(path) => {
                let dataset = Dataset::open_cameras(path)?;
                (read_views(&dataset, args)?, dataset.up())
            }
        };
        let basis = read_lights(scene, gaussians, args)?;
        let pack = Pack::new(gaussians, &lamps, basis.as_ref())
            .with_context(|| scene.display().to_string())?;
        let name = || scene.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self {
            pack,
            lamps,
            basis,
            title: args.title.clone().unwrap_or_else(|| name().into_owned()),
            up,
            views,
            display: Display {
                stops: args.exposure.unwrap_or_default(),
                tone_map: args.tone_map.unwrap_or_default(),
            },
        })
    }

    /// The page of a training on `dataset` that begins with these Gaussians.
    ///
    /// # Errors
    /// If the photographs cannot be read or the scene cannot be packed.
    pub(crate) fn of_training(
        gaussians: &Gaussians,
        dataset: &Path,
        title: String,
    ) -> Result<Self> {
        let dataset = Dataset::open_cameras(dataset)?;
        let lamps = Lamps::default();
        Ok(Self {
            pack: Pack::new(gaussians, &lamps, None)?,
            lamps,
            basis: None,
            title,
            up: dataset.up(),
            views: read_views(&dataset, &PageArgs::default())?,
            display: Display::default(),
        })
    }

    /// The page as HTML.
    ///
    /// # Errors
    /// If the content has numbers that JSON has not.
    pub(crate) fn html(&self, gaussians: &Gaussians, kind: PageKind) -> Result<String> {
        let content = PageContent {
            title: &self.title,
            up: self.up.vector(),
            display: self.display,
            views: &self.views,
            lamps: &self.lamps,
            kind,
        };
        Ok(page::html(&self.pack, gaussians, &content)?)
    }
}

/// The lamps of a scene: of the file that was named, or of the one beside it if that is there.
fn read_lamps(scene: &Path, named: Option<&Path>) -> Result<Lamps> {
    let beside = lamps::lamps_file_beside(scene);
    match named {
        Some(path) => Ok(lamps::read_lamps(path)?),
        None if beside.exists() => Ok(lamps::read_lamps(&beside)?),
        None => Ok(Lamps::default()),
    }
}

/// The basis of light of a scene: of the file that was named, or of the one beside it if that is
/// there and is to be taken. One that does not fit the scene is an error.
fn read_lights(scene: &Path, gaussians: &Gaussians, args: &PageArgs) -> Result<Option<LightBasis>> {
    let beside = light_basis::lights_file_beside(scene);
    match &args.lights {
        Some(path) => fitting_lights(path, scene, gaussians).map(Some),
        None if args.no_lights || !beside.exists() => Ok(None),
        None => fitting_lights(&beside, scene, gaussians)
            .map(Some)
            .map_err(|error| anyhow!("{}; --no-lights leaves it out", terminal::one_line(&error))),
    }
}

fn fitting_lights(path: &Path, scene: &Path, gaussians: &Gaussians) -> Result<LightBasis> {
    let basis = LightBasis::read(path)?;
    if let Err(difference) = basis.check(gaussians) {
        let (path, scene) = (path.display(), scene.display());
        bail!("{path}: {difference}; {scene} is another");
    }
    Ok(basis)
}

fn read_views(dataset: &Dataset, args: &PageArgs) -> Result<Vec<PageView>> {
    let frames = dataset.frames();
    let chosen: Vec<&Frame> = if args.views.is_empty() {
        evenly(frames, args.max_views.unwrap_or(DEFAULT_VIEWS) as usize).collect()
    } else {
        let named = |name: &String| {
            let found = frames.iter().find(|frame| frame.name == *name);
            found.with_context(|| format!("--views: {}", dataset.no_such_view(name)))
        };
        args.views.iter().map(named).collect::<Result<_>>()?
    };
    let side = args.photograph_size.unwrap_or(DEFAULT_PHOTOGRAPH);
    let view = |frame: &&Frame| {
        let path = &frame.files.radiance;
        // A dataset of cameras alone has none.
        let has_photograph = side > 0 && path.is_file();
        let photograph = has_photograph.then(|| photograph::embed(path, side));
        Ok(PageView {
            name: frame.name.clone(),
            camera: frame.camera,
            photograph: photograph.transpose()?,
        })
    };
    chosen.par_iter().map(view).collect()
}
