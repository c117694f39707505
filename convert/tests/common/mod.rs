//! Small sources: the texts of `data/`, with images beside.

#![allow(dead_code, reason = "not every test needs everything")]

use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Image, files};
use serde_json::Value;
use std::path::{Path, PathBuf};

pub(crate) const SIZE: (u32, u32) = (24, 16);
pub(crate) const EYEFUL_SIZE: (u32, u32) = (20, 30);

pub(crate) fn data(relative: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(relative)
}

pub(crate) fn copy(from: &str, to: &Path) {
    files::create_dir(to.parent().unwrap()).unwrap();
    std::fs::copy(data(from), to).unwrap();
}

/// An image whose pixel (x, y) has the light (x + 0.5, y + 0.5, 1).
pub(crate) fn ramp((width, height): (u32, u32)) -> Image<3> {
    let pixels = (0..height)
        .flat_map(|y| (0..width).map(move |x| [x as f32 + 0.5, y as f32 + 0.5, 1.0]))
        .collect();
    Image::from_pixels(width, height, pixels).unwrap()
}

pub(crate) fn write_ramp(path: &Path, size: (u32, u32)) {
    write(path, &ramp(size));
}

pub(crate) fn write(path: &Path, image: &Image<3>) {
    files::create_dir(path.parent().unwrap()).unwrap();
    exr::write_rgb(path, image, Precision::Float).unwrap();
}

pub(crate) fn fipt(root: &Path) {
    copy("fipt/cam.txt", &root.join("cam.txt"));
    copy("fipt/K_list.txt", &root.join("K_list.txt"));
    for index in 0..3 {
        write_ramp(&root.join(format!("Image/{index:03}_0001.exr")), SIZE);
    }
}

pub(crate) fn fipt_synthetic(root: &Path) {
    for (split, num) in [("train", 2), ("val", 1)] {
        let folder = root.join(split);
        let from = format!("fipt-synthetic-{split}/transforms.json");
        copy(&from, &folder.join("transforms.json"));
        for index in 0..num {
            let file = format!("{index:03}_0001.exr");
            write_ramp(&folder.join("Image").join(&file), SIZE);
            write(
                &folder.join("DiffCol").join(&file),
                &Image::filled(SIZE.0, SIZE.1, [0.25, 0.5, 0.75]),
            );
            let emitted = ramp(SIZE).map(|[x, ..]| [0.0, 0.0, if *x > 20.0 { 3.0 } else { 0.0 }]);
            write(&folder.join("Emit").join(&file), &emitted);
        }
    }
}

/// Either rig; the last entry of `cameras.json` has no image.
pub(crate) fn eyeful(root: &Path, rig: u32) {
    for file in ["cameras.json", "splits.json"] {
        copy(&format!("eyeful-{rig}/{file}"), &root.join(file));
    }
    for camera in 0..3 {
        let image = format!("images-2k/1{camera}/1{camera}_DSC000{}.exr", camera + 1);
        write_ramp(&root.join(image), EYEFUL_SIZE);
    }
}

pub(crate) fn nerfstudio(root: &Path) {
    copy("nerfstudio/transforms.json", &root.join("transforms.json"));
    for index in 1..=5 {
        write_ramp(&root.join(format!("images/frame_{index:05}.exr")), SIZE);
    }
    let cloud = eagpt_scene::ply::PointCloud {
        positions: vec![glam::Vec3::new(1.0, 2.0, 3.0)],
        colors_srgb8: vec![[1, 2, 3]],
    };
    eagpt_scene::ply::write_points(&root.join("sparse_pc.ply"), &cloud).unwrap();
}

pub(crate) fn instant_ngp(root: &Path) {
    copy("instant-ngp/transforms.json", &root.join("transforms.json"));
    for index in 0..2 {
        write_ramp(&root.join(format!("images/{index:04}.exr")), SIZE);
    }
}

pub(crate) fn expected(source: &str) -> Vec<Value> {
    let bytes = std::fs::read(data("expected.json")).unwrap();
    let all: Value = serde_json::from_slice(&bytes).unwrap();
    all[source].as_array().unwrap().clone()
}

pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().unwrap().iter();
    values.map(|v| v.as_f64().unwrap()).collect()
}
