//! Light baking: after an edit, radiance that fits the light as it is now (EAG-PT, section 3.5).
//!
//! Emitters, the Gaussians whose emission exceeds τ_E, keep their radiance; every other one gets
//! what it reflects. Geometry, emission and albedo stay as they are, bit for bit. Two methods:
//! - [`gaussians`]: the light is solved in Gaussian space; no image is made.
//! - [`views`]: the paper's; the views of a dataset are path-traced and radiance is fitted to them.

mod bright;
mod emitters;
pub mod gaussians;
mod highlights;
mod lamps;
mod receivers;
mod request;
mod series;
pub(crate) mod solution;
mod transport;
mod unlit;
pub mod views;

use crate::error::Result;
use eagpt_scene::dataset::{RADIANCE_DIR, TRANSFORMS_FILE};
use eagpt_scene::files::{self, Key, Ledger, ledger};
use eagpt_scene::lamps::{EMISSION_THRESHOLD, emits};
use eagpt_scene::light_basis::lights_file_beside;
use eagpt_scene::{Dataset, Gaussians, SceneError, Shard, ply};
use emitters::forget_directions;
use gaussians::Solved;
use request::Bake;
use std::path::Path;

pub use crate::progress::BakeProgress;
pub use request::{BakeMethod, BakeOptions, BakeRequest, BakeSummary};

/// Bakes the light of a scene.
///
/// # Errors
/// Bad input, a work folder that holds another bake, or a file that cannot be written; each names
/// what it is about.
pub fn bake(request: &BakeRequest, progress: &mut dyn FnMut(BakeProgress)) -> Result<BakeSummary> {
    let dataset = Dataset::open(&request.cameras)?;
    let split = dataset.split(request.options.split)?;
    for warning in &split.warnings {
        let text = warning.clone();
        progress(BakeProgress::Warning { text });
    }
    let mut scene = ply::read_gaussians(&request.scene)?;
    forget_directions(&mut scene);
    if !scene.emissions.iter().any(|&e| emits(e)) {
        let problem =
            format!("nothing emits (emission > {EMISSION_THRESHOLD}): all would be black");
        return Err(SceneError::invalid(&request.scene, "emission", problem).into());
    }
    let mut bake = Bake {
        request,
        progress,
        frames: split.indices(request.options.subset),
        dataset,
        scene,
        num_rays: 0,
    };
    let solved = match &request.options.method {
        BakeMethod::Views(method) => {
            let fitted = bake.fit_views(method, open_work(request)?)?;
            fitted.map(|radiances| Solved {
                radiances,
                basis: None,
                harmonics: bake.scene.harmonics.clone(),
            })
        }
        BakeMethod::Gaussians(method) => {
            if request.transport.is_none() {
                open_work(request)?;
            }
            bake.solve(*method)?
        }
    };
    let num_rays = bake.num_rays;
    let mut options = request.options;
    if let BakeMethod::Gaussians(method) = &mut options.method {
        method.num_samples = Some(method.number(bake.scene.len(), request.per_light.is_some()));
    }
    let mut num_lights = None;
    let scene = match solved {
        Some(Solved {
            radiances,
            basis,
            harmonics,
        }) => {
            let baked = Gaussians {
                radiances,
                harmonics,
                ..bake.scene
            };
            let lights = lights_file_beside(&request.out);
            match &basis {
                Some(basis) => basis.write(&lights)?,
                // That of an earlier bake.
                None => files::remove_if_there(&lights)?,
            }
            num_lights = basis.map(|basis| basis.lights().len());
            ply::write_gaussians(&request.out, &baked)?;
            let is_solved = matches!(request.options.method, BakeMethod::Gaussians(_));
            if is_solved && request.transport.is_none() {
                // Path-traced views are worth keeping, the rows of a matrix are not.
                clear(&request.work)?;
            }
            Some(request.out.clone())
        }
        None => None,
    };
    Ok(BakeSummary {
        scene,
        num_lights,
        num_rays,
        options,
        split,
        device: request.device.name(),
    })
}

/// The command in ledgers.
const COMMAND: &str = "bake";
/// Advice to who finds the work folder taken.
const ADVICE: &str = "--force starts over, --work names another folder";

/// Opens the work folder of this bake.
fn open_work(request: &BakeRequest) -> Result<Ledger> {
    let mut options = request.options;
    let mut shard = Shard::WHOLE;
    if let BakeMethod::Views(views) = &mut options.method {
        shard = std::mem::replace(&mut views.shard, Shard::WHOLE);
    }
    let dataset = Dataset::open(&request.cameras)?;
    let key = Key::new()
        .with_file("scene", &request.scene)?
        .with_file("cameras", dataset.transforms())?
        .with_value("options", &options)?;
    match Ledger::open(&request.work, COMMAND, &key, shard, ADVICE) {
        Err(SceneError::Work { .. }) if request.start_over => {
            clear(&request.work)?;
            Ok(Ledger::open(&request.work, COMMAND, &key, shard, ADVICE)?)
        }
        opened => Ok(opened?),
    }
}

/// Removes what bakes leave in a work folder, and nothing else.
fn clear(work: &Path) -> Result<()> {
    ledger::clear(work, COMMAND)?;
    for name in [gaussians::STATE, TRANSFORMS_FILE, RADIANCE_DIR] {
        files::remove_if_there(&work.join(name))?;
    }
    // Fails where the folder holds something else, which is to stay.
    std::fs::remove_dir(work).ok();
    Ok(())
}
