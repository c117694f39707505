//! Normal maps by a network of the user: any ONNX model with one image in and vectors out.
//!
//! ONNX Runtime is loaded at run time and never downloaded. The network gets display-referred
//! input: linear light at the exposure of the view, clipped at white, sRGB-encoded, minus a mean,
//! over a deviation. Its maps are written unchanged, to be read like those of any other estimator.

#[cfg(test)]
mod tests;

use super::NormalProgress;
use crate::error::{ConvertError, Result};
use eagpt_scene::color::srgb_from_linear;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::lens::remap;
use eagpt_scene::tonemap::ExposureMeter;
use eagpt_scene::{Dataset, Image, files};
use glam::DVec2;
use ort::environment::Environment;
use ort::session::Session;
use ort::value::{Tensor, ValueType};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Environment variable with the path of the library.
pub(crate) const LIBRARY_VARIABLE: &str = "EAGPT_ONNXRUNTIME";
/// Longest side of a network's picture, pixels.
const MAX_SIDE: u32 = 8192;

/// A network and its expected input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkOptions {
    /// The model.
    pub model: PathBuf,
    /// The library of ONNX Runtime; absent: `EAGPT_ONNXRUNTIME`, else the dynamic loader's search
    /// path.
    pub library: Option<PathBuf>,
    /// Width and height of the network's picture; absent: that of the model, else the view's, each
    /// rounded to a multiple of [`Self::multiple`].
    pub size: Option<[u32; 2]>,
    /// Sides of the picture are multiples of this, 1 to 1024.
    pub multiple: u32,
    /// Taken from sRGB values, by channel.
    pub mean: [f32; 3],
    /// Divisor after subtracting the mean, by channel; each above 0.
    pub deviation: [f32; 3],
}

impl NetworkOptions {
    /// Those of most networks: mean and deviation of ImageNet, sides that are multiples of 32.
    pub fn new(model: PathBuf) -> Self {
        Self {
            model,
            library: None,
            size: None,
            multiple: 32,
            mean: [0.485, 0.456, 0.406],
            deviation: [0.229, 0.224, 0.225],
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`ConvertError::Option`] with the option's name and its value.
    pub fn validate(&self) -> Result<()> {
        let sides = self.size.into_iter().flatten();
        if let Some(side) = sides
            .into_iter()
            .find(|side| !(1..=MAX_SIDE).contains(side))
        {
            let problem = format!("{side} is not from 1 to {MAX_SIDE}");
            return Err(ConvertError::option("size", problem));
        }
        if !(1..=1024).contains(&self.multiple) {
            let problem = format!("{} is not from 1 to 1024", self.multiple);
            return Err(ConvertError::option("multiple", problem));
        }
        if self.mean.iter().any(|value| !value.is_finite()) {
            let problem = format!("{:?} is not finite", self.mean);
            return Err(ConvertError::option("mean", problem));
        }
        let is_wrong = |value: &f32| !(*value > 0.0 && value.is_finite());
        if self.deviation.iter().any(is_wrong) {
            let problem = format!("{:?} is not above 0 and finite", self.deviation);
            return Err(ConvertError::option("deviation", problem));
        }
        Ok(())
    }
}

/// Where the channels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    /// Batch, channel, row, column
    ChannelsFirst,
    /// Batch, row, column, channel
    ChannelsLast,
}

impl Layout {
    /// The layout of a shape and its rows and columns, −1 where the model leaves them open.
    fn of(shape: &[i64], is_num_channels: impl Fn(i64) -> bool) -> Option<(Self, [i64; 2])> {
        match *shape {
            [_, channels, rows, columns] if is_num_channels(channels) => {
                Some((Self::ChannelsFirst, [rows, columns]))
            }
            [_, rows, columns, channels] if is_num_channels(channels) => {
                Some((Self::ChannelsLast, [rows, columns]))
            }
            _ => None,
        }
    }

    /// The place of a value.
    fn index(
        self,
        size: (usize, usize),
        num_channels: usize,
        pixel: usize,
        channel: usize,
    ) -> usize {
        match self {
            Self::ChannelsFirst => channel * size.0 * size.1 + pixel,
            Self::ChannelsLast => pixel * num_channels + channel,
        }
    }
}

