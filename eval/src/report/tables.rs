//! The tables of views, of regions and of conditions.

use super::grid::{Column, Grid, shown};
use crate::evaluation::{Conditions, Evaluation, Mean};
use crate::metrics::MeanOf;
use crate::view::EmittersFrom;

/// All views and their mean.
pub(super) fn views(evaluation: &Evaluation) -> Grid {
    let rows = evaluation.views.iter().map(|view| {
        let of_view = |mean: &Mean| shown((mean.metric.of)(view), mean.metric.num_decimals);
        let values = evaluation.means.iter().map(of_view);
        (view.name.clone(), values.collect())
    });
    Grid {
        corner: "view",
        groups: Vec::new(),
        columns: columns(&evaluation.means),
        rows: rows.collect(),
        mean: Some(mean_row(&evaluation.means)),
        notes: notes(evaluation),
    }
}

/// The error by region; `None` where no region is known.
pub(super) fn regions(evaluation: &Evaluation) -> Option<Grid> {
    if evaluation.regions.is_empty() {
        return None;
    }
    let columns = [
        "share (%)",
        "PSNR sRGB ↑",
        "PSNR linear ↑",
        "luminance of reference",
        "of render",
    ];
    let rows = evaluation.regions.iter().map(|(region, metrics)| {
        let values = [
            (100.0 * metrics.share, 2),
            (metrics.psnr_srgb_db, 2),
            (metrics.psnr_linear_db, 2),
            (metrics.luminance_reference, 4),
            (metrics.luminance_render, 4),
        ];
        let values = values.map(|(value, num_decimals)| shown(Some(value), num_decimals));
        (region.name().to_owned(), values.to_vec())
    });
    let mut notes = vec!["regions: over the pixels of all views".to_owned()];
    if let Some(change) = evaluation.light_change {
        notes.push(format!(
            "lit: luminance above {change:.4} times that under the earlier light, the change of all surfaces together"
        ));
    }
    let from_renders = |from: &Option<EmittersFrom>| *from == Some(EmittersFrom::Render);
    let num = evaluation
        .views
        .iter()
        .filter(|view| from_renders(&view.emitters_from));
    match num.count() {
        0 => {}
        num => notes.push(format!(
            "emitters: from the emission of the renders in {num} of {} views, whose references have no mask",
            evaluation.views.len()
        )),
    }
    Some(Grid {
        corner: "region",
        groups: Vec::new(),
        columns: columns
            .map(|heading| Column {
                heading: heading.to_owned(),
                better: None,
            })
            .into(),
        rows: rows.collect(),
        mean: None,
        notes,
    })
}

/// The means of all conditions, and the mean of these.
pub(super) fn conditions(found: &Conditions) -> Grid {
    let rows = found.conditions.iter().map(|condition| {
        let of_condition = |mean: &Mean| {
            let value = condition.mean(mean.metric.key);
            shown(value, mean.metric.num_decimals)
        };
        let values = found.means.iter().map(of_condition);
        (condition.name.clone(), values.collect())
    });
    let notes = found.conditions.iter().flat_map(|condition| {
        let notes = notes(condition).into_iter();
        notes.map(|note| format!("{}: {note}", condition.name))
    });
    Grid {
        corner: "condition",
        groups: Vec::new(),
        columns: columns(&found.means),
        rows: rows.collect(),
        mean: Some(mean_row(&found.means)),
        notes: notes.collect(),
    }
}

fn columns(means: &[Mean]) -> Vec<Column> {
    means.iter().map(|mean| Column::of(mean.metric)).collect()
}

fn mean_row(means: &[Mean]) -> Vec<String> {
    means
        .iter()
        .map(|mean| shown(Some(mean.value), mean.metric.num_decimals))
        .collect()
}

/// Notes needed to compare the numbers with others.
fn notes(evaluation: &Evaluation) -> Vec<String> {
    let num_views = evaluation.views.len();
    let mut notes = vec![match (evaluation.split, evaluation.subset) {
        (Some(split), Some(subset)) => {
            format!("split {split}, subset {subset}, views: {num_views}")
        }
        _ => format!("views: {num_views} of {} rendered", evaluation.num_rendered),
    }];
    if let Some(view) = evaluation.views.first() {
        let flip = &view.image.flip_hdr_parameters;
        notes.push(format!(
            "FLIP: {:.2} pixels per degree, {} tone curve; the exposures of each view are in metrics.json",
            flip.ppd,
            flip.tonemapper.name()
        ));
    }
    if let Some(scale) = evaluation.exposure_scale {
        notes.push(format!("aligned: renders multiplied by {scale:.4}"));
    }
    let partial = evaluation.means.iter().filter(|m| m.num_views < num_views);
    notes.extend(partial.map(|mean| {
        let over = match mean.metric.mean {
            MeanOf::Views => "",
            MeanOf::Pixels(_) => "all pixels of ",
        };
        format!(
            "{}: mean over {over}{} of {num_views} views",
            mean.metric.heading, mean.num_views
        )
    }));
    let warnings = evaluation.warnings.iter();
    notes.extend(warnings.map(|text| format!("warning: {text}")));
    notes
}
