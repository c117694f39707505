//! `transforms.json` of nerfstudio and of instant-NGP, and Blender scenes in their form.
//!
//! Poses are camera to world with OpenGL axes in a world with z up, as they stand in the file: an
//! `applied_transform` or `applied_scale` that nerfstudio has put in is kept, so that
//! `ply_file_path` and other data beside the file fit; a note reports it. The transforms that
//! nerfstudio applies in training (recentring, rotation, scaling) are not in the file.
//!
//! | key | becomes |
//! |---|---|
//! | `file_path` | the photograph; without an extension `.exr`, `.png`, `.jpg` are tried |
//! | `mask_path` | pixels to use, black are not: [`eagpt_scene::dataset::VALID_DIR`] |
//! | `depth_file_path` | depth, in units of `--depth-unit` (nerfstudio: millimetres) times `applied_scale` |
//! | `ply_file_path` | the point cloud |
//! | `up_axis`, `metres_per_unit`, `aligned_from_model` | the same: our exports write them |
//! | `train_filenames`, `val_filenames`, `test_filenames` | the dataset's own split |
//!
//! Frames are named by their path below `images/`; our images of that name beside,
//! `Emissive-exr/NAME.exr` and so on, are imported too.
//!
//! A folder with `transforms_train.json`, `transforms_val.json` and `transforms_test.json`, or some
//! of these, is one dataset with that split. Frames are then named by their paths below the folder
//! that all images share, as `train/r_0`. A photograph that several of the files list with the same
//! pose is one frame, in several lists.

use super::{
    Depth, Emission, SourceDataset, SourceFiles, SourceFormat, SourceFrame, if_there, lens,
    points_beside, size_of,
};
use crate::error::{Problem, Result};
use crate::options::ImportOptions;
use eagpt_scene::dataset::intrinsics::{Contradictions, Dialect};
use eagpt_scene::dataset::json::{Object, excerpt};
use eagpt_scene::dataset::{
    ALBEDO_DIR, ALPHA_DIR, CLIPPED_DIR, DEPTH_DIR, DatasetInfo, EMISSION_DIR, NORMAL_DIR,
    TRANSFORMS_FILE, UpAxis, VALID_DIR, pose, strip_image_folder,
};
use eagpt_scene::files;
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

/// Extensions that are tried where a path has none.
const EXTENSIONS: [&str; 4] = ["exr", "png", "jpg", "jpeg"];
/// Files of Blender scenes and the subset that they list.
const SPLIT_FILES: [(&str, Subset); 3] = [
    ("transforms_train.json", Subset::Train),
    ("transforms_val.json", Subset::Validation),
    ("transforms_test.json", Subset::Test),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Subset {
    Train,
    Validation,
    Test,
}

impl Subset {
    fn list(self, info: &mut DatasetInfo) -> &mut Option<Vec<String>> {
        let [train, validation, test] = info.lists_mut();
        match self {
            Self::Train => train,
            Self::Validation => validation,
            Self::Test => test,
        }
    }
}

/// Detects the writer of a `transforms.json` by its keys.
pub(super) fn dialect(path: &Path) -> Result<SourceFormat> {
    let file = file_of(path);
    let value = files::read_json(&file)?;
    let top = Object::root(&file, &value)?;
    let first = top.objects("frames")?[0];
    if first.get("file_name").is_some() {
        return Ok(SourceFormat::Eagpt);
    }
    let is_ngp = top.get("aabb_scale").is_some()
        || (top.get("camera_angle_x").is_some() && top.get("camera_model").is_none());
    Ok(if is_ngp {
        SourceFormat::InstantNgp
    } else {
        SourceFormat::Nerfstudio
    })
}

fn file_of(path: &Path) -> PathBuf {
    if path.is_file() {
        path.to_owned()
    } else {
        path.join(TRANSFORMS_FILE)
    }
}

pub(super) fn read(
    path: &Path,
    format: SourceFormat,
    options: &ImportOptions,
) -> Result<SourceDataset> {
    let file = file_of(path);
    let root = match file.parent() {
        Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
        Some(parent) => parent.to_owned(),
        None => PathBuf::from("."),
    };
    let mut files: Vec<(PathBuf, Option<Subset>)> = SPLIT_FILES
        .iter()
        .map(|(name, subset)| (root.join(name), Some(*subset)))
        .filter(|(path, _)| path.is_file())
        .collect();
    if file.is_file() || files.is_empty() {
        files = vec![(file, None)];
    }
    let mut source = new_source(format, &root, &files[0].0);
    source.more_cameras = files[1..].iter().map(|(path, _)| path.clone()).collect();
    let values: Vec<Value> = files
        .iter()
        .map(|(path, _)| files::read_json(path))
        .collect::<Result<_, _>>()?;
    let mut lists = Vec::new();
    for ((path, subset), value) in files.iter().zip(&values) {
        let top = Object::root(path, value)?;
        if subset.is_some() && top.array("frames")?.is_some_and(<[Value]>::is_empty) {
            let path = path.display();
            source.warnings.push(format!("{path}: frames: none"));
            continue;
        }
        let frames = top.objects("frames")?;
        lists.push(Listed {
            subset: *subset,
            top,
            frames,
        });
    }
    read_lists(&mut source, &lists, options)?;
    Ok(source)
}

fn new_source(format: SourceFormat, root: &Path, file: &Path) -> SourceDataset {
    let mut source = SourceDataset::new(format, root, file.to_owned());
    source.info.up_axis = Some(UpAxis::Z);
    source.points = points_beside(root);
    source
}

/// A file of frames.
struct Listed<'a> {
    /// The subset that all of its frames are in.
    subset: Option<Subset>,
    top: Object<'a>,
    frames: Vec<Object<'a>>,
}

