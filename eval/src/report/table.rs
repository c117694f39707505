//! Tables for people: Markdown, and LaTeX with booktabs.

use super::append;
use crate::job::{Evaluation, Mean};
use crate::metrics::{Better, MeanOf};

/// A Markdown table of all views and their mean, and below it what the numbers rest on.
pub(super) fn markdown(evaluation: &Evaluation) -> String {
    let headings = evaluation.means.iter().map(|mean| {
        let arrow = match mean.metric.better {
            Better::Higher => "↑",
            Better::Lower => "↓",
        };
        format!("{} {arrow}", mean.metric.heading)
    });
    let mut text = format!("| view |{}\n", cells(headings));
    append(
        &mut text,
        format_args!("|---|{}\n", "---:|".repeat(evaluation.means.len())),
    );
    for (name, values) in rows(evaluation) {
        append(
            &mut text,
            format_args!(
                "| {} |{}\n",
                name.replace('|', "\\|"),
                cells(values.into_iter())
            ),
        );
    }
    let means = evaluation
        .means
        .iter()
        .map(|mean| format!("**{}**", shown(mean, Some(mean.value))));
    append(&mut text, format_args!("| **mean** |{}\n\n", cells(means)));
    for note in notes(evaluation) {
        append(&mut text, format_args!("- {note}\n"));
    }
    text
}

/// The same for `\input`; needs the package booktabs.
pub(super) fn latex(evaluation: &Evaluation) -> String {
    let headings = evaluation.means.iter().map(|mean| {
        let arrow = match mean.metric.better {
            Better::Higher => "$\\uparrow$",
            Better::Lower => "$\\downarrow$",
        };
        format!("{} {arrow}", escaped(mean.metric.heading))
    });
    let mut text = String::new();
    for note in notes(evaluation) {
        append(&mut text, format_args!("% {note}\n"));
    }
    append(
        &mut text,
        format_args!(
            "\\begin{{tabular}}{{l{}}}\n\\toprule\n",
            "r".repeat(evaluation.means.len())
        ),
    );
    latex_row(&mut text, "View", headings.collect());
    text.push_str("\\midrule\n");
    for (name, values) in rows(evaluation) {
        latex_row(&mut text, &escaped(&name), values);
    }
    text.push_str("\\midrule\n");
    let means = evaluation
        .means
        .iter()
        .map(|mean| shown(mean, Some(mean.value)));
    latex_row(&mut text, "Mean", means.collect());
    text.push_str("\\bottomrule\n\\end{tabular}\n");
    text
}

/// Name and shown values of each view.
fn rows(evaluation: &Evaluation) -> impl Iterator<Item = (String, Vec<String>)> {
    evaluation.views.iter().map(|view| {
        let values = evaluation
            .means
            .iter()
            .map(|mean| shown(mean, (mean.metric.of)(view)));
        (view.name.clone(), values.collect())
    })
}

/// A rounded value; `inf` for equal images, a dash where there is none.
fn shown(mean: &Mean, value: Option<f64>) -> String {
    value.map_or_else(
        || "--".to_owned(),
        |value| format!("{value:.*}", mean.metric.num_decimals),
    )
}

/// What has to be known to compare the numbers with others.
fn notes(evaluation: &Evaluation) -> Vec<String> {
    let num_views = evaluation.views.len();
    let mut notes = vec![format!(
        "split {}, subset {}, views: {num_views}",
        evaluation.split, evaluation.subset
    )];
    if let Some(view) = evaluation.views.first() {
        let flip = &view.image.flip_hdr_parameters;
        notes.push(format!(
            "FLIP: {:.2} pixels per degree, {} tone curve; the exposures of each view are in metrics.json",
            flip.ppd,
            flip.tonemapper.name()
        ));
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

fn cells(values: impl Iterator<Item = String>) -> String {
    values.map(|value| format!(" {value} |")).collect()
}

fn latex_row(text: &mut String, name: &str, values: Vec<String>) {
    text.push_str(name);
    for value in values {
        append(text, format_args!(" & {value}"));
    }
    text.push_str(" \\\\\n");
}

/// Text with LaTeX's own characters made harmless.
fn escaped(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '_' | '&' | '%' | '$' | '#' | '{' | '}' => format!("\\{c}"),
            '\\' => "\\textbackslash{}".to_owned(),
            '~' => "\\textasciitilde{}".to_owned(),
            '^' => "\\textasciicircum{}".to_owned(),
            _ => c.to_string(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latex_characters_are_escaped() {
        assert_eq!(escaped("10/a_b 50%"), "10/a\\_b 50\\%");
        assert_eq!(escaped("\\^"), "\\textbackslash{}\\textasciicircum{}");
    }
}