/// Runs the network on every view and writes `<view>.exr` of its own size into `out`.
///
/// # Errors
/// [`ConvertError::Network`]: no library, a model that cannot be loaded or does not have a picture
/// in and vectors out; an option out of its range; a file.
pub fn run_network(
    dataset: &Dataset,
    options: &NetworkOptions,
    out: &Path,
    progress: &mut dyn FnMut(NormalProgress),
) -> Result<()> {
    options.validate()?;
    let mut network = Network::load(options)?;
    let total = dataset.len();
    for (index, frame) in dataset.frames().iter().enumerate() {
        let radiance = exr::read_rgb(&frame.files.radiance)?;
        let map = network.run(&radiance)?;
        let path = out.join(format!("{}.exr", frame.name));
        if let Some(folder) = path.parent() {
            files::create_dir(folder)?;
        }
        exr::write_rgb(&path, &map, Precision::Float)?;
        let done = index + 1;
        progress(NormalProgress::Estimating { done, total });
    }
    Ok(())
}

struct Network<'a> {
    options: &'a NetworkOptions,
    session: Session,
    input: String,
    layout: Layout,
    /// Rows and columns, as the model has them.
    stated: [i64; 2],
}

impl<'a> Network<'a> {
    fn load(options: &'a NetworkOptions) -> Result<Self> {
        let problem = |path: &Path, problem: String| ConvertError::Network {
            path: path.to_owned(),
            problem,
        };
        let library = library_file(options.library.as_deref());
        let environment = environment(&library).map_err(|error| problem(&library, error))?;
        let of_model = |error: String| problem(&options.model, error);
        let session = Session::builder(&environment)
            .map_err(|error| of_model(error.to_string()))?
            .with_intra_threads(rayon::current_num_threads())
            .map_err(|error| of_model(error.to_string()))?
            .commit_from_file(&options.model)
            .map_err(|error| of_model(error.to_string()))?;
        let [input] = session.inputs() else {
            let num = session.inputs().len();
            return Err(of_model(format!("{num} inputs, not one picture")));
        };
        let shape: Vec<i64> = match input.dtype() {
            ValueType::Tensor { shape, .. } => shape.to_vec(),
            other => return Err(of_model(format!("the input is {other}, no picture"))),
        };
        let (layout, stated) = Layout::of(&shape, |channels| channels == 3).ok_or_else(|| {
            of_model(format!(
                "the input is {shape:?}, not 1 x 3 x rows x columns or 1 x rows x columns x 3"
            ))
        })?;
        Ok(Self {
            options,
            input: input.name().to_owned(),
            session,
            layout,
            stated,
        })
    }

    fn problem(&self, problem: impl std::fmt::Display) -> ConvertError {
        ConvertError::Network {
            path: self.options.model.clone(),
            problem: problem.to_string(),
        }
    }

    /// Width and height of the picture for a view.
    fn size(&self, view: (u32, u32)) -> (u32, u32) {
        let multiple = self.options.multiple;
        let rounded = |side: u32| {
            let nearest = (side + multiple / 2) / multiple;
            (nearest.max(1) * multiple).min(MAX_SIDE)
        };
        let side = |stated: i64, own: u32| {
            let stated = u32::try_from(stated)
                .ok()
                .filter(|side| (1..=MAX_SIDE).contains(side));
            stated.unwrap_or_else(|| rounded(own))
        };
        match self.options.size {
            Some([width, height]) => (width, height),
            None => (side(self.stated[1], view.0), side(self.stated[0], view.1)),
        }
    }

