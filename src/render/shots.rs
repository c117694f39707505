//! Views to render: those of a dataset, or the frames of a camera path.

use super::RenderArgs;
use crate::args;
use crate::record::SplitRecord;
use anyhow::{Result, bail};
use clap::Args;
use eagpt_render::Shot;
use eagpt_scene::camera_path::PathOverrides;
use eagpt_scene::dataset::{self, DatasetInfo, SplitRule, Subset, TRANSFORMS_FILE};
use eagpt_scene::{CameraPath, Dataset, Shard};
use serde::Serialize;
use std::path::Path;

/// Arguments that choose views, and exclude all of a path: clap asks for no path where one of them
/// excludes it.
const OF_VIEWS: [&str; 3] = ["split", "split_rule", "views"];

/// Frames along a path instead of views.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Camera path")]
pub(super) struct PathArgs {
    /// Path of a camera instead of views: fly:A,B,… through views (A again at the end closes it),
    /// turntable, a TOML file, or a camera_path.json of nerfstudio
    #[arg(long, value_name = "PATH", conflicts_with_all = OF_VIEWS)]
    pub(super) camera_path: Option<String>,
    /// Number of frames [default: what the path says, else 120]
    #[arg(long, value_name = "N", requires = "camera_path", conflicts_with_all = OF_VIEWS)]
    pub(super) frames: Option<u32>,
    /// Width and height of the frames, as 960x540; the vertical field of view stays
    #[arg(long, value_name = "WxH", requires = "camera_path", conflicts_with_all = OF_VIEWS, value_parser = args::size(1..=u32::MAX))]
    pub(super) size: Option<[u32; 2]>,
    /// Write EXRs of the frames as well
    #[arg(long, requires = "camera_path", conflicts_with_all = OF_VIEWS)]
    pub(super) exr: bool,
}

/// All pictures to render, and where they come from.
pub(super) struct Shots {
    pub(super) list: Vec<Shot>,
    /// Selection of the views of the dataset.
    pub(super) split: Option<SplitRecord>,
    /// The path whose frames they are.
    pub(super) path: Option<CameraPath>,
}

/// A camera path with the camera of every frame, for the record: axes and units as in memory.
#[derive(Serialize)]
pub(super) struct PathRecord<'a> {
    #[serde(flatten)]
    path: &'a CameraPath,
    frames: &'a [Shot],
}

impl Shots {
    /// Chooses views or works out a path.
    ///
    /// # Errors
    /// If a view is not there, a subset is empty, or the path cannot be.
    pub(super) fn choose(
        args: &RenderArgs,
        dataset: &Dataset,
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let Some(argument) = &args.path.camera_path else {
            let (indices, split) = views(args, dataset, warnings)?;
            let frames = indices.iter().map(|&i| &dataset.frames()[i]);
            let list = frames.map(|frame| Shot {
                name: frame.name.clone(),
                camera: frame.camera,
                seed: args.seed,
            });
            return Ok(Self {
                list: list.collect(),
                split: Some(split),
                path: None,
            });
        };
        let overrides = PathOverrides {
            num_frames: args.path.frames,
            size: args.path.size.map(Into::into),
        };
        let path = CameraPath::read(argument, dataset, &overrides)?;
        let list = path.cameras.iter().enumerate().map(|(i, camera)| Shot {
            name: format!("frame_{i:04}"),
            camera: *camera,
            // With one seed for all, noise would stick to the screen.
            seed: args.seed.wrapping_add(i as u64),
        });
        Ok(Self {
            list: list.collect(),
            split: None,
            path: Some(path),
        })
    }

    /// The pictures of a shard.
    pub(super) fn of_shard(&self, shard: Shard) -> impl Iterator<Item = &Shot> {
        let mine = self.list.iter().enumerate();
        mine.filter(move |(place, _)| shard.has(*place))
            .map(|(_, shot)| shot)
    }

    /// The path for the record, if there is one.
    pub(super) fn path_record(&self) -> Option<PathRecord<'_>> {
        let path = self.path.as_ref()?;
        Some(PathRecord {
            path,
            frames: &self.list,
        })
    }

    /// Writes the cameras of the frames of a path, as a dataset has them.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn write_cameras(&self, dir: &Path, dataset: &Dataset) -> Result<()> {
        if self.path.is_none() {
            return Ok(());
        }
        let cameras = self.list.iter();
        let cameras: Vec<_> = cameras
            .map(|shot| (shot.name.clone(), shot.camera))
            .collect();
        let info = DatasetInfo {
            up_axis: dataset.up_axis(),
            metres_per_unit: dataset.metres_per_unit(),
            ..DatasetInfo::default()
        };
        dataset::write_transforms(&dir.join(TRANSFORMS_FILE), &cameras, &info)?;
        Ok(())
    }

    /// The command that makes a video of the frames in `dir`.
    pub(super) fn video_command(&self, dir: &Path) -> Option<String> {
        let path = self.path.as_ref()?;
        // Players want 4:2:0, which has even sizes only.
        let (width, height) = path.size();
        let pad = if width % 2 + height % 2 > 0 {
            " -vf pad=ceil(iw/2)*2:ceil(ih/2)*2"
        } else {
            ""
        };
        let dir = dir.display();
        Some(format!(
            "ffmpeg -framerate {} -i {dir}/frame_%04d.png{pad} -c:v libx264 -crf 18 -pix_fmt yuv420p {dir}.mp4",
            path.fps
        ))
    }
}

/// Indices of the views to render, and how they were chosen.
fn views(
    args: &RenderArgs,
    dataset: &Dataset,
    warnings: &mut Vec<String>,
) -> Result<(Vec<usize>, SplitRecord)> {
    let frames = dataset.frames();
    let everything = args.split == Subset::All
        && matches!(args.split_rule, SplitRule::Every8th | SplitRule::All);
    if args.views.is_empty() && everything {
        // No rule is needed, and none may fail, as every-8th does on a single camera.
        let record = unruled(Some(Subset::All), frames.len());
        return Ok(((0..frames.len()).collect(), record));
    }
    if args.views.is_empty() {
        let split = dataset.split(args.split_rule)?;
        warnings.extend(split.warnings.iter().cloned());
        let record = SplitRecord::new(&split, args.split);
        return Ok((split.indices(args.split).to_vec(), record));
    }
    let mut chosen = Vec::with_capacity(args.views.len());
    for name in &args.views {
        let Some(index) = frames.iter().position(|frame| frame.name == *name) else {
            bail!(
                "{}: --views: {}",
                dataset.transforms().display(),
                dataset.no_such_view(name)
            );
        };
        chosen.push(index);
    }
    let record = unruled(None, chosen.len());
    Ok((chosen, record))
}

fn unruled(subset: Option<Subset>, num_views: usize) -> SplitRecord {
    SplitRecord {
        subset,
        num_views,
        ..SplitRecord::default()
    }
}