/// Adds the frames of all files, under names that tell them apart.
fn read_lists(
    source: &mut SourceDataset,
    lists: &[Listed<'_>],
    options: &ImportOptions,
) -> Result<()> {
    let root = source.root.clone();
    let all = lists.iter().flat_map(|list| &list.frames);
    let paths: Vec<Option<&str>> = all.map(|o| o.string("file_path").ok()?).collect();
    let names = names(&paths);
    let mut named = paths.iter().zip(&names);
    let mut frames: HashMap<&str, SourceFrame> = HashMap::new();
    let mut contradictions = Contradictions::default();
    let mut num_repeated = 0;
    for Listed {
        subset,
        top,
        frames: objects,
    } in lists
    {
        let depth_unit = options.depth_unit * top.positive("applied_scale")?.unwrap_or(1.0);
        let mut name_by_path = HashMap::new();
        let mut listed = Vec::new();
        for (index, (object, (path, name))) in objects.iter().zip(named.by_ref()).enumerate() {
            let (Some(path), Some(name)) = (path, name) else {
                let value = object.get("file_path").unwrap_or(&Value::Null);
                let names_no_file = format!("{} names no file", excerpt(value));
                let problem = object.invalid("file_path", names_no_file);
                let problem = Problem::new(&format!("frames[{index}]"), problem);
                source.problems.push(problem);
                continue;
            };
            name_by_path.insert(*path, name.as_str());
            listed.push(name.clone());
            let frame = frame(&root, top, object, (path, name), depth_unit);
            if let Ok(frame) = &frame {
                let size = frame.lens.size();
                contradictions.add(Dialect::Nerfstudio, top, object, size)?;
                if frames.get(name.as_str()) == Some(frame) {
                    num_repeated += 1;
                    continue;
                }
                frames.insert(name, frame.clone());
            }
            source.add(name, frame);
        }
        match subset {
            Some(subset) => *subset.list(&mut source.info) = Some(listed),
            None => read_split(source, top, &name_by_path)?,
        }
        read_world(source, top)?;
    }
    let info = &mut source.info;
    let [train, validation, test] = info.lists_mut().map(|list| list.as_ref().map(Vec::len));
    if train.is_some() {
        let [train, validation, test] = [train, validation, test].map(Option::unwrap_or_default);
        source.notes.push(format!(
            "the split of the source is kept as `listed`: {train} views train, {validation} \
             validate, {test} test"
        ));
    }
    if num_repeated > 0 {
        let text = format!("{num_repeated} frames are listed twice, with the same pose: once each");
        source.notes.push(text);
    }
    source.warnings.extend(contradictions.warning());
    Ok(())
}

/// The keys beside the frames; of several files the first that has one counts.
fn read_world(source: &mut SourceDataset, top: &Object<'_>) -> Result<()> {
    let world = DatasetInfo::of_world(top)?;
    if top.path == source.cameras_file {
        source.info.up_axis = world.up_axis.or(source.info.up_axis);
    }
    let info = &mut source.info;
    info.metres_per_unit = info.metres_per_unit.or(world.metres_per_unit);
    info.aligned_from_model = info.aligned_from_model.or(world.aligned_from_model);
    if let Some(relative) = top.string("ply_file_path")? {
        let path = source.root.join(relative);
        if path.is_file() {
            source.points = Some(path);
        } else {
            source.warnings.push(format!(
                "{}: ply_file_path: there is no {}: no point cloud",
                top.path.display(),
                path.display()
            ));
        }
    }
    tell_of_keys(source, top);
    Ok(())
}

fn tell_of_keys(source: &mut SourceDataset, top: &Object<'_>) {
    for key in ["applied_transform", "applied_scale"] {
        if let Some(value) = top.get(key) {
            let text = format!(
                "{key} {}: the world stays that of the file, as its points do",
                excerpt(value)
            );
            if !source.notes.contains(&text) {
                source.notes.push(text);
            }
        }
    }
    if let Some(value) = top.get("fisheye_crop_radius") {
        source.warnings.push(format!(
            "{}: fisheye_crop_radius {}: not applied, --max-fov keeps the image's rim out",
            top.path.display(),
            excerpt(value)
        ));
    }
}

fn frame(
    root: &Path,
    top: &Object<'_>,
    object: &Object<'_>,
    (path, name): (&str, &str),
    depth_unit: f64,
) -> Result<SourceFrame> {
    let radiance = with_extension(&root.join(path));
    let size = size_of(&radiance)?;
    let beside = |key: &str| -> Result<Option<PathBuf>> {
        let Some(relative) = object.string(key)? else {
            return Ok(None);
        };
        let path = root.join(relative);
        match path.is_file() {
            true => Ok(Some(path)),
            false => Err(object
                .invalid(key, format!("there is no {}", path.display()))
                .into()),
        }
    };
    // Keys that our own export writes beside those of nerfstudio.
    let own = |folder: &str| if_there(root.join(folder).join(format!("{name}.exr")));
    let depth = match beside("depth_file_path")? {
        Some(path) => Some(Depth {
            path,
            unit: depth_unit,
        }),
        None => own(DEPTH_DIR).map(|path| Depth { path, unit: 1.0 }),
    };
    Ok(SourceFrame {
        name: name.to_owned(),
        lens: lens::from_json(top, object, size)?,
        world_from_camera: pose::read(object)?,
        files: SourceFiles {
            radiance,
            valid: beside("mask_path")?.or_else(|| own(VALID_DIR)),
            depth,
            emission: own(EMISSION_DIR).map(Emission::Mask),
            normal: own(NORMAL_DIR),
            alpha: own(ALPHA_DIR),
            albedo: own(ALBEDO_DIR),
            clipped: own(CLIPPED_DIR),
        },
    })
}

/// The file of a path that may lack its extension.
fn with_extension(path: &Path) -> PathBuf {
    if path.is_file() || path.extension().is_some() {
        return path.to_owned();
    }
    let candidates = EXTENSIONS.map(|extension| path.with_extension(extension));
    let there = candidates.iter().find_map(|path| if_there(path.clone()));
    there.unwrap_or_else(|| path.with_extension(EXTENSIONS[0]))
}

/// Names of frames: paths within the folder of the images, without extension; `None` if it cannot
/// name a file.
fn names(paths: &[Option<&str>]) -> Vec<Option<String>> {
    let mut names: Vec<Option<String>> = paths.iter().map(|path| stem((*path)?)).collect();
    let mut there: Vec<&mut String> = names.iter_mut().flatten().collect();
    strip_image_folder(&mut there);
    names
}

/// A path without extension; parent components are dropped from names.
fn stem(path: &str) -> Option<String> {
    if path.contains(|c: char| c == '\\' || c.is_control()) || path.ends_with('/') {
        return None;
    }
    let mut parts: Vec<String> = Path::new(path)
        .components()
        .filter_map(|part| match part {
            Component::Normal(part) => Some(part.to_string_lossy().into_owned()),
            _ => None,
        })
        .collect();
    let last = parts.pop()?;
    let stem = Path::new(&last).file_stem()?.to_string_lossy().into_owned();
    parts.push(stem);
    Some(parts.join("/"))
}

/// The lists of a file; names in them are paths, as in `frames`.
fn read_split(
    source: &mut SourceDataset,
    top: &Object<'_>,
    name_by_path: &HashMap<&str, &str>,
) -> Result<()> {
    let mut read = |key: &str| -> Result<Option<Vec<String>>> {
        let Some(listed) = top.array(key)? else {
            return Ok(None);
        };
        let mut names = Vec::with_capacity(listed.len());
        for value in listed {
            match value.as_str().and_then(|path| name_by_path.get(path)) {
                Some(name) => names.push((*name).to_owned()),
                None => source.warnings.push(format!(
                    "{}: {key}: {} is not a frame",
                    top.path.display(),
                    excerpt(value)
                )),
            }
        }
        Ok(Some(names))
    };
    let (train, validation, test) = (
        read("train_filenames")?,
        read("val_filenames")?,
        read("test_filenames")?,
    );
    source.info.train_names = train;
    // Our exports validate on the test views.
    source.info.validation_names = validation.filter(|list| test.as_ref() != Some(list));
    source.info.test_names = test;
    Ok(())
}