    fn run(&mut self, radiance: &Image<3>) -> Result<Image<3>> {
        let size = self.size(radiance.size());
        let picture = picture(radiance, size);
        let (width, height) = (size.0 as usize, size.1 as usize);
        let mut values = vec![0.0_f32; width * height * 3];
        for (pixel, srgb) in picture.pixels().iter().enumerate() {
            for channel in 0..3 {
                let value =
                    (srgb[channel] - self.options.mean[channel]) / self.options.deviation[channel];
                values[self.layout.index((width, height), 3, pixel, channel)] = value;
            }
        }
        let shape = match self.layout {
            Layout::ChannelsFirst => [1, 3, height, width],
            Layout::ChannelsLast => [1, height, width, 3],
        };
        let model = self.options.model.clone();
        let failed = |problem: String| ConvertError::Network {
            path: model.clone(),
            problem,
        };
        let tensor = Tensor::from_array((shape, values)).map_err(|e| self.problem(e))?;
        let outputs = self
            .session
            .run(ort::inputs![self.input.as_str() => tensor])
            .map_err(|error| failed(error.to_string()))?;
        let mut shapes = Vec::new();
        for (_, output) in &outputs {
            let Ok((shape, data)) = output.try_extract_tensor::<f32>() else {
                continue;
            };
            // Some networks add a confidence.
            let found = Layout::of(shape, |channels| channels == 3 || channels == 4);
            if let Some((layout, [rows, columns])) = found {
                return map(layout, [rows, columns], data).ok_or_else(|| {
                    failed(format!(
                        "an output of {shape:?} that is too large or too small"
                    ))
                });
            }
            shapes.push(shape.to_vec());
        }
        Err(failed(format!(
            "no output has three channels; there are {shapes:?}"
        )))
    }
}

/// The library to load: as named, from `EAGPT_ONNXRUNTIME`, or for the dynamic loader to find.
fn library_file(named: Option<&Path>) -> PathBuf {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    let named = named.map(Path::to_owned);
    let named = named.or_else(|| std::env::var_os(LIBRARY_VARIABLE).map(PathBuf::from));
    named.unwrap_or_else(|| format!("{DLL_PREFIX}onnxruntime{DLL_SUFFIX}").into())
}

/// Loads ONNX Runtime from its default location; returns the library's file, as passed to the
/// loader.
///
/// # Errors
/// The reason why it cannot be loaded, and how to name it.
pub fn find_runtime() -> std::result::Result<PathBuf, String> {
    let library = library_file(None);
    environment(&library).map(|_| library)
}

/// The ONNX Runtime environment, one per process: the library named first is kept.
fn environment(library: &Path) -> std::result::Result<Environment, String> {
    static LOADED: Mutex<Option<Environment>> = Mutex::new(None);
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = &*loaded {
        return Ok(environment.clone());
    }
    let builder = ort::init_from(library).map_err(|error| {
        format!(
            "ONNX Runtime cannot be loaded: {error}; --onnxruntime or {LIBRARY_VARIABLE} names its library, which the Python package \
             onnxruntime has in its folder capi"
        )
    })?;
    let environment = builder.build().map_err(|error| error.to_string())?;
    *loaded = Some(environment.clone());
    Ok(environment)
}

/// Input of the network for a view: sRGB values, 0 to 1.
fn picture(radiance: &Image<3>, size: (u32, u32)) -> Image<3> {
    let mut meter = ExposureMeter::default();
    meter.add(radiance);
    let exposure = meter.stops().exp2();
    let srgb = radiance.map(|rgb| rgb.map(|light| srgb_from_linear((exposure * light).min(1.0))));
    if srgb.size() == size {
        return srgb;
    }
    let scale = DVec2::new(
        f64::from(srgb.width()) / f64::from(size.0),
        f64::from(srgb.height()) / f64::from(size.1),
    );
    remap::remap(&srgb, size, |pixel| Some(pixel * scale)).image
}

/// The first three channels of an output.
fn map(layout: Layout, [rows, columns]: [i64; 2], data: &[f32]) -> Option<Image<3>> {
    let side = |side: i64| {
        u32::try_from(side)
            .ok()
            .filter(|side| (1..=MAX_SIDE).contains(side))
    };
    let (width, height) = (side(columns)?, side(rows)?);
    let size = (width as usize, height as usize);
    let num_channels = data.len() / (size.0 * size.1);
    if num_channels < 3 {
        return None;
    }
    let pixels = (0..size.0 * size.1).map(|pixel| {
        [0, 1, 2].map(|channel| data[layout.index(size, num_channels, pixel, channel)])
    });
    Image::from_pixels(width, height, pixels.collect())
}
