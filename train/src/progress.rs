//! Progress messages of a run and of a bake.

use crate::gloss::GlossySurface;
use crate::options::Stage;
use eagpt_scene::Gaussians;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// A message from a running job. The library never prints; the caller shows or stores these.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "message")]
pub enum TrainProgress {
    /// Training views are being read and checked.
    ReadingViews {
        /// Views done.
        done: usize,
        /// Views in all.
        total: usize,
    },
    /// A stage begins or is resumed.
    StageStarted {
        /// The stage.
        stage: Stage,
        /// Iterations already done.
        done: u32,
        /// Iterations in all.
        total: u32,
        /// Number of Gaussians.
        num_gaussians: usize,
        /// Number of training views.
        num_views: usize,
    },
    /// Glossy surfaces are looked for, before stage 1.
    Gloss {
        /// Those that were found; `None` while they are looked for.
        surfaces: Option<Vec<GlossySurface>>,
    },
    /// Irradiance of Gaussians is being gathered, before stage 1.
    Gathering {
        /// Gaussians done.
        done: usize,
        /// Gaussians in all.
        total: usize,
    },
    /// One iteration is done.
    Iteration {
        /// The stage.
        stage: Stage,
        /// Iteration, counted from 1.
        iteration: u32,
        /// Iterations in all.
        total: u32,
        /// Loss, smoothed over some 50 iterations.
        loss: f64,
    },
    /// Gaussians were split where the pictures are wrong.
    Densified {
        /// Iteration.
        iteration: u32,
        /// Gaussians that no view saw, put elsewhere.
        num_moved: usize,
        /// Gaussians now.
        num_gaussians: usize,
    },
    /// The scene as it is, of several lights in the first; told to those who watch.
    Scene {
        /// The scene.
        #[serde(skip)]
        scene: Arc<Gaussians>,
    },
    /// Shapes of lamps are fitted to what views show.
    FittingLamps {
        /// Groups of lit pixels done.
        done: usize,
        /// Groups in all.
        total: usize,
    },
    /// Emitters became clean lamps.
    Lamps {
        /// Iteration.
        iteration: u32,
        /// Lamps.
        num_lamps: usize,
        /// Gaussians now.
        num_gaussians: usize,
    },
    /// Mirrors are in the scene.
    Mirrors {
        /// Iteration.
        iteration: u32,
        /// Mirrors.
        num_mirrors: usize,
        /// Gaussians now.
        num_gaussians: usize,
    },
    /// Parts of lamps that masks leave out emit, and lit surfaces that they mark do not.
    Luminous {
        /// Gaussians that emit now.
        num: usize,
        /// Gaussians that do not any more.
        num_lit: usize,
    },
    /// Light comes from where no view looks, and surfaces that shine are there now.
    Unseen {
        /// Share of all light, 0 to 1.
        share: f64,
    },
    /// Lamps send more than views see, and are as strong now as what they light tells.
    LampPowers {
        /// Lamps.
        num: usize,
        /// The largest factor of a lamp, above 1.
        most: f32,
    },
    /// Luminaires that no view looks into have bulbs now.
    Bulbs {
        /// Luminaires.
        num: usize,
    },
    /// Surfaces that no mask shows emit, as they are brighter than they can reflect.
    Glows {
        /// Surfaces that are lamps of their own …
        num: usize,
        /// … and that are shades of lamps that masks show.
        num_shades: usize,
    },
    /// Albedos of all surfaces are larger or smaller, so that the scene in its own light is as
    /// bright as its photographs.
    AlbedosBalanced {
        /// Their factor.
        scale: f32,
        /// Gaussians that are darker since light would have grown between them with each bounce.
        num_limited: usize,
    },
    /// Surfaces that reflected more than they received are darker now.
    AlbedosLimited {
        /// Gaussians.
        num: usize,
    },
    /// A checkpoint lies on disk.
    Checkpoint {
        /// Where.
        path: PathBuf,
    },
    /// Previews lie on disk.
    Preview {
        /// The stage.
        stage: Stage,
        /// Iteration.
        iteration: u32,
        /// Mean PSNR of the preview views, clipped sRGB, dB.
        psnr_srgb_db: f64,
    },
    /// The light of the trained scene is solved, to compare it with the photographs.
    OwnLight {
        /// How far.
        step: BakeProgress,
    },
    /// Something the user should know.
    Warning {
        /// One line.
        text: String,
    },
}

/// Progress of a bake.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "message")]
pub enum BakeProgress {
    /// Cameras are traced to find the surface of each Gaussian.
    Looking {
        /// Cameras done.
        done: usize,
        /// Cameras in all.
        total: usize,
    },
    /// Rays are traced at Gaussians.
    Gathering {
        /// Gaussians done.
        done: usize,
        /// Gaussians in all.
        total: usize,
    },
    /// One more bounce is solved.
    Bounced {
        /// The bounce, counted from 1.
        bounce: u32,
        /// Its light, as a share of all so far.
        share: f64,
    },
    /// Views are path-traced.
    Rendering {
        /// Views done, those of earlier processes included.
        done: usize,
        /// Views in all (of this shard).
        total: usize,
    },
    /// Radiance is fitted.
    Fitting {
        /// Iteration, counted from 1.
        iteration: u32,
        /// Iterations in all.
        total: u32,
        /// Loss of this iteration.
        loss: f64,
    },
    /// Something the user should know.
    Warning {
        /// One line.
        text: String,
    },
}
