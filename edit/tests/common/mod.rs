//! Running scripts on small scenes.

use eagpt_edit::{Edited, Script, replay};
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics, ply};
use glam::{Quat, Vec2, Vec3};
use tempfile::TempDir;

/// A level disc of one size and colour.
pub(crate) fn disc(x: f32, y: f32, z: f32) -> Gaussian {
    Gaussian {
        position: Vec3::new(x, y, z),
        scale: Vec2::new(0.1, 0.2),
        rotation: Quat::IDENTITY,
        opacity: 0.9,
        radiance: Vec3::new(1.0, 2.0, 3.0),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 0.0,
        albedo: Vec3::new(0.1, 0.2, 0.3),
    }
}

/// Discs at x = 0, 1, 2, 3, the last of them an emitter; all at height 1.
pub(crate) fn row() -> Gaussians {
    let mut row: Gaussians = (0..4_u8).map(|i| disc(f32::from(i), 0.0, 1.0)).collect();
    row.emissions[3] = 1.0;
    row
}

/// A folder for scripts, with the row as `row.ply`.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        ply::write_gaussians(&dir.path().join("row.ply"), &row()).unwrap();
        Self(dir)
    }

    /// Reads a script.
    pub(crate) fn read(&self, text: &str) -> eagpt_scene::Result<Script> {
        let path = self.0.path().join("a.toml");
        std::fs::write(&path, text).unwrap();
        Script::read(&path)
    }

    /// Replays a script on the row.
    pub(crate) fn replay(&self, text: &str) -> eagpt_scene::Result<Edited> {
        replay(&self.read(text)?, row())
    }

    /// Replays a script that works.
    #[track_caller]
    pub(crate) fn edited(&self, text: &str) -> Edited {
        match self.replay(text) {
            Ok(edited) => edited,
            Err(error) => panic!("{text}: {error}"),
        }
    }
}
