//! Curves as SVG.

use std::fmt::Write as _;

/// Width of the drawing, user units.
const WIDTH: f64 = 640.0;
/// Height of the drawing.
const HEIGHT: f64 = 220.0;
/// Room for numbers on the left and below.
const MARGIN: [f64; 2] = [52.0, 26.0];
/// Room above and on the right.
const PADDING: f64 = 10.0;
/// Most points of a curve: no display shows more.
const MAX_POINTS: usize = 600;

/// A drawing of values above 0 over their index `x`, the values on a logarithmic scale; empty
/// without two points.
pub(crate) fn log_curve(points: &[(f64, f64)], x_label: &str, y_label: &str) -> String {
    let usable: Vec<(f64, f64)> = points
        .iter()
        .copied()
        .filter(|(x, y)| x.is_finite() && y.is_finite() && *y > 0.0)
        .collect();
    if usable.len() < 2 {
        return String::new();
    }
    let range = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
    };
    let (x_low, x_high) = range(&mut usable.iter().map(|point| point.0));
    let (y_low, y_high) = range(&mut usable.iter().map(|point| point.1.log10()));
    // A flat curve still needs a scale.
    let (y_low, y_high) = (y_low - 0.02, y_high + 0.02);
    let [left, below] = MARGIN;
    let at_x = |x: f64| left + (x - x_low) / (x_high - x_low).max(1e-12) * (WIDTH - left - PADDING);
    let at_y =
        |y: f64| PADDING + (y_high - y.log10()) / (y_high - y_low) * (HEIGHT - below - PADDING);
    let mut svg = format!(
        "<svg class=\"curve\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{y_label} over {x_label}\">"
    );
    for y in ticks(y_low, y_high) {
        let place = at_y(y);
        push(
            &mut svg,
            format_args!(
                "<line class=\"grid\" x1=\"{left}\" x2=\"{}\" y1=\"{place:.1}\" y2=\"{place:.1}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{y}</text>",
                WIDTH - PADDING,
                left - 6.0,
                place + 4.0
            ),
        );
    }
    for (x, anchor) in [(x_low, "start"), (x_high, "end")] {
        push(
            &mut svg,
            format_args!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{x}</text>",
                at_x(x),
                HEIGHT - 8.0
            ),
        );
    }
    push(
        &mut svg,
        format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x_label}</text>",
            (left + WIDTH - PADDING) / 2.0,
            HEIGHT - 8.0
        ),
    );
    let step = usable.len().div_ceil(MAX_POINTS);
    let mut path = String::new();
    for (i, (x, y)) in usable
        .iter()
        .enumerate()
        .filter(|(i, _)| i % step == 0 || i + 1 == usable.len())
    {
        let command = if i == 0 { 'M' } else { 'L' };
        push(
            &mut path,
            format_args!("{command}{:.1} {:.1}", at_x(*x), at_y(*y)),
        );
    }
    push(&mut svg, format_args!("<path d=\"{path}\"/></svg>"));
    svg
}

/// Values 1, 2 and 5 times powers of ten within a range of logarithms.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = low.floor() as i32..=high.ceil() as i32;
    let all = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(decade)));
    // Ten to a negative power has digits that nobody wants to see.
    all.filter(|tick| (low..=high).contains(&tick.log10()))
        .map(|tick| (tick * 1e9).round() / 1e9)
        .collect()
}

fn push(text: &mut String, more: std::fmt::Arguments<'_>) {
    text.write_fmt(more).expect("strings grow");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(ticks(-1.05, 0.31), [0.1, 0.2, 0.5, 1.0, 2.0]);
    }

    #[test]
    fn a_curve_spans_its_box_and_skips_what_has_no_logarithm() {
        let svg = log_curve(&[(0.0, 1.0), (5.0, 0.0), (10.0, 0.1)], "iteration", "loss");
        assert!(svg.contains("M52.0 "), "{svg}");
        assert_eq!(svg.matches('L').count(), 1);
        assert!(svg.contains("L630.0 "), "{svg}");
        assert!(log_curve(&[(0.0, 1.0)], "x", "y").is_empty());
    }
}
