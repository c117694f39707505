//! Scenes of Eyeful Tower (VR-NeRF, SIGGRAPH Asia 2023).
//!
//! `cameras.json` has an entry in `KRT` for each photograph: K (3×3) and T (4×4, world to camera,
//! OpenCV axes), both column by column, for `width` × `height` pixels, far more than the images
//! have: K is scaled along each axis on its own. Distortion is OpenCV's:
//!
//! | `distortionModel` | `distortion` | lens |
//! |---|---|---|
//! | `RadialAndTangential` (rig 2) | k1, k2, p1, p2, k3 | perspective |
//! | `Fisheye` (rig 1) | k1, k2, k3, –, –, –, p1, p2 | equidistant |
//!
//! Images are `images-2k/CAMERA/CAMERA_DSC0001.exr` or those of `images-1k`: linear DCI-P3 without
//! white balance, see [`crate::color`]. The JPEGs of `images-jpeg*` are balanced and clipped
//! already. The cameras of the rigs each have their own entry: a rig's rigidity is not used. The
//! world is y up, the floor at 0, in metres. `splits.json` lists what to train on and to test.

use super::{
    SourceDataset, SourceFiles, SourceFormat, SourceFrame, if_there, points_beside, size_of,
};
use crate::color::Primaries;
use crate::error::{ConvertError, Result};
use crate::options::{ImportOptions, Ldr};
use crate::world::from_camera_from_world;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::dataset::json::{Object, excerpt};
use eagpt_scene::lens::LensModel;
use eagpt_scene::{Lens, files};
use std::path::{Path, PathBuf};

/// Poses and intrinsics.
pub(crate) const CAMERAS_FILE: &str = "cameras.json";
const SPLITS_FILE: &str = "splits.json";
const LIST: &str = "KRT";
/// Folders of images with their extension, the preferred ones first.
const FOLDERS: [(&str, &str); 6] = [
    ("images-2k", "exr"),
    ("images-1k", "exr"),
    ("images-jpeg-2k", "jpg"),
    ("images-jpeg-1k", "jpg"),
    ("images-jpeg-4k", "jpg"),
    ("images-jpeg", "jpg"),
];
/// Ending of the file named after the scene.
const REPORT: &str = "-final.pdf";
/// White balance of the scenes, factors of R, G, B from a colour chart: the README of the dataset,
/// and for the two rooms of the Real Acoustic Fields dataset, taken with the same rig, its own.
const WHITE_BALANCE: [(&str, [f64; 3]); 13] = [
    ("apartment", [0.726097, 1.0, 1.741252]),
    ("kitchen", [0.628143, 1.0, 2.212346]),
    ("office1a", [0.740846, 1.0, 1.750224]),
    ("office1b", [0.725535, 1.0, 1.839938]),
    ("office2", [0.707729, 1.0, 1.747833]),
    ("office_view1", [1.029089, 1.0, 1.145235]),
    ("office_view2", [0.939620, 1.0, 1.273549]),
    ("riverview", [1.077719, 1.0, 1.145992]),
    ("seating_area", [0.616093, 1.0, 2.426888]),
    ("table", [0.653298, 1.0, 2.139514]),
    ("workshop", [0.709929, 1.0, 1.797705]),
    ("raf_emptyroom", [0.718776, 1.0, 1.787020]),
    ("raf_furnishedroom", [0.721494, 1.0, 1.793423]),
];

pub(super) fn read(root: &Path, options: &ImportOptions) -> Result<SourceDataset> {
    let cameras_file = root.join(CAMERAS_FILE);
    let value = files::read_json(&cameras_file)?;
    let top = Object::root(&cameras_file, &value)?;
    let entries = top.objects(LIST)?;
    let (folder, extension) = image_folder(root, options)?;
    let is_linear = extension == "exr";
    let mut source = SourceDataset::new(SourceFormat::Eyeful, root, cameras_file.clone());
    source.info.up_axis = Some(UpAxis::Y);
    source.info.metres_per_unit = Some(1.0);
    source.points = points_beside(root);
    source.color.primaries = Primaries::P3D65;
    if is_linear && options.white_balance.is_none() {
        let (scene, gains) = white_balance(root, options)?;
        source.color.gains = gains;
        source
            .notes
            .push(format!("white balance of the scene {scene}: {gains:?}"));
    }
    let mut missing: Vec<String> = Vec::new();
    for entry in &entries {
        let name = match name(entry) {
            Ok(name) => name,
            Err(error) => {
                source.add(&entry.field("cameraId"), Err(error));
                continue;
            }
        };
        let image = folder.join(format!("{name}.{extension}"));
        // The dataset lacks blurred images and those that show the operator.
        if !image.is_file() {
            missing.push(name.to_owned());
            continue;
        }
        let frame = frame(entry, name, image);
        source.add(name, frame);
    }
    if source.num_frames() == 0 {
        let problem = format!(
            "none of its {} images is in {}",
            missing.len(),
            folder.display()
        );
        return Err(ConvertError::invalid(&cameras_file, LIST, problem));
    }
    if let Some(first) = missing.first() {
        source.warnings.push(format!(
            "{} of {} cameras have no image in {}, {first} for one",
            missing.len(),
            entries.len(),
            folder.display()
        ));
    }
    read_split(&mut source, root, &missing)?;
    source.notes.push(format!("images of {}", folder.display()));
    Ok(source)
}

