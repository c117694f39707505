//! Arguments of `eagpt colmap import`.

use crate::args;
use crate::command_line;
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use eagpt_colmap::align::{AlignOptions, Anchor, KnownCamera, Manual, Mode, Scale};
use eagpt_colmap::import::{AlignedModel, Depth, ImportOptions, Missing, PointFilter, Srgb8};
use eagpt_colmap::model::PointId;
use eagpt_convert::import::Ldr;
use eagpt_scene::Dataset;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::lens::{Field, Pinhole, UndistortOptions};
use serde::Serialize;
use std::path::PathBuf;

/// Make a dataset of a COLMAP model and linear images
///
/// Reads text and binary models of every version, with all 18 camera models, rigs and frames. Finds
/// the floor without looking at images, from how cameras are held and where points lie, and puts it
/// on z = 0, walls along x and y. Images are undistorted to pinhole cameras in linear light. Images
/// that COLMAP has no pose of are listed.
///
/// --images is what `eagpt ingest` wrote, DIR/Radiance-exr/NAME.exr, or any folder of EXR files;
/// NAME is that of the image in the model, without its extension. Emission masks and opacities in
/// DIR/Emissive-exr and DIR/Alpha-exr come along. Images may be of another size than those COLMAP
/// saw, if they show the same.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = OUTPUTS_AND_EXAMPLES)]
pub(crate) struct ImportArgs {
    /// Folder of the model: cameras, images, points3D, and rigs and frames if there are, .bin or
    /// .txt
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,
    /// Folder of the linear images; without it, cameras and points alone are imported
    #[arg(long, value_name = "DIR")]
    pub(crate) images: Option<PathBuf>,
    /// Folder for the dataset; created
    #[arg(long, value_name = "DATASET")]
    pub(crate) out: PathBuf,
    /// Lightings of one room, DIR/NAME each: a dataset DATASET/NAME is made of each, with the same
    /// poses
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub(crate) conditions: Vec<String>,
    /// Treatment of 8-bit pictures (PNG, JPEG) where there is no EXR; light above their white is
    /// lost
    #[arg(long, value_enum, default_value = "refuse")]
    #[serde(serialize_with = "command_line::value")]
    ldr: Ldr,
    /// Leave registered images without a file out, instead of refusing
    #[arg(long)]
    skip_missing: bool,
    /// Write 32-bit images instead of 16-bit ones
    #[arg(long)]
    float32: bool,
    /// Fewest observations of a point that is kept
    #[arg(long, value_name = "N", default_value_t = PointFilter::default().min_track)]
    min_track: u32,
    /// Largest reprojection error of a point that is kept, pixels, above 0
    #[arg(long, value_name = "PX", default_value_t = PointFilter::default().max_error_px)]
    max_error: f64,
    /// Write the aligned model, rigs and frames included, into DATASET/colmap
    #[arg(long)]
    write_model: bool,
    /// Report what is in the model, how the floor was searched and what was found, but write
    /// nothing
    #[arg(long)]
    pub(super) dry_run: bool,
    /// Replace an earlier import in DATASET
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    #[serde(flatten)]
    align: AlignArgs,
    #[command(flatten)]
    #[serde(flatten)]
    undistort: UndistortArgs,
}

/// The floor.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Alignment options")]
struct AlignArgs {
    /// Method of finding the floor
    #[arg(long, value_enum, default_value = "floor")]
    #[serde(serialize_with = "command_line::value")]
    align: Mode,
    /// Up direction in the model's world; with --align floor it replaces the estimate from the
    /// cameras, with manual a single place of the floor then suffices
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    up: Option<[f64; 3]>,
    /// manual: numbers of points of the model on the floor
    #[arg(long, value_name = "ID,…", value_delimiter = ',')]
    floor_points: Vec<u64>,
    /// manual: a place on the floor in the model's world; may be given often, as for a plane
    /// through four
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    floor_at: Vec<[f64; 3]>,
    /// --align like: dataset with cameras of the same names, whose world the model is moved into; z
    /// has to be up there. --field like: whose pinhole camera images are made for
    #[arg(long, value_name = "DATASET", required_if_eq_any([("align", "like"), ("field", "like")]))]
    like: Option<PathBuf>,
    /// Leave the yaw as it is, do not turn walls to the axes
    #[arg(long)]
    no_walls: bool,
    /// Least confidence of a floor that is accepted, 0 to 1
    #[arg(long, value_name = "C", default_value_t = AlignOptions::default().min_confidence)]
    min_confidence: f64,
    /// Make the scene metric by a known distance: two images of the model or points of it, as
    /// point:17, and metres
    #[arg(long, value_name = "FROM,TO,METRES", value_parser = known_distance, conflicts_with = "camera_height")]
    #[serde(serialize_with = "command_line::optional_text")]
    known_distance: Option<Scale>,
    /// Make the scene metric by the median height of the cameras above the floor, metres
    #[arg(long, value_name = "METRES")]
    camera_height: Option<f64>,
    /// Seed of the search for planes, 0 to 2^63 − 1
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = args::seed())]
    seed: u64,
}

