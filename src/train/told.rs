//! Messages of a training, shown.

use crate::progress::Reporter;
use anyhow::Result;
use eagpt_train::bake::BakeProgress;
use eagpt_train::{GlossySurface, TrainProgress};

/// Glossy surfaces that are named.
const MOST_TOLD: usize = 12;

/// Shows a message of the job.
pub(super) fn tell(reporter: &mut Reporter, message: &TrainProgress) -> Result<()> {
    match message {
        TrainProgress::ReadingViews { done, total } => {
            return reporter.count(("reading", "views"), (*done, *total), message);
        }
        TrainProgress::Gathering { done, total } => {
            let task = ("gathering light", "Gaussians");
            return reporter.count(task, (*done, *total), message);
        }
        TrainProgress::FittingLamps { done, total } => {
            let task = ("fitting lamps", "groups of pixels");
            return reporter.count(task, (*done, *total), message);
        }
        TrainProgress::OwnLight { step } => return tell_own_light(reporter, step, message),
        TrainProgress::StageStarted {
            stage,
            done,
            total,
            num_gaussians,
            num_views,
        } => {
            reporter.begin(stage.name(), "iterations", (*done).into(), (*total).into());
            reporter.note(&format!(
                "{}: {num_gaussians} Gaussians, {num_views} training views",
                stage.name()
            ));
        }
        TrainProgress::Iteration {
            stage,
            iteration,
            total,
            loss,
        } => {
            let steps = (*iteration as usize, *total as usize);
            let note = || format!("loss {loss:.4}");
            return reporter.count_with((stage.name(), "iterations"), steps, note, message);
        }
        TrainProgress::Densified {
            iteration,
            num_gaussians,
            ..
        } => reporter.note(&format!(
            "{num_gaussians} Gaussians after iteration {iteration}"
        )),
        TrainProgress::Lamps {
            iteration,
            num_lamps,
            num_gaussians,
        } => reporter.note(&format!(
            "{num_lamps} lamp{} after iteration {iteration}, {num_gaussians} Gaussians",
            if *num_lamps == 1 { "" } else { "s" }
        )),
        TrainProgress::Gloss { surfaces: None } => reporter.note("looking for glossy surfaces"),
        TrainProgress::Gloss {
            surfaces: Some(surfaces),
        } => tell_gloss(reporter, surfaces),
        TrainProgress::Mirrors {
            iteration,
            num_mirrors,
            num_gaussians,
        } => reporter.note(&format!(
            "{num_mirrors} mirror{} after iteration {iteration}, {num_gaussians} Gaussians",
            if *num_mirrors == 1 { "" } else { "s" }
        )),
        TrainProgress::Luminous { num, num_lit } => reporter.note(&format!(
            "{num} Gaussians near lamps are brighter than they can reflect, and emit; {num_lit} in \
             masks of lamps are not, and reflect"
        )),
        TrainProgress::Unseen { share } => reporter.note(&format!(
            "{:.0} % of the light comes from where no view looks: surfaces close the room there, and \
             shine: see \"unseen-*\" in the list of lamps",
            100.0 * share
        )),
        TrainProgress::LampPowers { num, most } => reporter.note(&format!(
            "{num} lamp{} more than views see, up to {most:.2} times as much: see `factor` in the \
             list of lamps",
            if *num == 1 { " sends" } else { "s send" },
        )),
        TrainProgress::Bulbs { num } => reporter.note(&format!(
            "{num} luminaire{} the room from where no view looks: see \"hidden-*\" in the list of \
             lamps",
            if *num == 1 { " lights" } else { "s light" },
        )),
        TrainProgress::Glows { num, num_shades } => {
            if *num > 0 {
                reporter.note(&format!(
                    "{num} surface{} that no mask shows {} brighter than can be reflected, and \
                     emit{}: see \"glow-*\" in the list of lamps",
                    if *num == 1 { "" } else { "s" },
                    if *num == 1 { "is" } else { "are" },
                    if *num == 1 { "s" } else { "" },
                ));
            }
            if *num_shades > 0 {
                reporter.note(&format!(
                    "{num_shades} surface{} around lamps {} brighter than can be reflected, and \
                     emit{} with them",
                    if *num_shades == 1 { "" } else { "s" },
                    if *num_shades == 1 { "is" } else { "are" },
                    if *num_shades == 1 { "s" } else { "" },
                ));
            }
        }
        // For pages; there is nothing to print.
        TrainProgress::Scene { .. } => return Ok(()),
        TrainProgress::AlbedosLimited { num: 0 } | TrainProgress::Checkpoint { .. } => {}
        TrainProgress::AlbedosLimited { num } => reporter.note(&format!(
            "{num} Gaussians are of surfaces that reflected more than they receive, and are darker"
        )),
        TrainProgress::AlbedosBalanced { scale, num_limited } => {
            if *num_limited > 0 {
                reporter.note(&format!(
                    "{num_limited} Gaussians, whose light grew with each bounce, are darker"
                ));
            }
            reporter.note(&format!(
                "albedos are {scale:.3} times as large, by the light of all bounces"
            ));
        }
        TrainProgress::Preview {
            iteration,
            psnr_srgb_db,
            ..
        } => reporter.note(&format!(
            "previews at iteration {iteration}: PSNR {psnr_srgb_db:.2} dB"
        )),
        TrainProgress::Warning { text } => reporter.warning(text),
    }
    reporter.message(message)
}

/// Says which surfaces are glossy, how much, and how well that is supported.
fn tell_gloss(reporter: &mut Reporter, surfaces: &[GlossySurface]) {
    if surfaces.is_empty() {
        return reporter.note("no glossy surface");
    }
    let area: f32 = surfaces.iter().map(|surface| surface.area_share).sum();
    reporter.note(&format!(
        "{} glossy surface{}, {:.1} % of the area seen",
        surfaces.len(),
        if surfaces.len() == 1 { "" } else { "s" },
        100.0 * area
    ));
    for surface in surfaces.iter().take(MOST_TOLD) {
        let [x, y, z] = surface.centre;
        let [r, g, b] = surface.specular;
        reporter.note(&format!(
            "  around ({x:.2}, {y:.2}, {z:.2}), {:.2} %: F0 {r:.3} {g:.3} {b:.3}, roughness {:.2}; \
             explains {:.0} % of the differences between views ({:.0} % foretold)",
            100.0 * surface.area_share,
            surface.roughness,
            100.0 * surface.explained,
            100.0 * surface.foretold
        ));
    }
}

/// Shows how far the light of the finished scene is solved.
fn tell_own_light(
    reporter: &mut Reporter,
    step: &BakeProgress,
    message: &TrainProgress,
) -> Result<()> {
    let (steps, task) = match *step {
        BakeProgress::Looking { done, total } => ((done, total), ("own light: surfaces", "views")),
        BakeProgress::Gathering { done, total } => {
            ((done, total), ("own light: rays", "Gaussians"))
        }
        _ => return reporter.message(message),
    };
    reporter.count(task, steps, message)
}