/// The folder of images and their extension: the one named, or the first that is there.
fn image_folder(root: &Path, options: &ImportOptions) -> Result<(PathBuf, &'static str)> {
    let is_wanted = |(name, extension): &&(&str, &str)| match &options.images {
        Some(images) => images == name,
        None => *extension == "exr" || options.ldr == Ldr::Srgb,
    };
    let mut expected = FOLDERS.iter().filter(is_wanted).peekable();
    if expected.peek().is_none() {
        let names = FOLDERS.map(|(name, _)| name).join(", ");
        let given = options.images.as_deref().unwrap_or_default();
        let problem = format!("`{}` is none of {names}", given.escape_debug());
        return Err(ConvertError::option("images", problem));
    }
    let tried: Vec<&str> = expected.clone().map(|(name, _)| *name).collect();
    let found = expected.find(|(name, _)| root.join(name).is_dir());
    let (name, extension) = found.ok_or_else(|| {
        let problem = format!("there is none of {}", tried.join(", "));
        ConvertError::invalid(root, "images", problem)
    })?;
    Ok((root.join(name), extension))
}

/// The scene and its gains.
fn white_balance(root: &Path, options: &ImportOptions) -> Result<(String, [f64; 3])> {
    let scene = match &options.scene {
        Some(scene) => Some(scene.clone()),
        None => scene_name(root)?,
    };
    let found = WHITE_BALANCE
        .iter()
        .find(|(name, _)| Some(*name) == scene.as_deref());
    match (found, scene) {
        (Some((name, gains)), _) => Ok(((*name).to_owned(), *gains)),
        (None, scene) => {
            let names = WHITE_BALANCE.map(|(name, _)| name).join(", ");
            let what = scene.map_or_else(
                || "the folder does not tell which scene it is".to_owned(),
                |scene| {
                    format!(
                        "`{}` is a scene without known white balance",
                        scene.escape_debug()
                    )
                },
            );
            let problem =
                format!("{what}; --white-balance R,G,B gives it, --scene names one of {names}");
            Err(ConvertError::invalid(root, "white balance", problem))
        }
    }
}

/// The scene that a folder has: the name of its reconstruction report, or else the full name of the
/// folder.
fn scene_name(root: &Path) -> Result<Option<String>> {
    let report = files::list(root)?.iter().find_map(|path| {
        let name = path.file_name()?.to_str()?;
        name.strip_suffix(REPORT).map(str::to_owned)
    });
    let folder = || {
        let whole = root.canonicalize().ok()?;
        Some(whole.file_name()?.to_str()?.to_owned())
    };
    Ok(report.or_else(folder))
}

fn name<'a>(entry: &Object<'a>) -> Result<&'a str> {
    let key = "cameraId";
    let name = entry.need(key, entry.string(key)?)?;
    if !eagpt_scene::dataset::is_frame_name(name) {
        let problem = format!("`{}` is not a relative name", name.escape_debug());
        return Err(entry.invalid(key, problem).into());
    }
    Ok(name)
}

fn frame(entry: &Object<'_>, name: &str, radiance: PathBuf) -> Result<SourceFrame> {
    let need = |key: &str| entry.need(key, entry.pixels(key)?);
    let full_size = (need("width")?, need("height")?);
    let size = size_of(&radiance)?;
    let lens = lens(entry, full_size)?.resized(size);
    let lens = lens.map_err(|problem| entry.invalid("K", problem))?;
    let columns = matrix::<4>(entry, "T")?;
    let world_from_camera =
        from_camera_from_world(&columns).map_err(|problem| entry.invalid("T", problem))?;
    Ok(SourceFrame {
        name: name.to_owned(),
        lens,
        world_from_camera,
        files: SourceFiles {
            radiance,
            ..SourceFiles::default()
        },
    })
}

