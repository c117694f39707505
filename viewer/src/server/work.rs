//! Jobs of a server, one at a time: the light of a scene that was changed is baked anew, stills are
//! path-traced.

use super::board::{Light, Shown, StillState};
use super::editor::Editor;
use crate::still::StillRequest;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often pages are told of progress.
const TELL_EVERY: Duration = Duration::from_millis(250);

/// A job to do next.
enum Job {
    Bake(Arc<Shown>, Arc<AtomicBool>),
    Still(usize, StillRequest),
}

/// Works until the server stops.
pub(super) fn run(editor: &Editor) {
    while let Some(job) = next(editor) {
        match job {
            Job::Bake(scene, stop) => bake(editor, &scene, &stop),
            Job::Still(index, request) => still(editor, index, &request),
        }
    }
}

/// Waits for something to do; `None` when the server stops.
fn next(editor: &Editor) -> Option<Job> {
    let mut board = editor.board();
    loop {
        if editor.is_stopping.load(Ordering::Relaxed) {
            return None;
        }
        let waiting = editor.orders().pop_front();
        if let Some((index, request)) = waiting {
            board.stills[index].state = StillState::Rendering { seconds: None };
            board.revision += 1;
            editor.changed.notify_all();
            return Some(Job::Still(index, request));
        }
        if board.light == Light::Waiting {
            board.stop_bake = Arc::default();
            let task = "the bake begins".to_owned();
            board.light = Light::Baking { task, share: 0.0 };
            board.revision += 1;
            editor.changed.notify_all();
            let stop = Arc::clone(&board.stop_bake);
            return Some(Job::Bake(Arc::clone(&board.shown), stop));
        }
        board = editor.wait(board);
    }
}

fn bake(editor: &Editor, scene: &Shown, stop: &Arc<AtomicBool>) {
    let mut told = Instant::now();
    let mut tell = |task: &str, share: f64| {
        if told.elapsed() < TELL_EVERY {
            return;
        }
        told = Instant::now();
        let mut board = editor.board();
        // Of a bake that another act has ended nobody wants to hear.
        if board.shown.id == scene.id && !stop.load(Ordering::Relaxed) {
            let task = task.to_owned();
            board.light = Light::Baking { task, share };
            board.revision += 1;
            editor.changed.notify_all();
        }
    };
    let baked = editor.workshop.bake(&scene.gaussians, stop, &mut tell);
    let mut board = editor.board();
    // Who has stopped it has said what the light is.
    if stop.load(Ordering::Relaxed) {
        return;
    }
    let shown = baked.and_then(|baked| match baked {
        Some(baked) => board.show_baked(Arc::new(baked), &editor.original.lamps),
        None => Ok(()),
    });
    if let Err(error) = shown {
        let problem = error.to_string();
        board.light = Light::Stale { problem };
    }
    board.revision += 1;
    editor.changed.notify_all();
}

fn still(editor: &Editor, index: usize, request: &StillRequest) {
    let started = Instant::now();
    let file: PathBuf = editor.board().stills[index].file.clone();
    // The script as it is now, its lights included.
    let scene = editor.edit().edited();
    let set = |state: StillState| {
        let mut board = editor.board();
        board.stills[index].state = state;
        board.revision += 1;
        editor.changed.notify_all();
    };
    let mut expected = |seconds| {
        let seconds = Some(seconds);
        set(StillState::Rendering { seconds });
    };
    let done = scene.and_then(|scene| editor.workshop.still(&scene, request, &file, &mut expected));
    set(match done {
        Ok(()) => StillState::Done {
            seconds: started.elapsed().as_secs_f64(),
        },
        Err(error) => StillState::Failed {
            problem: error.to_string(),
        },
    });
}
