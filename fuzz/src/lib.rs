//! Readers of files, as programs call them, for the fuzz target.
//!
//! A reader may refuse whatever it is given, in one line; it may not panic, hang, or take memory
//! that the file does not account for. Readers that take a path get it in a folder that lives as
//! long as the process, with the images beside it that they look for. Where a reader wants several
//! files, one input holds them all, with [`SEPARATOR`] between.

use eagpt_colmap::Model;
use eagpt_colmap::model::{Form, Observations, Part, read_part};
use eagpt_convert::{ImportOptions, SourceDataset, SourceFormat};
use eagpt_edit::Script;
use eagpt_scene::camera_path::PathOverrides;
use eagpt_scene::dataset::{RADIANCE_DIR, TRANSFORMS_FILE};
use eagpt_scene::exr::Precision;
use eagpt_scene::{CameraPath, Dataset, Image, files, pictures, ply};
use eagpt_synth::script::SceneScript;
use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Once};

/// Stands between the files of an input.
pub const SEPARATOR: &[u8] = b"\n#---\n";

/// A reader of an input.
pub type Reader = fn(&[u8]);

/// All readers by their names, which are those of the folders of their corpora.
pub const READERS: [(&str, Reader); 18] = [
    ("camera_path", camera_path),
    ("colmap_cameras", |data| colmap_part(Part::Cameras, data)),
    ("colmap_frames", |data| colmap_part(Part::Frames, data)),
    ("colmap_images", |data| colmap_part(Part::Images, data)),
    ("colmap_model", colmap_model),
    ("colmap_points3d", |data| colmap_part(Part::Points, data)),
    ("colmap_rigs", |data| colmap_part(Part::Rigs, data)),
    ("dataset", dataset),
    ("edit_script", edit_script),
    ("exr", exr),
    ("eyeful", |data| source(SourceFormat::Eyeful, data)),
    ("fipt", |data| source(SourceFormat::Fipt, data)),
    ("fipt_synthetic", |data| {
        source(SourceFormat::FiptSynthetic, data)
    }),
    ("instant_ngp", |data| source(SourceFormat::InstantNgp, data)),
    ("nerfstudio", |data| source(SourceFormat::Nerfstudio, data)),
    ("picture", picture),
    ("ply", ply),
    ("scene_script", scene_script),
];

/// The reader called `name`.
///
/// # Panics
/// If there is none, with the names of all.
pub fn reader(name: &str) -> Reader {
    if name == "exr" {
        // The reader of EXR turns panics of the decoder into errors: those it catches are no
        // findings, those that get past it still are.
        std::panic::set_hook(Box::new(|_| ()));
    }
    let found = READERS.iter().find(|(known, _)| *known == name);
    let names = READERS.map(|(name, _)| name).join(", ");
    found
        .unwrap_or_else(|| panic!("READER is `{name}`, not one of {names}"))
        .1
}

/// The folder of this process, in memory where the system has such a place.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let parent = if memory.is_dir() {
        memory.to_owned()
    } else {
        std::env::temp_dir()
    };
    // The process is killed, not ended: the next one of this reader clears the folder away.
    let reader = std::env::var("READER").unwrap_or_default();
    let folder = parent.join("eagpt-fuzz").join(reader);
    files::remove_if_there(&folder).expect("the folder of an earlier run can be removed");
    fs::create_dir_all(&folder).expect("a folder can be made");
    folder
});

/// A problem takes one line.
fn check<T, E: Display>(outcome: Result<T, E>) {
    if let Err(error) = outcome {
        let message = error.to_string();
        assert!(!message.contains('\n'), "{message}");
    }
}

/// Writes the input as the file `name` of the folder.
fn file(name: &str, data: &[u8]) -> PathBuf {
    let path = FOLDER.join(name);
    fs::write(&path, data).expect("the folder can be written");
    path
}

/// The files of an input.
fn split(data: &[u8]) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    let mut rest = data;
    while let Some(at) = rest.windows(SEPARATOR.len()).position(|w| w == SEPARATOR) {
        parts.push(&rest[..at]);
        rest = &rest[at + SEPARATOR.len()..];
    }
    parts.push(rest);
    parts
}

/// A small image that frames may name.
fn image(relative: &str) {
    let path = FOLDER.join(relative);
    let parent = path.parent().expect("it is in the folder");
    fs::create_dir_all(parent).expect("a folder can be made");
    let image = Image::filled(24, 16, [0.5; 3]);
    eagpt_scene::exr::write_rgb(&path, &image, Precision::Half).expect("an image can be written");
}

/// One file of a COLMAP model, in both forms.
fn colmap_part(part: Part, data: &[u8]) {
    for form in [Form::Binary, Form::Text] {
        let path = part.path(Path::new("model"), form);
        check(read_part(part, form, &path, data));
    }
}

