//! Tables for people: Markdown, and LaTeX with booktabs.

use super::append;
use crate::metrics::{Better, Metric};

/// A table of texts.
#[derive(Debug)]
pub(crate) struct Grid {
    /// Heading of the names of rows, lower case.
    pub(crate) corner: &'static str,
    /// Headings above those of columns, each over a number of columns; empty if there are none.
    pub(crate) groups: Vec<(String, usize)>,
    pub(crate) columns: Vec<Column>,
    /// Name and cells of each row.
    pub(crate) rows: Vec<(String, Vec<String>)>,
    /// Cells of a last row of means.
    pub(crate) mean: Option<Vec<String>>,
    /// Notes needed to compare the numbers with others.
    pub(crate) notes: Vec<String>,
}

/// The heading of a column.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    pub(crate) heading: String,
    pub(crate) better: Option<Better>,
}

impl Column {
    pub(crate) fn of(metric: &Metric) -> Self {
        Self {
            heading: metric.heading.to_owned(),
            better: Some(metric.better),
        }
    }
}

/// A rounded value; `inf` for equal images, a dash where there is none.
pub(crate) fn shown(value: Option<f64>, num_decimals: usize) -> String {
    value.map_or_else(
        || "--".to_owned(),
        |value| format!("{value:.num_decimals$}"),
    )
}

impl Grid {
    /// A Markdown table, and below it the notes. Markdown has one line of headings: a group stands
    /// before each of its own.
    pub(crate) fn markdown(&self) -> String {
        let groups = self.groups.iter();
        let mut groups = groups.flat_map(|(name, num)| std::iter::repeat_n(name.as_str(), *num));
        let headings = self.columns.iter().map(|column| {
            let arrow = match column.better {
                Some(Better::Higher) => " ↑",
                Some(Better::Lower) => " ↓",
                Some(Better::One) => " → 1",
                None => "",
            };
            let heading = format!("{}{arrow}", column.heading);
            match groups.next() {
                Some(group) if !group.is_empty() => format!("{}: {heading}", piped(group)),
                _ => heading,
            }
        });
        let mut text = format!("| {} |{}\n", self.corner, cells(headings));
        append(
            &mut text,
            format_args!("|---|{}\n", "---:|".repeat(self.columns.len())),
        );
        for (name, values) in &self.rows {
            let values = cells(values.iter().cloned());
            append(&mut text, format_args!("| {} |{values}\n", piped(name)));
        }
        if let Some(mean) = &self.mean {
            let values = cells(mean.iter().map(|value| format!("**{value}**")));
            append(&mut text, format_args!("| **mean** |{values}\n"));
        }
        text.push('\n');
        for note in &self.notes {
            append(&mut text, format_args!("- {note}\n"));
        }
        text
    }

    /// The same for `\input`; needs the package booktabs.
    pub(crate) fn latex(&self) -> String {
        let headings = self.columns.iter().map(|column| {
            let arrow = match column.better {
                Some(Better::Higher) => " $\\uparrow$",
                Some(Better::Lower) => " $\\downarrow$",
                Some(Better::One) => " $\\to 1$",
                None => "",
            };
            format!("{}{arrow}", escaped(&column.heading))
        });
        let mut text = String::new();
        for note in &self.notes {
            append(&mut text, format_args!("% {note}\n"));
        }
        let alignment = "r".repeat(self.columns.len());
        append(
            &mut text,
            format_args!("\\begin{{tabular}}{{l{alignment}}}\n\\toprule\n"),
        );
        self.latex_groups(&mut text);
        latex_row(&mut text, &capitalised(self.corner), headings);
        text.push_str("\\midrule\n");
        for (name, values) in &self.rows {
            latex_row(&mut text, &escaped(name), values.iter().cloned());
        }
        if let Some(mean) = &self.mean {
            text.push_str("\\midrule\n");
            latex_row(&mut text, "Mean", mean.iter().cloned());
        }
        text.push_str("\\bottomrule\n\\end{tabular}\n");
        text
    }

    fn latex_groups(&self, text: &mut String) {
        if self.groups.is_empty() {
            return;
        }
        let headings = self.groups.iter();
        let headings =
            headings.map(|(name, num)| format!("\\multicolumn{{{num}}}{{c}}{{{}}}", escaped(name)));
        latex_row(text, "", headings);
        let mut first = 2;
        for (name, num) in &self.groups {
            if !name.is_empty() {
                append(
                    text,
                    format_args!("\\cmidrule(lr){{{first}-{}}}", first + num - 1),
                );
            }
            first += num;
        }
        text.push('\n');
    }
}

fn cells(values: impl Iterator<Item = String>) -> String {
    values.map(|value| format!(" {value} |")).collect()
}

fn latex_row(text: &mut String, name: &str, values: impl Iterator<Item = String>) {
    text.push_str(name);
    for value in values {
        append(text, format_args!(" & {value}"));
    }
    text.push_str(" \\\\\n");
}

fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    let first = letters.next().map(|c| c.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

/// Text escaped for a Markdown cell.
fn piped(text: &str) -> String {
    text.replace('|', "\\|")
}

/// Text escaped for LaTeX.
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

    #[test]
    fn groups_stand_above_their_columns() {
        let column = |heading: &str, better| Column {
            heading: heading.to_owned(),
            better,
        };
        let grid = Grid {
            corner: "mode",
            groups: vec![("a_1".to_owned(), 2), (String::new(), 1)],
            columns: vec![
                column("dB", Some(Better::Higher)),
                column("FLIP", Some(Better::Lower)),
                column("s/frame", None),
            ],
            rows: vec![(
                "pa|th".to_owned(),
                vec![
                    shown(Some(1.25), 1),
                    shown(None, 2),
                    shown(Some(f64::INFINITY), 2),
                ],
            )],
            mean: None,
            notes: vec!["a note".to_owned()],
        };
        assert_eq!(
            grid.markdown(),
            "| mode | a_1: dB ↑ | a_1: FLIP ↓ | s/frame |\n|---|---:|---:|---:|\n\
             | pa\\|th | 1.2 | -- | inf |\n\n- a note\n"
        );
        assert_eq!(
            grid.latex(),
            "% a note\n\\begin{tabular}{lrrr}\n\\toprule\n\
             \u{20}& \\multicolumn{2}{c}{a\\_1} & \\multicolumn{1}{c}{} \\\\\n\\cmidrule(lr){2-3}\n\
             Mode & dB $\\uparrow$ & FLIP $\\downarrow$ & s/frame \\\\\n\\midrule\n\
             pa|th & 1.2 & -- & inf \\\\\n\\bottomrule\n\\end{tabular}\n"
        );
    }
}
