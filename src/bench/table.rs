//! The figures as a table for people.

use super::results::{Change, Results, Verdict};
use super::sheet::{Row, Unit};
use crate::terminal;

/// The table of all rows, against `baseline` where there is one.
pub(super) fn text(results: &Results, baseline: Option<&Results>) -> String {
    let rows = &results.rows;
    let scales = rows.iter().any(|row| row.threads != rows[0].threads);
    let mut heading = vec![
        "stage",
        "what",
        "Gaussians",
        "threads",
        "median",
        "min",
        "max",
        "runs",
        "MiB",
    ];
    let has_device = rows.iter().any(|row| row.device_memory_mib.is_some());
    if has_device {
        heading.push("GPU MiB");
    }
    if scales {
        heading.push("by threads");
    }
    if baseline.is_some() {
        heading.extend(["before", "ratio", ""]);
    }
    let mut lines = vec![heading.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    for row in rows {
        let figure = |value: f64| figure(row.unit, value);
        let memory = |mib: Option<f64>| mib.map_or_else(String::new, |mib| format!("{mib:.0}"));
        let mut line = vec![
            row.stage.clone(),
            row.what.clone(),
            row.gaussians
                .map_or_else(String::new, |num| num.to_string()),
            row.threads.to_string(),
            figure(row.median),
            figure(row.min),
            figure(row.max),
            row.runs.to_string(),
            memory(row.peak_memory_mib),
        ];
        if has_device {
            line.push(memory(row.device_memory_mib));
        }
        if scales {
            line.push(scaling(row, rows));
        }
        if baseline.is_some() {
            let change = Change::of(row, baseline);
            line.push(change.before.map_or_else(String::new, figure));
            line.push(
                change
                    .ratio
                    .map_or_else(String::new, |ratio| format!("{ratio:.2}")),
            );
            line.push(match change.verdict {
                Verdict::Faster => "faster".to_owned(),
                Verdict::Slower => "SLOWER".to_owned(),
                Verdict::Same => String::new(),
                Verdict::New => "new".to_owned(),
            });
        }
        lines.push(line);
    }
    terminal::columns(&lines, 2)
}

/// Factor by which a row is faster than the same with the fewest threads.
fn scaling(row: &Row, rows: &[Row]) -> String {
    let same = rows.iter().filter(|other| other.is_of(row));
    same.min_by_key(|other| other.threads)
        .filter(|fewest| fewest.threads < row.threads)
        .map_or_else(String::new, |fewest| {
            format!("{:.2}x", row.unit.ratio(fewest.median, row.median))
        })
}

/// Three digits and a unit, as `1.23 Mrays/s` or `45.6 ms`.
pub(crate) fn figure(unit: Unit, value: f64) -> String {
    const PREFIXES: [(f64, &str); 7] = [
        (1e9, "G"),
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
        (1e-9, "n"),
    ];
    let found = PREFIXES.into_iter().find(|(factor, _)| value >= *factor);
    let (factor, prefix) = found.unwrap_or((1.0, ""));
    let scaled = value / factor;
    let digits = match scaled {
        _ if scaled >= 99.95 => 0,
        _ if scaled >= 9.995 => 1,
        _ => 2,
    };
    format!("{scaled:.digits$} {prefix}{}", unit.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_three_digits() {
        assert_eq!(figure(Unit::Rays, 1_234_567.0), "1.23 Mrays/s");
        assert_eq!(figure(Unit::Seconds, 0.0456), "45.6 ms");
        assert_eq!(figure(Unit::Bytes, 234e6), "234 MB/s");
        assert_eq!(figure(Unit::Iterations, 3.0), "3.00 it/s");
        assert_eq!(figure(Unit::Iterations, 0.0), "0.00 it/s");
    }
}
