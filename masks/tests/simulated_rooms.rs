//! Masks of simulated rooms against their true emitters.

#![allow(
    clippy::unwrap_used,
    reason = "a test ends with its first surprise; helpers outside of test functions do as well"
)]

use eagpt_masks::{
    CheckOptions, Inconsistent, MaskOptions, MaskRequest, MaskSource, MaskSummary, make_masks,
};
use eagpt_scene::{Dataset, Image, exr};
use eagpt_synth::capture::Parts;
use eagpt_synth::{SceneScript, SynthOptions, simulate};
use std::path::{Path, PathBuf};

/// Simulates a room in `place`.
fn photograph(toml: &str, place: &Path) -> SceneScript {
    let script = SceneScript::parse(Path::new("room.toml"), toml.as_bytes()).unwrap();
    let options = SynthOptions {
        parts: Parts::Truth,
        num_points: 100,
        ..SynthOptions::default()
    };
    simulate(&script, place, &options, &mut |_| ()).unwrap();
    script
}

/// A condition of a simulated room, and masks made of it.
struct Case {
    dataset: Dataset,
    out: PathBuf,
}

impl Case {
    fn new(place: &Path, condition: &str) -> Self {
        Self {
            dataset: Dataset::open(&place.join("truth").join(condition)).unwrap(),
            out: place.join("masks").join(condition),
        }
    }

    fn masks(&self, source: MaskSource, inconsistent: Inconsistent) -> MaskSummary {
        let check = CheckOptions {
            inconsistent,
            ..CheckOptions::default()
        };
        let request = MaskRequest {
            dataset: &self.dataset,
            out: self.out.clone(),
            options: MaskOptions {
                source,
                check,
                ..MaskOptions::default()
            },
            off: Vec::new(),
            labels: None,
            reflections: None,
            scene: None,
        };
        make_masks(&request, &mut |_| ()).unwrap()
    }

    /// Intersection over union of mask and truth, for each view that shows an emitter.
    fn overlaps(&self) -> Vec<(String, f64)> {
        let views = (0..self.dataset.len()).map(|index| self.dataset.load_view(index).unwrap());
        let overlap = |mask: &Image<1>, truth: &Image<1>| {
            let pairs = mask.values().iter().zip(truth.values());
            let (mut both, mut either) = (0, 0);
            for (mask, truth) in pairs {
                both += u32::from(*mask > 0.5 && *truth > 0.5);
                either += u32::from(*mask > 0.5 || *truth > 0.5);
            }
            f64::from(both) / f64::from(either)
        };
        views
            .filter_map(|view| {
                let truth = view.emission?;
                let emits = truth.values().contains(&1.0);
                let path = self.out.join(format!("Emissive-exr/{}.exr", view.name));
                emits.then(|| {
                    (
                        view.name,
                        overlap(&exr::read_single(&path).unwrap(), &truth),
                    )
                })
            })
            .collect()
    }
}

#[test]
fn every_view_of_the_small_room_has_the_mask_of_its_lamps() {
    let place = tempfile::tempdir().unwrap();
    let room = eagpt_synth::scenes::embedded("small-room").unwrap();
    let script = photograph(room.toml, place.path());
    for condition in &script.conditions {
        let case = Case::new(place.path(), condition);
        case.masks(MaskSource::Auto, Inconsistent::Keep);
        let overlaps = case.overlaps();
        assert!(overlaps.len() > 2, "{condition}: {overlaps:?}");
        assert!(
            overlaps.iter().all(|(_, overlap)| *overlap >= 0.95),
            "{condition}: {overlaps:?}"
        );
    }
}

/// A third of a lamp of 18 in lacquer is brighter than any wall.
#[test]
fn the_lamp_in_a_polished_cabinet_is_no_lamp() {
    let place = tempfile::tempdir().unwrap();
    photograph(include_str!("polished-room.toml"), place.path());
    let case = Case::new(place.path(), "evening");
    for source in [MaskSource::Auto, MaskSource::Level(1.5)] {
        let kept = case.masks(source, Inconsistent::Keep).report;
        let with_reflections = case.overlaps();
        let num_good = with_reflections.iter().filter(|(_, o)| *o >= 0.95).count();
        let reflections: Vec<_> = kept
            .regions
            .iter()
            .filter(|region| region.verdict == Some(eagpt_masks::Verdict::Inconsistent))
            .collect();
        assert!(reflections.len() >= 3, "{source:?}: {:?}", kept.regions);
        assert!(
            reflections
                .iter()
                .all(|region| region.num_pixels > 20 && !region.dropped)
        );
        assert!(num_good < with_reflections.len(), "{with_reflections:?}");
        let dropped = case.masks(source, Inconsistent::Drop).report;
        let num_dropped = dropped.regions.iter().filter(|r| r.dropped).count();
        assert_eq!(num_dropped, reflections.len());
        for (view, overlap) in case.overlaps() {
            assert!(overlap >= 0.95, "{source:?} {view}: {overlap}");
        }
    }
}