/// A whole text model: cameras, images, points, rigs, frames; the last may be absent.
fn colmap_model(data: &[u8]) {
    let parts = split(data);
    for (index, part) in Part::ALL.into_iter().enumerate() {
        let path = part.path(&FOLDER, Form::Text);
        match parts.get(index) {
            Some(bytes) => fs::write(&path, bytes).expect("the folder can be written"),
            None if path.is_file() => fs::remove_file(&path).expect("the folder can be written"),
            None => {}
        }
    }
    check(Model::read(&FOLDER, Observations::Skip));
    check(Model::read(&FOLDER, Observations::Keep));
}

/// Our own `transforms.json`, and nerfstudio's as a dataset.
fn dataset(data: &[u8]) {
    static IMAGES: Once = Once::new();
    IMAGES.call_once(|| {
        for name in ["a", "b", "CAM/c"] {
            image(&format!("{RADIANCE_DIR}/{name}.exr"));
        }
        image("images/0000.exr");
    });
    let path = file(TRANSFORMS_FILE, data);
    check(Dataset::open(&path));
    check(Dataset::open_cameras(&path));
    check(Dataset::survey(&path));
}

/// The cameras of another program's dataset.
fn source(format: SourceFormat, data: &[u8]) {
    let (names, images): (&[&str], &[&str]) = match format {
        SourceFormat::Fipt => (
            &["cam.txt", "K_list.txt"],
            &[
                "Image/000_0001.exr",
                "Image/001_0001.exr",
                "Image/002_0001.exr",
            ],
        ),
        SourceFormat::FiptSynthetic => (
            &["train/transforms.json", "val/transforms.json"],
            &[
                "train/Image/000_0001.exr",
                "train/Image/001_0001.exr",
                "val/Image/000_0001.exr",
            ],
        ),
        SourceFormat::Eyeful => (
            &["cameras.json", "splits.json"],
            &[
                "images-2k/10/10_DSC0001.exr",
                "images-2k/11/11_DSC0002.exr",
                "kitchen-final.pdf",
            ],
        ),
        SourceFormat::Nerfstudio | SourceFormat::InstantNgp | SourceFormat::Eagpt => (
            &[TRANSFORMS_FILE],
            &[
                "images/0000.exr",
                "images/0001.exr",
                "images/frame_00001.exr",
                "images/frame_00002.exr",
            ],
        ),
    };
    static IMAGES: Once = Once::new();
    IMAGES.call_once(|| images.iter().for_each(|name| image(name)));
    let parts = split(data);
    for (index, name) in names.iter().enumerate() {
        file(name, parts.get(index).copied().unwrap_or_default());
    }
    check(SourceFormat::detect(&FOLDER));
    check(SourceDataset::open(
        &FOLDER,
        Some(format),
        &ImportOptions::default(),
    ));
}

/// EXR: the header alone, colour, one channel.
fn exr(data: &[u8]) {
    let path = file("a.exr", data);
    check(eagpt_scene::exr::read_size(&path));
    check(eagpt_scene::exr::read_rgb(&path));
    check(eagpt_scene::exr::read_single(&path));
}

/// PLY: point clouds and Gaussians.
fn ply(data: &[u8]) {
    let path = file("a.ply", data);
    check(ply::read_points(&path));
    check(ply::read_gaussians(&path));
}

/// PNG and JPEG, in all that is read from them.
fn picture(data: &[u8]) {
    let path = file("a.png", data);
    check(pictures::size(&path));
    check(pictures::read_light(&path));
    check(pictures::read_mask(&path));
    check(pictures::read_depth(&path));
}

/// Edit scripts.
fn edit_script(data: &[u8]) {
    check(Script::read(&file("edit.toml", data)));
}

/// Files of virtual rooms.
fn scene_script(data: &[u8]) {
    check(SceneScript::parse(Path::new("room.toml"), data));
}

/// Camera paths, in TOML and in the JSON of nerfstudio's viewer.
fn camera_path(data: &[u8]) {
    static DATASET: LazyLock<Dataset> = LazyLock::new(|| {
        image(&format!("{RADIANCE_DIR}/a.exr"));
        image(&format!("{RADIANCE_DIR}/b.exr"));
        let pose = |x: f64| format!("[[1,0,0,{x}],[0,0,-1,-2],[0,1,0,1],[0,0,0,1]]");
        let frame = |name, x| {
            format!(
                r#"{{"file_name": "{name}", "transform_matrix": {}}}"#,
                pose(x)
            )
        };
        let frames = [frame("a", 0.0), frame("b", 1.0)].join(",");
        let text = format!(r#"{{"camera_angle_x": 1.2, "frames": [{frames}]}}"#);
        let path = file(TRANSFORMS_FILE, text.as_bytes());
        Dataset::open(&path).expect("the dataset is sound")
    });
    let overrides = PathOverrides::default();
    for name in ["path.toml", "path.json"] {
        let path = file(name, data);
        let argument = path.to_str().expect("the folder's name is plain");
        check(CameraPath::read(argument, &DATASET, &overrides));
    }
}
