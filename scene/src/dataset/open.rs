//! Opening a dataset: from `transforms.json` to frames whose images are there.

use super::frame::{
    ALBEDO_DIR, ALPHA_DIR, BadFrame, CLIPPED_DIR, DEPTH_DIR, EMISSION_DIR, Frame, NORMAL_DIR,
    POINTS_FILE, RADIANCE_DIR, ROUGHNESS_DIR, SPECULAR_DIR, TRANSFORMS_FILE, VALID_DIR, ViewFiles,
};
use super::info::DatasetInfo;
use super::intrinsics::{self, Contradictions, Dialect};
use super::json::Object;
use super::names::{is_frame_name, strip_image_folder};
use super::split::ListedSplit;
use super::{Dataset, pose};
use crate::error::{Result, SceneError};
use crate::exr;
use crate::files;
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};

/// Paths of the images of a frame, before they are checked.
struct Located {
    /// Name of the frame in the file and its split lists.
    listed_as: String,
    name: String,
    radiance: PathBuf,
}

/// Whether the radiance images have to be there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Images {
    /// Yes.
    Needed,
    /// No, if the file states their size.
    IfThere,
}

impl Dataset {
    /// Opens a dataset: a folder with a `transforms.json`, or that file itself (of any name).
    ///
    /// Checks all poses and intrinsics and reads the header of every radiance image, but no pixels.
    ///
    /// # Errors
    /// [`SceneError`] naming the file, the field as in `frames[3].transform_matrix`, and the value.
    pub fn open(root: &Path) -> Result<Self> {
        read(root, Images::Needed, |bad| Err(bad.error))
    }

    /// As [`Self::open`] where only the cameras are needed: an image that is not there will do if
    /// the file states `w` and `h`. [`Self::load_view`] fails for such a frame.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_cameras(root: &Path) -> Result<Self> {
        read(root, Images::IfThere, |bad| Err(bad.error))
    }

    /// As [`Self::open`] for a list of all problems: frames that cannot be used are
    /// left out, and why is told of each.
    ///
    /// # Errors
    /// As [`Self::open`] for what is wrong with the file as a whole, and if no frame is left.
    pub fn survey(root: &Path) -> Result<(Self, Vec<BadFrame>)> {
        let mut all_bad = Vec::new();
        let dataset = read(root, Images::Needed, |bad| {
            all_bad.push(bad);
            Ok(())
        })?;
        match all_bad.is_empty() || !dataset.is_empty() {
            true => Ok((dataset, all_bad)),
            false => Err(all_bad.swap_remove(0).error),
        }
    }
}

/// The dataset of the frames that can be used; `on_bad` decides about the others.
fn read(
    path: &Path,
    images: Images,
    mut on_bad: impl FnMut(BadFrame) -> Result<()>,
) -> Result<Dataset> {
    if !path.exists() {
        return Err(SceneError::no_folder(path));
    }
    if path.is_dir() && !path.join(TRANSFORMS_FILE).is_file() {
        let problem = "missing: not a dataset of ours; `eagpt dataset import` makes one of others";
        return Err(SceneError::invalid(path, TRANSFORMS_FILE, problem));
    }
    let transforms = if path.is_dir() {
        path.join(TRANSFORMS_FILE)
    } else {
        path.to_owned()
    };
    let root = match transforms.parent() {
        Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
        Some(parent) => parent.to_owned(),
        None => PathBuf::from("."),
    };
    let value: Value = files::read_json(&transforms)?;
    let top = Object::root(&transforms, &value)?;
    let objects = top.objects("frames")?;
    let (dialect, located) = locate(&root, &objects)?;
    check_unique(&objects, &located)?;
    let mut frames = Vec::with_capacity(objects.len());
    // Of frames that cannot be used: what the lists of the file call them.
    let mut left_out = HashSet::new();
    // Names, in the lists of the file, of the frames that can be used.
    let mut listed_names = Vec::with_capacity(objects.len());
    let mut contradictions = Contradictions::default();
    for (object, located) in objects.iter().zip(&located) {
        let frame = image_size(images, dialect, &top, object, located)
            .and_then(|size| frame(&root, dialect, &top, object, located, size));
        match frame {
            Ok(frame) => {
                let size = (frame.camera.width, frame.camera.height);
                contradictions.add(dialect, &top, object, size)?;
                listed_names.push(located.listed_as.as_str());
                frames.push(frame);
            }
            Err(error) => {
                left_out.insert(located.listed_as.as_str());
                on_bad(BadFrame {
                    name: located.name.clone(),
                    error,
                })?;
            }
        }
    }
    warn_of_ignored_keys(&top, &objects);
    if let Some(warning) = contradictions.warning() {
        tracing::warn!("{warning}");
    }
    let world = DatasetInfo::of_world(&top)?;
    Ok(Dataset {
        up_axis: world.up_axis,
        metres_per_unit: world.metres_per_unit,
        aligned_from_model: world.aligned_from_model,
        listed: ListedSplit::read(&top, &listed_names, &left_out)?,
        points: points(&top, &root)?,
        frames,
        root,
        transforms: transforms.clone(),
    })
}

