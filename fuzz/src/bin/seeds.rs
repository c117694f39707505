//! Writes the seeds of fuzzing into `corpus/`: one or a few small sound files for each reader.
//!
//! `cargo run --bin seeds` in the folder `fuzz`.

use eagpt_colmap::Model;
use eagpt_colmap::model::{Form, Observations, Part};
use eagpt_fuzz::SEPARATOR;
use eagpt_scene::exr::Precision;
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics, Image, exr, files, ply};
use glam::{Quat, Vec3};
use image::{ImageBuffer, Luma, RgbImage, Rgba};
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

/// A model with all five files, each record in it.
const MODEL: [&str; 5] = [
    "1 OPENCV 64 48 60 61 32 24 0.1 -0.02 0.001 -0.001\n2 SIMPLE_PINHOLE 64 48 60 32 24\n3 THIN_PRISM_FISHEYE 64 48 60 60 32 24 0.1 0.01 0 0 0.001 0 0 0\n",
    "1 1 0 0 0 0.5 -1 2 1 left/a.jpg\n10.5 20.25 7 11 12 -1\n2 0.6 0.8 0 0 0 0 1 2 right/b.jpg\n1 2 7\n3 1 0 0 0 0 0 0 1 left/c.jpg\n\n",
    "7 0.25 -1 3 255 0 10 0.7 1 0 2 0\n",
    "1 2 CAMERA 1 CAMERA 2 1 1 0 0 0 0.1 0 0\n",
    "1 1 1 0 0 0 0.5 -1 2 2 CAMERA 1 1 CAMERA 2 2\n",
];

fn main() -> Outcome {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let seeds = Seeds {
        repository: root.join(".."),
        corpus: root.join("corpus"),
    };
    seeds.models()?;
    seeds.sources()?;
    seeds.images()?;
    seeds.scripts()
}

struct Seeds {
    repository: PathBuf,
    corpus: PathBuf,
}

impl Seeds {
    /// The path of a seed.
    fn path(&self, target: &str, name: &str) -> Outcome<PathBuf> {
        let folder = self.corpus.join(target);
        files::create_dir(&folder)?;
        Ok(folder.join(name))
    }

    fn write(&self, target: &str, name: &str, bytes: &[u8]) -> Outcome {
        Ok(fs::write(self.path(target, name)?, bytes)?)
    }

    /// A seed of files of the repository.
    fn copy(&self, target: &str, name: &str, relative: &[&str]) -> Outcome {
        let read =
            |path: &&str| fs::read(self.repository.join(path)).map_err(|e| format!("{path}: {e}"));
        let parts = relative.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        self.write(target, name, &parts.join(SEPARATOR))
    }

    fn models(&self) -> Outcome {
        let folder = tempfile::tempdir()?;
        let (text, binary) = (folder.path().join("text"), folder.path().join("binary"));
        fs::create_dir(&text)?;
        for (part, lines) in Part::ALL.into_iter().zip(MODEL) {
            fs::write(part.path(&text, Form::Text), lines)?;
        }
        Model::read(&text, Observations::Keep)?.write(&binary, Form::Binary)?;
        for (part, target) in Part::ALL.into_iter().zip([
            "colmap_cameras",
            "colmap_images",
            "colmap_points3d",
            "colmap_rigs",
            "colmap_frames",
        ]) {
            self.write(target, "text", &fs::read(part.path(&text, Form::Text))?)?;
            self.write(
                target,
                "binary",
                &fs::read(part.path(&binary, Form::Binary))?,
            )?;
        }
        let separator = std::str::from_utf8(SEPARATOR)?;
        self.write("colmap_model", "rig", MODEL.join(separator).as_bytes())?;
        self.write(
            "colmap_model",
            "plain",
            MODEL[..3].join(separator).as_bytes(),
        )
    }

