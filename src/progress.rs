//! Progress of long jobs: a bar on a terminal, lines of text now and then elsewhere, or JSON.

use crate::args::GlobalArgs;
use crate::failpoint;
use crate::terminal::{self, BARS};
use anyhow::Result;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between lines: a log of an hour stays readable.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// Tasks that end sooner get no line: nobody waited for them, and their rate means nothing.
const MOMENT: Duration = Duration::from_secs(1);
/// Time between JSON messages of the same bar.
const JSON_EVERY: Duration = Duration::from_millis(250);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Style {
    Bar,
    Lines,
    Json,
    Quiet,
}

/// Where a job's messages go.
pub(crate) struct Reporter {
    style: Style,
    task: Option<Task>,
}

/// The work under way.
struct Task {
    name: String,
    unit: &'static str,
    bar: Option<ProgressBar>,
    /// Steps that were done before this process began, as after a resume; they do not count for the
    /// rate.
    first: u64,
    total: u64,
    started: Instant,
    told: Instant,
    /// Whether the last line has been printed.
    ended: bool,
}

impl Reporter {
    pub(crate) fn new(global: &GlobalArgs) -> Self {
        let style = match (global.json, global.quiet) {
            (true, _) => Style::Json,
            (_, true) => Style::Quiet,
            _ if std::io::stderr().is_terminal() => Style::Bar,
            _ => Style::Lines,
        };
        Self { style, task: None }
    }

    /// Runs a job and shows its messages one by one by `tell`. A message that cannot be shown is an
    /// error only after the job: its work counts.
    ///
    /// # Errors
    /// The job's, or the first of `tell`.
    pub(crate) fn follow<M, T, E: Into<anyhow::Error>>(
        &mut self,
        mut tell: impl FnMut(&mut Self, &M) -> Result<()>,
        job: impl FnOnce(&mut dyn FnMut(M)) -> Result<T, E>,
    ) -> Result<T> {
        let mut untold = None;
        let outcome = job(&mut |message| {
            if let Err(error) = tell(self, &message) {
                untold.get_or_insert(error);
            }
        });
        self.finish();
        let outcome = outcome.map_err(Into::into)?;
        untold.map_or(Ok(outcome), Err)
    }

    /// Begins a task of `total` steps, `done` of which are done.
    pub(crate) fn begin(&mut self, name: &str, unit: &'static str, done: u64, total: u64) {
        self.finish();
        let bar = (self.style == Style::Bar).then(|| {
            let bar = BARS.add(ProgressBar::new(total).with_position(done));
            let template = "{prefix:>9} {bar:28} {pos}/{len} {unit} {per_sec}, {eta} left  {msg}"
                .replace("{unit}", unit);
            // The template is a constant; should it not parse, indicatif's own bar does as well.
            let style = ProgressStyle::with_template(&template)
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            bar.set_style(style);
            bar.set_prefix(name.to_owned());
            bar.reset_eta();
            bar.enable_steady_tick(Duration::from_millis(500));
            bar
        });
        let now = Instant::now();
        self.task = Some(Task {
            name: name.to_owned(),
            unit,
            bar,
            first: done,
            total,
            started: now,
            told: now,
            ended: false,
        });
    }

    /// Notes that `done` steps are done; `note` says how it goes.
    pub(crate) fn advance(&mut self, done: u64, note: impl FnOnce() -> String) {
        let Some(task) = &mut self.task else { return };
        failpoint::pass(&task.name);
        if let Some(bar) = &task.bar {
            bar.set_position(done);
            bar.set_message(note());
        } else if self.style == Style::Lines && task.is_due(done, Instant::now()) {
            terminal::line(&task.line(done, &note()));
        }
    }

