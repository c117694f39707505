//! The measured scene: views, and Gaussians in any number.

use anyhow::{Result, bail};
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_scene::{Dataset, Gaussian, Gaussians, View, ply};
use eagpt_synth::capture::Parts;
use eagpt_synth::{SceneScript, SynthOptions, scenes, simulate};
use eagpt_train::init::Initialiser;
use eagpt_train::{Preset, TrainOptions};
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Views that are rendered: few enough that a run is short, from all over the room.
const NUM_VIEWS: usize = 4;
/// The room that comes with the program, and how it is photographed where there is no dataset.
const ROOM: &str = "small-room";
const ROOM_SIZE: [u32; 2] = [270, 180];
const ROOM_VIEWS: u32 = 8;
const ROOM_POINTS: u32 = 60_000;
/// Opacity of Gaussians that are not trained: as opaque as those of a trained room, more or less.
const OPACITY: f32 = 0.7;

/// A dataset and a scene of it.
pub(super) struct Subject {
    /// Name of the dataset in results.
    pub(super) dataset: String,
    /// Where its cameras are.
    pub(super) cameras: PathBuf,
    pub(super) views: Vec<Arc<View>>,
    pub(super) gaussians: Gaussians,
    /// Half the diagonal of the scene's box, scene units.
    pub(super) extent: f32,
}

impl Subject {
    /// Reads a dataset, or makes one in `work`; without a scene, Gaussians are those that training
    /// would start from.
    ///
    /// # Errors
    /// Whatever is wrong with the files.
    pub(super) fn prepare(
        dataset: Option<&Path>,
        scene: Option<&Path>,
        work: &Path,
    ) -> Result<Self> {
        let root = match dataset {
            Some(path) => path.to_owned(),
            None => room(&work.join("room"))?,
        };
        let opened = Dataset::open(&root)?;
        let split = opened.split(SplitRule::default())?;
        let mut chosen = split.indices(Subset::Train);
        if chosen.is_empty() {
            chosen = split.indices(Subset::All);
        }
        let step = chosen.len().div_ceil(NUM_VIEWS).max(1);
        let views = chosen
            .into_iter()
            .step_by(step)
            .map(|index| Ok(Arc::new(opened.load_view(index)?)))
            .collect::<Result<Vec<_>>>()?;
        if views.is_empty() {
            bail!("{}: frames: there are no views", root.display());
        }
        let gaussians = match scene {
            Some(path) => ply::read_gaussians(path)?,
            None => untrained(&opened, &views)?,
        };
        let Some((low, high)) = gaussians.bounds() else {
            bail!(
                "{}: there are no Gaussians",
                scene.unwrap_or(&root).display()
            );
        };
        Ok(Self {
            dataset: dataset.map_or_else(|| ROOM.to_owned(), |path| path.display().to_string()),
            cameras: root,
            views,
            gaussians,
            extent: 0.5 * (high - low).length(),
        })
    }
}

/// The true dataset of the embedded room.
fn room(out: &Path) -> Result<PathBuf> {
    let script = room_script()?;
    let options = SynthOptions {
        parts: Parts::Truth,
        size: Some(ROOM_SIZE),
        num_views: Some(ROOM_VIEWS),
        num_samples: 4,
        num_points: ROOM_POINTS,
        ..SynthOptions::default()
    };
    simulate(&script, out, &options, &mut |_| ())?;
    let condition = script.conditions.first().map_or("", String::as_str);
    Ok(out.join("truth").join(condition))
}

/// The embedded room's scene file.
///
/// # Errors
/// None, as long as it comes with the program.
pub(super) fn room_script() -> Result<SceneScript> {
    let Some(scene) = scenes::embedded(ROOM) else {
        bail!("{ROOM}: no such scene");
    };
    Ok(SceneScript::parse(
        Path::new(scene.name),
        scene.toml.as_bytes(),
    )?)
}

fn untrained(dataset: &Dataset, views: &[Arc<View>]) -> Result<Gaussians> {
    let Some(cloud) = dataset.points()? else {
        bail!(
            "{}: has no point cloud to begin with: --scene names a scene",
            dataset.root().display()
        );
    };
    let mut options = TrainOptions::preset(Preset::Draft);
    options.num_gaussians = Some(cloud.len());
    options.radiance.densify.times = 0;
    options.init.opacity = OPACITY;
    let mut init = Initialiser::new(&cloud, &options, dataset.root())?;
    for view in views {
        init.observe(view);
    }
    Ok(init.finish(&options.init))
}

/// `num` Gaussians that cover what `gaussians` do: every n-th, made larger, or each as several,
/// made smaller, in place of it.
pub(super) fn resampled(gaussians: &Gaussians, num: usize) -> Gaussians {
    /// The golden angle, radians: points of a spiral that turns by it are spread evenly.
    const TURN: f32 = 2.399_963_2;
    let (have, all) = (gaussians.len() as u128, num as u128);
    let first = |index: usize| (index as u128 * all / have) as usize;
    // Areas add up to what they were.
    let shrink = (have as f32 / all as f32).sqrt();
    let part = |g: Gaussian, child: usize, children: usize| {
        // Out to where a disc holds as much of the Gaussian as the part's share.
        let inside = (child as f32 + 0.5) / children as f32;
        let radius = if children == 1 {
            0.0
        } else {
            (-2.0 * (1.0 - inside).ln()).sqrt()
        };
        let (sin, cos) = (child as f32 * TURN).sin_cos();
        let offset = Vec3::new(g.scale.x * radius * cos, g.scale.y * radius * sin, 0.0);
        Gaussian {
            position: g.position + g.rotation * offset,
            scale: g.scale * shrink,
            ..g
        }
    };
    gaussians
        .iter()
        .enumerate()
        .flat_map(|(index, g)| {
            let children = first(index + 1) - first(index);
            (0..children).map(move |child| part(g, child, children))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::random_cloud;

    #[test]
    fn any_number_of_gaussians_covers_the_same_area() {
        let cloud = random_cloud(300, 1);
        let area = |g: &Gaussians| g.scales.iter().map(|s| s.x * s.y).sum::<f32>();
        for num in [1, 37, 300, 301, 2000] {
            let other = resampled(&cloud, num);
            assert_eq!(other.len(), num);
            // A few of an uneven cloud are no fair sample of it.
            if num >= 300 {
                let ratio = area(&other) / area(&cloud);
                assert!((ratio - 1.0).abs() < 0.02, "{num}: {ratio}");
            }
        }
        assert_eq!(resampled(&cloud, 300), cloud);
    }
}