/// The lens of an entry for its full size.
fn lens(entry: &Object<'_>, size: (u32, u32)) -> Result<Lens> {
    // Columns: k[2] is the principal point.
    let k = matrix::<3>(entry, "K")?;
    if k[1][0] != 0.0 || k[0][1] != 0.0 || [k[0][2], k[1][2], k[2][2]] != [0.0, 0.0, 1.0] {
        let problem = format!("columns {k:?}: not [fx, 0, 0], [0, fy, 0], [cx, cy, 1]");
        return Err(entry.invalid("K", problem).into());
    }
    let mut params = vec![k[0][0], k[1][1], k[2][0], k[2][1]];
    let key = "distortionModel";
    let kind = entry.need(key, entry.string(key)?)?;
    let given = coefficients(entry)?;
    let model = match (kind, given.as_slice()) {
        ("RadialAndTangential", &[k1, k2, p1, p2, k3]) => {
            params.extend([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]);
            LensModel::FullOpenCv
        }
        ("Fisheye", &[k1, k2, k3, _, _, _, p1, p2]) => {
            params.extend([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]);
            LensModel::ThinPrismFisheye
        }
        ("RadialAndTangential" | "Fisheye", _) => {
            let problem = format!(
                "{} numbers, but {kind} has 5 (rig 2) or 8 (fisheye)",
                given.len()
            );
            return Err(entry.invalid("distortion", problem).into());
        }
        _ => {
            let problem = format!(
                "`{}`: RadialAndTangential and Fisheye are read",
                kind.escape_debug()
            );
            return Err(entry.unsupported(key, problem).into());
        }
    };
    let lens = Lens::new(model, size, &params);
    lens.map_err(|problem| entry.invalid("K", problem).into())
}

fn coefficients(entry: &Object<'_>) -> Result<Vec<f64>> {
    let key = "distortion";
    let values = entry.need(key, entry.array(key)?)?;
    // Unused slots may hold anything, including null.
    let numbers = values
        .iter()
        .map(|value| value.as_f64().or(value.is_null().then_some(0.0)));
    let numbers: Option<Vec<f64>> = numbers.collect();
    let finite = numbers.filter(|numbers| numbers.iter().all(|n| n.is_finite()));
    finite.ok_or_else(|| entry.invalid(key, "not finite numbers").into())
}

/// A square matrix as a list of its columns.
fn matrix<const N: usize>(entry: &Object<'_>, key: &str) -> Result<[[f64; N]; N]> {
    let columns = entry.need(key, entry.array(key)?)?;
    let mut matrix = [[0.0; N]; N];
    let column = |value: &serde_json::Value| -> Option<[f64; N]> {
        let numbers: Option<Vec<f64>> = value
            .as_array()?
            .iter()
            .map(serde_json::Value::as_f64)
            .collect();
        let numbers = <[f64; N]>::try_from(numbers?.as_slice()).ok()?;
        numbers.iter().all(|n| n.is_finite()).then_some(numbers)
    };
    if columns.len() != N {
        return Err(entry
            .invalid(key, format!("{} columns, not {N}", columns.len()))
            .into());
    }
    for (at, (own, value)) in matrix.iter_mut().zip(columns).enumerate() {
        *own = column(value).ok_or_else(|| {
            let problem = format!("column {at} is {}, not {N} finite numbers", excerpt(value));
            entry.invalid(key, problem)
        })?;
    }
    Ok(matrix)
}

/// The lists of `splits.json`; missing images have been reported already.
fn read_split(source: &mut SourceDataset, root: &Path, missing: &[String]) -> Result<()> {
    let Some(path) = if_there(root.join(SPLITS_FILE)) else {
        let text = format!("there is no {SPLITS_FILE}: no split of its own");
        source.warnings.push(text);
        return Ok(());
    };
    let value = files::read_json(&path)?;
    let top = Object::root(&path, &value)?;
    let missing: std::collections::HashSet<&str> = missing.iter().map(String::as_str).collect();
    let read = |key: &str| -> Result<Option<Vec<String>>> {
        let Some(values) = top.array(key)? else {
            return Ok(None);
        };
        let names = values.iter().enumerate().map(|(at, value)| {
            value.as_str().map(str::to_owned).ok_or_else(|| {
                let problem = format!("{} is not a name", excerpt(value));
                top.invalid(&format!("{key}[{at}]"), problem).into()
            })
        });
        let mut names = names.collect::<Result<Vec<String>>>()?;
        names.retain(|name| !missing.contains(name.as_str()));
        Ok(Some(names))
    };
    source.info.train_names = read("train")?;
    source.info.test_names = read("test")?;
    Ok(())
}