fn locate(root: &Path, objects: &[Object<'_>]) -> Result<(Dialect, Vec<Located>)> {
    if objects[0].get("file_name").is_some() {
        let located = objects.iter().map(|object| locate_eag_pt(root, object));
        return Ok((Dialect::EagPt, located.collect::<Result<_>>()?));
    }
    if objects[0].get("file_path").is_none() {
        let problem = "missing, and so is file_path: one of them names the image";
        return Err(objects[0].invalid("file_name", problem));
    }
    let mut located = objects
        .iter()
        .map(|object| locate_nerfstudio(root, object))
        .collect::<Result<Vec<_>>>()?;
    let mut names: Vec<&mut String> = located.iter_mut().map(|item| &mut item.name).collect();
    strip_image_folder(&mut names);
    Ok((Dialect::Nerfstudio, located))
}

fn locate_eag_pt(root: &Path, object: &Object<'_>) -> Result<Located> {
    let key = "file_name";
    let name = object.need(key, object.string(key)?)?;
    if !is_frame_name(name) {
        let problem = format!("`{}` is not a relative name", name.escape_debug());
        return Err(object.invalid(key, problem));
    }
    Ok(Located {
        listed_as: name.to_owned(),
        name: name.to_owned(),
        radiance: root.join(RADIANCE_DIR).join(format!("{name}.exr")),
    })
}

fn locate_nerfstudio(root: &Path, object: &Object<'_>) -> Result<Located> {
    let key = "file_path";
    let listed_as = object.need(key, object.string(key)?)?;
    let relative = Path::new(listed_as);
    let radiance = match relative.extension() {
        None => relative.with_extension("exr"),
        Some(extension) if extension.eq_ignore_ascii_case("exr") => relative.to_owned(),
        Some(_) => {
            let problem = format!("`{}`: linear EXR is needed", listed_as.escape_debug());
            return Err(object.unsupported(key, problem));
        }
    };
    let stem = radiance.with_extension("");
    let parts = stem.components().filter_map(|part| match part {
        Component::Normal(part) => Some(part.to_string_lossy()),
        _ => None,
    });
    let name = parts.collect::<Vec<_>>().join("/");
    if relative.file_name().is_none() || !is_frame_name(&name) {
        let problem = format!("`{}` names no file", listed_as.escape_debug());
        return Err(object.invalid(key, problem));
    }
    Ok(Located {
        listed_as: listed_as.to_owned(),
        name,
        radiance: root.join(&radiance),
    })
}

fn check_unique(objects: &[Object<'_>], located: &[Located]) -> Result<()> {
    let mut first_by_name = HashMap::new();
    for (index, item) in located.iter().enumerate() {
        if let Some(first) = first_by_name.insert(item.name.as_str(), index) {
            let key = if objects[index].get("file_name").is_some() {
                "file_name"
            } else {
                "file_path"
            };
            let problem = format!("`{}` is also frames[{first}]", item.name.escape_debug());
            return Err(objects[index].invalid(key, problem));
        }
    }
    Ok(())
}

/// The size of a frame's image: that of the file or, where it is not needed, the one stated.
fn image_size(
    images: Images,
    dialect: Dialect,
    top: &Object<'_>,
    object: &Object<'_>,
    located: &Located,
) -> Result<(u32, u32)> {
    if located.radiance.is_file() {
        return exr::read_size(&located.radiance);
    }
    let stated = |key| Ok(object.pixels(key)?.or(top.pixels(key)?));
    if images == Images::IfThere
        && let (Some(width), Some(height)) = (stated("w")?, stated("h")?)
    {
        return Ok((width, height));
    }
    let key = match dialect {
        Dialect::EagPt => "file_name",
        Dialect::Nerfstudio => "file_path",
    };
    let problem = match images {
        Images::Needed => format!("no image {}", located.radiance.display()),
        Images::IfThere => format!(
            "no image {}, and no w and h instead",
            located.radiance.display()
        ),
    };
    Err(object.invalid(key, problem))
}

fn frame(
    root: &Path,
    dialect: Dialect,
    top: &Object<'_>,
    object: &Object<'_>,
    located: &Located,
    size: (u32, u32),
) -> Result<Frame> {
    let world_from_camera = pose::read(object)?;
    let camera = intrinsics::camera(dialect, top, object, size, world_from_camera)?;
    let beside = |folder: &str| {
        let path = root.join(folder).join(format!("{}.exr", located.name));
        path.is_file().then_some(path)
    };
    Ok(Frame {
        name: located.name.clone(),
        camera,
        files: ViewFiles {
            radiance: located.radiance.clone(),
            emission: beside(EMISSION_DIR),
            normal: beside(NORMAL_DIR),
            alpha: beside(ALPHA_DIR),
            depth: beside(DEPTH_DIR),
            albedo: beside(ALBEDO_DIR),
            specular: beside(SPECULAR_DIR),
            roughness: beside(ROUGHNESS_DIR),
            clipped: beside(CLIPPED_DIR),
            valid: beside(VALID_DIR),
        },
    })
}

fn points(top: &Object<'_>, root: &Path) -> Result<Option<PathBuf>> {
    let key = "ply_file_path";
    if let Some(relative) = top.string(key)? {
        let path = root.join(relative);
        if !path.is_file() {
            return Err(top.invalid(key, format!("no file {}", path.display())));
        }
        return Ok(Some(path));
    }
    let path = root.join(POINTS_FILE);
    Ok(path.is_file().then_some(path))
}

fn warn_of_ignored_keys(top: &Object<'_>, objects: &[Object<'_>]) {
    for (key, instead) in [
        ("mask_path", "every pixel is used"),
        ("depth_file_path", "depth is read from Depth-exr only"),
    ] {
        let num_frames = objects.iter().filter(|o| o.get(key).is_some()).count();
        if num_frames > 0 {
            tracing::warn!(
                "{}: {key} of {num_frames} frames is ignored: {instead}",
                top.path.display()
            );
        }
    }
}
