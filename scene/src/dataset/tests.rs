//! Tests of datasets: what opens, what is refused, what a round trip keeps.

mod cameras;
mod open;
mod split;
mod views;

use super::*;
use crate::camera::Camera;
use crate::exr::{self, Precision};
use crate::image::Image;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::{Value, json};

/// A dataset folder that lives as long as the test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn root(&self) -> &Path {
        self.0.path()
    }

    /// A 4x2 radiance image of ones.
    fn image(&self, relative: &str) {
        let path = self.root().join(relative);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        exr::write_rgb(&path, &Image::filled(4, 2, [1.0; 3]), Precision::Half).unwrap();
    }

    fn transforms(&self, value: &Value) {
        let text = serde_json::to_vec(value).unwrap();
        std::fs::write(self.root().join(TRANSFORMS_FILE), text).unwrap();
    }

    fn open(&self) -> Result<Dataset> {
        Dataset::open(self.root())
    }
}

fn identity() -> Value {
    json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
}

/// A dataset of EAG-PT with frames of these names, all alike.
fn folder_with(names: &[&str]) -> Folder {
    let folder = Folder::new();
    let frames: Vec<Value> = names
        .iter()
        .map(|name| {
            folder.image(&format!("{RADIANCE_DIR}/{name}.exr"));
            json!({"file_name": name, "transform_matrix": identity()})
        })
        .collect();
    folder.transforms(&json!({"fx": 3.0, "fy": 3.0, "frames": frames}));
    folder
}

fn some_camera(t: f64) -> Camera {
    Camera {
        width: 5,
        height: 3,
        fx: 4.1,
        fy: 4.2 + t,
        cx: 2.4,
        cy: 1.6,
        world_from_camera: DAffine3 {
            matrix3: DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3 + t, 1.1, -0.7)),
            translation: DVec3::new(1.0 / 3.0, -2.0 * t, 1e-3),
        },
    }
}

/// A view with every image, filled with different values.
fn some_view(name: &str, t: f64) -> View {
    let ramp = |k: f32| {
        let pixels = (0..15).map(|i| [k * i as f32, k / (i + 1) as f32, t as f32]);
        Image::from_pixels(5, 3, pixels.collect()).unwrap()
    };
    let mask = |k: u32| ramp(1.0).map(|p| [f32::from((p[0] as u32).is_multiple_of(k))]);
    View {
        name: name.to_owned(),
        camera: some_camera(t),
        radiance: ramp(0.7),
        emission: Some(mask(2)),
        normal: Some(ramp(1.0).map(|p| {
            let n = glam::Vec3::new(p[0], 1.0, -p[1]).normalize();
            if p[0] == 3.0 { [0.0; 3] } else { n.to_array() }
        })),
        alpha: Some(mask(3)),
        depth: Some(ramp(0.1).map(|p| [p[0]])),
        albedo: Some(ramp(0.01)),
        specular: None,
        roughness: None,
        clipped: None,
        valid: None,
    }
}