    /// Shows that `done` of `total` steps of the task `name` are done, which begins with the first
    /// message of them, and writes `message`.
    ///
    /// # Errors
    /// As [`Self::step_message`].
    pub(crate) fn count(
        &mut self,
        task: (&str, &'static str),
        steps: (usize, usize),
        message: &impl Serialize,
    ) -> Result<()> {
        self.count_with(task, steps, String::new, message)
    }

    /// As [`Self::count`]; `note` says how it goes.
    ///
    /// # Errors
    /// As [`Self::step_message`].
    pub(crate) fn count_with(
        &mut self,
        (name, unit): (&str, &'static str),
        (done, total): (usize, usize),
        note: impl FnOnce() -> String,
        message: &impl Serialize,
    ) -> Result<()> {
        self.show((name, unit), (done as u64, total as u64), note);
        self.step_message(done as u64, message)
    }

    /// As [`Self::count_with`], without a message.
    pub(crate) fn show(
        &mut self,
        (name, unit): (&str, &'static str),
        (done, total): (u64, u64),
        note: impl FnOnce() -> String,
    ) {
        if done <= 1 || self.task.as_ref().is_none_or(|task| task.name != name) {
            // Steps before the first that is told are of an earlier process: no rate has them.
            self.begin(name, unit, done.saturating_sub(1), total);
        }
        self.advance(done, note);
    }

    /// Ends the task.
    pub(crate) fn finish(&mut self) {
        if let Some(Task { bar: Some(bar), .. }) = self.task.take() {
            bar.finish();
        }
    }

    /// Shows a note that is not progress.
    pub(crate) fn note(&self, text: &str) {
        if matches!(self.style, Style::Bar | Style::Lines) {
            terminal::line(text);
        }
    }

    /// Returns whether output is JSON: messages and no lines.
    pub(crate) fn is_json(&self) -> bool {
        self.style == Style::Json
    }

    /// Warns.
    pub(crate) fn warning(&self, text: &str) {
        self.note(&format!("warning: {text}"));
    }

    /// Writes a message for machines, if they are who listens.
    ///
    /// # Errors
    /// If standard output cannot be written.
    pub(crate) fn message(&self, message: &impl Serialize) -> Result<()> {
        if self.style != Style::Json {
            return Ok(());
        }
        let mut text = serde_json::to_string(message)?;
        text.push('\n');
        terminal::print(&text)
    }

    /// Writes a message for machines: what it is, and its content.
    ///
    /// # Errors
    /// As [`Self::message`].
    pub(crate) fn tagged(&self, message: &str, content: &impl Serialize) -> Result<()> {
        #[derive(Serialize)]
        struct Tagged<'a, T> {
            message: &'a str,
            #[serde(flatten)]
            content: &'a T,
        }
        self.message(&Tagged { message, content })
    }

    /// As [`Self::message`] for messages that come with every step: most of them are left out.
    ///
    /// # Errors
    /// If standard output cannot be written.
    pub(crate) fn step_message(&mut self, done: u64, message: &impl Serialize) -> Result<()> {
        if self.style != Style::Json {
            return Ok(());
        }
        if let Some(task) = &mut self.task {
            let first = done == task.first + 1;
            if !first && done != task.total && task.told.elapsed() < JSON_EVERY {
                return Ok(());
            }
            task.told = Instant::now();
        }
        self.message(message)
    }
}

impl Task {
    /// Whether a line is to be printed when `done` steps are done: now and then, and once at the
    /// end of a task that took longer than a moment.
    fn is_due(&mut self, done: u64, now: Instant) -> bool {
        let ends = done >= self.total;
        let is_due = !self.ended
            && if ends {
                now.duration_since(self.started) >= MOMENT
            } else {
                now.duration_since(self.told) >= LINE_EVERY
            };
        self.ended |= ends;
        if is_due {
            self.told = now;
        }
        is_due
    }

    fn line(&self, done: u64, note: &str) -> String {
        let seconds = self.started.elapsed().as_secs_f64().max(1e-9);
        let rate = done.saturating_sub(self.first) as f64 / seconds;
        let mut text = format!(
            "{}: {done}/{} {}, {rate:.2}/s",
            self.name, self.total, self.unit
        );
        if done < self.total && rate > 0.0 {
            let left = (self.total - done) as f64 / rate;
            text += &format!(", {} left", duration(left));
        }
        if !note.is_empty() {
            text += &format!(", {note}");
        }
        text
    }
}

/// A duration for people.
pub(crate) fn duration(seconds: f64) -> String {
    // Beyond a century nobody needs the minutes, and the cast stays exact.
    let seconds = seconds.clamp(0.0, 3.2e9).round() as u64;
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    match (hours, minutes) {
        (0, 0) => format!("{seconds} s"),
        (0, _) => format!("{minutes} min {} s", seconds % 60),
        _ => format!("{hours} h {minutes} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_short() {
        for (seconds, text) in [
            (0.4, "0 s"),
            (59.6, "1 min 0 s"),
            (3599.0, "59 min 59 s"),
            (7322.0, "2 h 2 min"),
            (f64::INFINITY, "888888 h 53 min"),
        ] {
            assert_eq!(duration(seconds), text);
        }
    }

    fn task(started: Instant) -> Task {
        Task {
            name: "radiance".into(),
            unit: "iterations",
            bar: None,
            first: 900,
            total: 1000,
            started,
            told: started,
            ended: false,
        }
    }

    #[test]
    fn lines_come_now_and_then_and_once_at_the_end() {
        let start = Instant::now();
        let after = |seconds: f64| start + Duration::from_secs_f64(seconds);
        let mut slow = task(start);
        let due = [
            (901, 0.1),
            (902, 9.9),
            (903, 10.0),
            (904, 19.9),
            (999, 20.1),
            (1000, 20.2),
            (1000, 40.0),
        ]
        .map(|(done, seconds)| slow.is_due(done, after(seconds)));
        assert_eq!(due, [false, false, true, false, true, true, false]);
        // Over in a moment, whatever comes after.
        let mut fast = task(start);
        assert!(!fast.is_due(1000, after(0.9)) && !fast.is_due(1000, after(30.0)));
    }

    #[test]
    fn the_rate_leaves_out_what_an_earlier_process_did() {
        let task = task(Instant::now() - Duration::from_secs(10));
        let line = task.line(950, "loss 0.1");
        assert_eq!(
            line,
            "radiance: 950/1000 iterations, 5.00/s, 10 s left, loss 0.1"
        );
    }
}