/// The pinhole cameras.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Undistortion options")]
struct UndistortArgs {
    /// Part of the lens images that the pinhole images show
    #[arg(long, value_enum, default_value = "inside")]
    field: FieldArg,
    /// Largest angle of view of a pinhole image, degrees, above 0 to 170
    #[arg(long, value_name = "DEGREES", default_value_t = UndistortOptions::default().max_fov_deg)]
    max_fov: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum FieldArg {
    /// A rectangle in which every pixel is known
    Inside,
    /// Everything; pixels the lens does not show are 0, and 0 in Valid-exr: training leaves them
    /// out
    All,
    /// As many pixels as the image has, with its principal point; unknown ones as with `all`
    Same,
    /// The view and size of the cameras of --like, which must be the same but for their poses;
    /// unknown pixels as with `all`
    Like,
}

const OUTPUTS_AND_EXAMPLES: &str = "Files in DATASET (of several conditions in DATASET/NAME):
  transforms.json  cameras, up axis, scale, aligned_from_model: the transform from the model's world
  points3d.ply     points, coloured
  Radiance-exr/    images, undistorted
  import.json      what was found: floor, confidence, cameras, unregistered images
  record.json      version, options, inputs, times, memory

Examples:
  eagpt colmap import sparse/0 --images capture --out kitchen
  eagpt colmap import sparse/0 --images capture --out lecture --conditions day,lamp-a,lamp-b --camera-height 1.55
  eagpt colmap import sparse/0 --images capture --out kitchen --dry-run
  eagpt colmap import sparse/0 --images capture --out kitchen --align manual --floor-points 17,230,1044
  eagpt colmap import sparse/0 --images capture --out kitchen --up 0,-1,0 --known-distance a.jpg,b.jpg,1.2";

fn position(text: &str) -> Result<[f64; 3], String> {
    args::numbers(text).ok_or_else(|| format!("`{text}` is not X,Y,Z"))
}

fn known_distance(text: &str) -> Result<Scale, String> {
    let [from, to, metres] = <[&str; 3]>::try_from(text.split(',').collect::<Vec<_>>())
        .map_err(|_| format!("`{text}` is not FROM,TO,METRES"))?;
    Ok(Scale::Distance {
        from: from.parse::<Anchor>()?,
        to: to.parse::<Anchor>()?,
        metres: metres
            .parse()
            .map_err(|_| format!("`{metres}` is no number of metres"))?,
    })
}

impl ImportArgs {
    pub(super) fn options(&self) -> Result<ImportOptions> {
        let align = &self.align;
        let camera_height = align
            .camera_height
            .map(|metres| Scale::CameraHeight { metres });
        Ok(ImportOptions {
            images: self.images.clone(),
            conditions: self.conditions.clone(),
            srgb8: match self.ldr {
                Ldr::Refuse => Srgb8::Refuse,
                Ldr::Srgb => Srgb8::Decode,
            },
            missing: if self.skip_missing {
                Missing::Skip
            } else {
                Missing::Refuse
            },
            points: PointFilter {
                min_track: self.min_track,
                max_error_px: self.max_error,
            },
            undistort: UndistortOptions {
                pinhole: self.known_pinhole()?,
                field: match self.undistort.field {
                    FieldArg::Inside | FieldArg::Like => Field::Inside,
                    FieldArg::All => Field::All,
                    FieldArg::Same => Field::Same,
                },
                max_fov_deg: self.undistort.max_fov,
            },
            align: AlignOptions {
                mode: align.align,
                manual: Manual {
                    up: align.up,
                    floor_points: align.floor_points.iter().copied().map(PointId).collect(),
                    floor_positions: align.floor_at.clone(),
                },
                known_cameras: self.known_cameras()?,
                scale: align.known_distance.clone().or(camera_height),
                walls: !align.no_walls,
                min_confidence: align.min_confidence,
                seed: align.seed,
                ..AlignOptions::default()
            },
            aligned_model: if self.write_model {
                AlignedModel::Write
            } else {
                AlignedModel::Leave
            },
            precision: if self.float32 {
                Depth::Float
            } else {
                Depth::Half
            },
        })
    }

    /// Cameras of the dataset to be like.
    fn known_cameras(&self) -> Result<Vec<KnownCamera>> {
        if self.align.align != Mode::Reference {
            return Ok(Vec::new());
        }
        let dataset = self.like()?;
        if dataset.up() != UpAxis::Z {
            bail!(
                "{}: up_axis: {}, must be z",
                dataset.transforms().display(),
                dataset.up()
            );
        }
        let known = dataset.frames().iter().map(|frame| KnownCamera {
            name: frame.name.clone(),
            centre: frame.camera.world_from_camera.translation.to_array(),
        });
        Ok(known.collect())
    }

    /// The camera of the dataset to be like.
    fn known_pinhole(&self) -> Result<Option<Pinhole>> {
        if self.undistort.field != FieldArg::Like {
            return Ok(None);
        }
        let dataset = self.like()?;
        let mut pinholes = dataset.frames().iter().map(|f| Pinhole::of(&f.camera));
        let first = pinholes.next();
        if pinholes.any(|other| Some(other) != first) {
            bail!(
                "{}: frames: cameras differ by more than their poses, --field like needs one for all",
                dataset.transforms().display()
            );
        }
        Ok(first)
    }

    fn like(&self) -> Result<Dataset> {
        match &self.align.like {
            Some(path) => Ok(Dataset::open_cameras(path)?),
            None => bail!("--like: a dataset is missing, which `like` is to be like"),
        }
    }
}
