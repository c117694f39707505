//! `eagpt train --view`: the training on a page.

use crate::page::ScenePage;
use crate::progress::Reporter;
use anyhow::Result;
use eagpt_scene::Gaussians;
use eagpt_train::{TrainProgress, TrainRequest};
use eagpt_viewer::page::PageKind;
use eagpt_viewer::server::{Server, Training, listen};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time that pages have for the last scene, at least, …
const LAST_LOOK: Duration = Duration::from_secs(2);
/// … and at most: on a busy machine a page may be drawing.
const LONGEST_LAST_LOOK: Duration = Duration::from_mins(1);

/// A server for pages that watch a training, once that has a scene.
pub(super) struct Viewing<'a> {
    request: &'a TrainRequest,
    state: State,
}

enum State {
    /// Listens, and has nothing to show yet.
    Waits(TcpListener),
    Shows {
        training: Arc<Training>,
        stop: Arc<AtomicBool>,
        thread: JoinHandle<eagpt_viewer::Result<()>>,
    },
    /// Nobody can watch: the user was told why.
    Failed,
}

impl<'a> Viewing<'a> {
    /// Listens at a port of this machine.
    ///
    /// # Errors
    /// If the port is taken.
    pub(super) fn new(request: &'a TrainRequest, port: u16) -> Result<Self> {
        let listener = listen(SocketAddr::from((Ipv4Addr::LOCALHOST, port)))?;
        Ok(Self {
            request,
            state: State::Waits(listener),
        })
    }

    /// Shows what a message of the job tells. That nothing can be shown does not end a training.
    ///
    /// # Errors
    /// If standard output cannot be written.
    pub(super) fn take(&mut self, reporter: &mut Reporter, message: &TrainProgress) -> Result<()> {
        match (&self.state, message) {
            (State::Shows { training, .. }, TrainProgress::Scene { scene }) => {
                training.show(Arc::clone(scene));
            }
            (
                State::Shows { training, .. },
                TrainProgress::Iteration {
                    stage,
                    iteration,
                    total,
                    loss,
                },
            ) => training.note(stage.name(), (*iteration, *total), *loss),
            (State::Waits(_), TrainProgress::Scene { scene }) => {
                match self.begin(scene) {
                    Ok(url) => {
                        reporter.note(&format!("the training: {url}"));
                        reporter
                            .message(&serde_json::json!({ "message": "listening", "url": url }))?;
                    }
                    Err(error) => reporter.warning(&format!("--view: {error:#}")),
                };
            }
            _ => {}
        }
        Ok(())
    }

    /// Serves the page of a first scene, whose address is returned.
    fn begin(&mut self, scene: &Arc<Gaussians>) -> Result<String> {
        let State::Waits(listener) = std::mem::replace(&mut self.state, State::Failed) else {
            anyhow::bail!("it has begun already");
        };
        let out = self.request.out.file_name().unwrap_or_default();
        let title = out.to_string_lossy().into_owned();
        let page = ScenePage::of_training(scene, &self.request.dataset, title)?;
        let page = page.html(scene, PageKind::Training)?;
        let training = Arc::new(Training::new(Arc::clone(scene)));
        let server = Server::watching(listener, page, &training)?;
        let (url, stop) = (server.url(), Arc::<AtomicBool>::default());
        let flag = Arc::clone(&stop);
        let thread = std::thread::spawn(move || server.run(&flag));
        self.state = State::Shows {
            training,
            stop,
            thread,
        };
        Ok(url)
    }

    /// Tells pages how the training has ended, and no longer serves them.
    pub(super) fn end(self, how: &str, reporter: &Reporter) {
        let State::Shows {
            training,
            stop,
            thread,
        } = self.state
        else {
            return;
        };
        training.end(how);
        if training.is_watched() {
            // They ask for the last scene; several pages do not ask at once.
            std::thread::sleep(LAST_LOOK);
            training.wait_for_pages(LONGEST_LAST_LOOK);
        }
        stop.store(true, Ordering::Relaxed);
        match thread.join() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => reporter.warning(&format!("--view: {error}")),
            Err(_) => reporter.warning("--view: the server has failed"),
        }
    }
}