    fn sources(&self) -> Outcome {
        let data = "convert/tests/data";
        for (target, name, relative) in [
            ("fipt", "scene", vec!["fipt/cam.txt", "fipt/K_list.txt"]),
            (
                "fipt_synthetic",
                "scene",
                vec![
                    "fipt-synthetic-train/transforms.json",
                    "fipt-synthetic-val/transforms.json",
                ],
            ),
            (
                "eyeful",
                "fisheye",
                vec!["eyeful-1/cameras.json", "eyeful-1/splits.json"],
            ),
            (
                "eyeful",
                "radial",
                vec!["eyeful-2/cameras.json", "eyeful-2/splits.json"],
            ),
            ("nerfstudio", "lenses", vec!["nerfstudio/transforms.json"]),
            ("instant_ngp", "angle", vec!["instant-ngp/transforms.json"]),
            ("dataset", "nerfstudio", vec!["instant-ngp/transforms.json"]),
        ] {
            let paths: Vec<String> = relative
                .iter()
                .map(|path| format!("{data}/{path}"))
                .collect();
            let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
            self.copy(target, name, &paths)?;
        }
        let pose = "[[1,0,0,1],[0,0,-1,-2],[0,1,0,1],[0,0,0,1]]";
        let dataset = format!(
            r#"{{"fx": 20, "fy": 20.5, "cx": 12, "cy": 8, "w": 24, "h": 16, "up_axis": "-y", "metres_per_unit": 0.5,
"aligned_from_model": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "train_filenames": ["a", "b"], "test_filenames": ["CAM/c"],
"frames": [{{"file_name": "a", "transform_matrix": {pose}}}, {{"file_name": "b", "transform_matrix": {pose}}},
{{"file_name": "CAM/c", "transform_matrix": {pose}}}]}}"#
        );
        self.write("dataset", "own", dataset.as_bytes())
    }

    fn images(&self) -> Outcome {
        let ramp = |x: u32| [x as f32, 0.5, -1.0];
        let pixels = (0..40).map(|i| ramp(i % 8)).collect();
        let rgb = Image::from_pixels(8, 5, pixels).ok_or("the pixels fill the image")?;
        exr::write_rgb(&self.path("exr", "half")?, &rgb, Precision::Half)?;
        exr::write_rgb(&self.path("exr", "float")?, &rgb, Precision::Float)?;
        exr::write_single(
            &self.path("exr", "mask")?,
            &Image::filled(3, 20, [1.0]),
            Precision::Half,
        )?;
        let cloud = PointCloud {
            positions: vec![Vec3::X, Vec3::new(0.1, -2.0, 3.5)],
            colors_srgb8: vec![[0, 128, 255], [1, 2, 3]],
        };
        ply::write_points(&self.path("ply", "points")?, &cloud)?;
        let text = "ply\nformat ascii 1.0\ncomment x\nelement vertex 1\nproperty double x\nproperty float y\nproperty float z\n\
                    property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
                    property list uchar int vertex_indices\nend_header\n1 2 3 4 5 6\n3 0 0 0\n";
        self.write("ply", "ascii", text.as_bytes())?;
        let gaussian = Gaussian {
            position: Vec3::ONE,
            scale: glam::Vec2::new(0.1, 0.2),
            rotation: Quat::IDENTITY,
            opacity: 0.5,
            radiance: Vec3::splat(2.0),
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission: 0.1,
            albedo: Vec3::splat(0.3),
        };
        let mut gaussians: Gaussians = [gaussian; 2].into_iter().collect();
        ply::write_gaussians(&self.path("ply", "gaussians")?, &gaussians)?;
        gaussians.harmonics = vec![Harmonics([0.25; NUM_COEFFICIENTS]); 2];
        ply::write_gaussians(&self.path("ply", "harmonics")?, &gaussians)?;
        let save = |name: &str, picture: image::DynamicImage, format| -> Outcome {
            Ok(picture.save_with_format(self.path("picture", name)?, format)?)
        };
        let color = RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 7]));
        save("jpeg", color.clone().into(), image::ImageFormat::Jpeg)?;
        save("rgb", color.into(), image::ImageFormat::Png)?;
        let depth = ImageBuffer::from_fn(6, 5, |x, y| Luma([(1000 * x + y) as u16]));
        save("depth", depth.into(), image::ImageFormat::Png)?;
        let clear = ImageBuffer::from_fn(4, 4, |x, _| Rgba([200, 100, 50, x as u8 * 60]));
        save(
            "alpha",
            image::DynamicImage::ImageRgba8(clear),
            image::ImageFormat::Png,
        )
    }

    fn scripts(&self) -> Outcome {
        for (target, folder) in [
            ("edit_script", "edit/examples"),
            ("scene_script", "synth/scenes"),
        ] {
            for entry in fs::read_dir(self.repository.join(folder))? {
                let path = entry?.path();
                let name = path.file_name().ok_or("a file has a name")?;
                let name = name.to_str().ok_or("a plain name")?;
                self.write(target, name, &fs::read(&path)?)?;
            }
        }
        self.write(
            "edit_script",
            "demo.toml",
            &fs::read(self.repository.join("src/demo/evening.toml"))?,
        )?;
        let turntable = "fps = 24\nframes = 12\nease = true\nsize = [12, 8]\n[turntable]\nheight = 1.0\nradius = 2\ndegrees = -90\n";
        self.write("camera_path", "turntable", turntable.as_bytes())?;
        let fly = "seconds = 1.5\nfov_y = 50\n[fly]\nviews = [\"a\", \"b\"]\npace = \"views\"\nclosed = false\n";
        self.write("camera_path", "fly", fly.as_bytes())?;
        let viewer = r#"{"render_height": 8, "render_width": 12, "fps": 10, "seconds": 1,
"camera_path": [{"camera_to_world": [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1], "fov": 60, "aspect": 1.5}]}"#;
        self.write("camera_path", "viewer", viewer.as_bytes())
    }
}
