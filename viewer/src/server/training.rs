//! A training under way, for pages that watch: the scene as it is, and the curve of its loss.
//!
//! | place | |
//! |---|---|
//! | `GET /TOKEN/` | the page |
//! | `GET /TOKEN/state?after=N` | how far it is, as soon as its revision is not N |
//! | `GET /TOKEN/scene?id=N` | the scene that is shown, packed, if it is still N |

use super::reply::{Reply, refused, unprocessable};
use super::request::Request;
use super::site::{LONGEST_WAIT, Site};
use crate::error::Result;
use crate::pack::Pack;
use crate::page;
use eagpt_scene::{Gaussians, Lamps};
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Most points of a curve: more than a panel has pixels.
const MAX_POINTS: usize = 512;
/// How often pages are told of losses.
const TELL_EVERY: Duration = Duration::from_millis(500);

/// A training, told by whoever trains and asked by pages.
#[derive(Debug)]
pub struct Training {
    board: Mutex<Board>,
    changed: Condvar,
    /// The last scene that was packed, by its number.
    packed: Mutex<(u64, Arc<str>)>,
}

#[derive(Debug)]
struct Board {
    revision: u64,
    /// Number of the scene; 0 is that of the page.
    id: u64,
    scene: Arc<Gaussians>,
    stages: Vec<Curve>,
    told: Option<Instant>,
    /// When a page last asked how far it is.
    asked: Option<Instant>,
    /// How it has ended, in words.
    end: Option<String>,
    /// Whether a page has been told of the end.
    is_end_told: bool,
    /// Number of the last scene that a page was given; 0 of none.
    given: u64,
    is_stopping: bool,
}

/// The loss of a stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Curve {
    name: String,
    iteration: u32,
    total: u32,
    loss: f64,
    /// Iterations with their losses, every `stride`-th.
    points: Vec<(u32, f64)>,
    #[serde(skip)]
    stride: u32,
}

impl Curve {
    fn push(&mut self, iteration: u32, loss: f64) {
        (self.iteration, self.loss) = (iteration, loss);
        if !iteration.is_multiple_of(self.stride) {
            return;
        }
        if self.points.len() >= MAX_POINTS {
            self.stride *= 2;
            let stride = self.stride;
            self.points.retain(|(at, _)| at.is_multiple_of(stride));
            if !iteration.is_multiple_of(stride) {
                return;
            }
        }
        self.points.push((iteration, loss));
    }
}

impl Training {
    /// A training whose page comes with `scene`.
    pub fn new(scene: Arc<Gaussians>) -> Self {
        Self {
            board: Mutex::new(Board {
                revision: 0,
                id: 0,
                scene,
                stages: Vec::new(),
                told: None,
                asked: None,
                end: None,
                is_end_told: false,
                given: 0,
                is_stopping: false,
            }),
            changed: Condvar::new(),
            packed: Mutex::new((0, "".into())),
        }
    }

    fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows another scene.
    pub fn show(&self, scene: Arc<Gaussians>) {
        let mut board = self.board();
        board.id += 1;
        board.scene = scene;
        board.revision += 1;
        self.changed.notify_all();
    }

    /// Notes the smoothed loss after an `iteration` of `total` of the stage called `name`.
    pub fn note(&self, name: &str, (iteration, total): (u32, u32), loss: f64) {
        let mut board = self.board();
        if board.stages.last().is_none_or(|stage| stage.name != name) {
            board.stages.push(Curve {
                name: name.to_owned(),
                iteration,
                total,
                loss,
                points: Vec::new(),
                stride: 1,
            });
        }
        if let Some(stage) = board.stages.last_mut() {
            stage.push(iteration, loss);
        }
        if iteration == total || board.told.is_none_or(|told| told.elapsed() >= TELL_EVERY) {
            board.told = Some(Instant::now());
            board.revision += 1;
            self.changed.notify_all();
        }
    }

    /// Tells pages that it has ended, and how.
    pub fn end(&self, how: &str) {
        let mut board = self.board();
        board.end = Some(how.to_owned());
        board.revision += 1;
        self.changed.notify_all();
    }

    /// Whether pages are there that ask how far it is.
    pub fn is_watched(&self) -> bool {
        self.board().is_watched()
    }

    /// Waits, after the end, until a page that watches knows of it and has the last scene; not
    /// longer than `most`.
    pub fn wait_for_pages(&self, most: Duration) {
        let is_behind = |board: &mut Board| board.is_watched() && !board.is_shown_whole();
        let waited = (self.changed).wait_timeout_while(self.board(), most, is_behind);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }

    fn state(&self, request: &Request) -> std::result::Result<Reply, Reply> {
        let after: Option<u64> = request.number("after")?;
        self.board().asked = Some(Instant::now());
        let is_known = |board: &mut Board| Some(board.revision) == after && !board.is_stopping;
        let board = self
            .changed
            .wait_timeout_while(self.board(), LONGEST_WAIT, is_known);
        let (mut board, _) = board.unwrap_or_else(PoisonError::into_inner);
        board.is_end_told |= board.end.is_some();
        self.changed.notify_all();
        Ok(Reply::json("200 OK", &board.state()))
    }

    fn scene(&self, request: &Request) -> std::result::Result<Reply, Reply> {
        let id: Option<u64> = request.number("id")?;
        let (shown, scene) = {
            let board = self.board();
            (board.id, Arc::clone(&board.scene))
        };
        if shown == 0 || id != Some(shown) {
            return Err(refused("404 Not Found", "this scene is not shown"));
        }
        let packed = self.packed(shown, &scene);
        let packed = packed.map_err(|error| unprocessable(&error))?;
        self.board().given = shown;
        self.changed.notify_all();
        Ok(Reply::json_text(&packed))
    }

    /// The packed scene; one page after the other, so that it is packed once.
    fn packed(&self, id: u64, scene: &Gaussians) -> Result<Arc<str>> {
        let mut last = self.packed.lock().unwrap_or_else(PoisonError::into_inner);
        if last.0 != id {
            let pack = Pack::new(scene, &Lamps::default(), None)?;
            *last = (id, page::packed(id, &pack, scene)?.into());
        }
        Ok(Arc::clone(&last.1))
    }
}

impl Board {
    fn is_watched(&self) -> bool {
        self.asked
            .is_some_and(|asked| asked.elapsed() < 2 * LONGEST_WAIT)
    }

    /// Whether a page knows of the end and has the last scene.
    fn is_shown_whole(&self) -> bool {
        self.is_end_told && self.given == self.id
    }

    fn state(&self) -> Value {
        json!({
            "revision": self.revision,
            "scene": self.id,
            "num": self.scene.len(),
            "stages": self.stages,
            "end": self.end,
        })
    }
}

/// A training and its page.
#[derive(Debug)]
pub(super) struct Watched {
    pub(super) page: String,
    pub(super) training: Arc<Training>,
}

impl Site for Watched {
    fn answer(&self, request: &Request, place: &str) -> Reply {
        let answered = match (request.method.as_str(), place) {
            ("GET", "") => Ok(Reply::html(&self.page)),
            ("GET", "state") => self.training.state(request),
            ("GET", "scene") => self.training.scene(request),
            (_, "" | "state" | "scene") => {
                Err(refused("405 Method Not Allowed", "not this method"))
            }
            _ => Err(refused("404 Not Found", "there is no such place")),
        };
        answered.unwrap_or_else(|refusal| refusal)
    }

    fn work(&self) {}

    fn stop(&self) {
        self.training.board().is_stopping = true;
        self.training.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::gaussians::random_cloud;

    #[test]
    fn a_curve_stays_short_and_covers_the_training() {
        let training = Training::new(Arc::new(random_cloud(3, 1)));
        for iteration in 1..=7000 {
            let loss = 1.0 / f64::from(iteration);
            training.note("radiance", (iteration, 7000), loss);
        }
        training.note("albedo", (1, 10), 0.5);
        let board = training.board();
        let [radiance, albedo] = &board.stages[..] else {
            panic!("{:?}", board.stages);
        };
        let num = radiance.points.len();
        assert!(num > MAX_POINTS / 3 && num <= MAX_POINTS, "{num}");
        assert!(radiance.points[0].0 <= 16 && radiance.points[num - 1].0 > 6900);
        let is_loss = |(at, loss): &(u32, f64)| *loss == 1.0 / f64::from(*at);
        assert!(radiance.points.iter().all(is_loss));
        assert_eq!((radiance.iteration, radiance.loss), (7000, 1.0 / 7000.0));
        assert_eq!(albedo.points, [(1, 0.5)]);
    }

    fn request(query: &str) -> Request {
        Request {
            method: "GET".to_owned(),
            path: String::new(),
            query: query.to_owned(),
            host: None,
            origin: None,
            body: Vec::new(),
        }
    }

    #[test]
    fn the_end_waits_for_the_last_scene_of_a_page() {
        let training = Training::new(Arc::new(random_cloud(3, 1)));
        let most = Duration::from_secs(60);
        training.show(Arc::new(random_cloud(3, 2)));
        training.end("it has ended");
        // Nobody watches.
        training.wait_for_pages(most);
        assert!(training.state(&request("")).is_ok());
        // This page has not got the scene, and does not ask for it.
        training.wait_for_pages(Duration::from_millis(1));
        assert!(!training.board().is_shown_whole());
        std::thread::scope(|scope| {
            let page = scope.spawn(|| training.scene(&request("id=1")).is_ok());
            training.wait_for_pages(most);
            assert!(training.board().is_shown_whole());
            assert!(page.join().unwrap());
        });
    }
}
