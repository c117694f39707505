//! The places of a server, and what is answered there.

use super::board::{Still, StillState};
use super::editor::Editor;
use super::reply::{Reply, refused, unprocessable};
use super::request::Request;
use super::site::{LONGEST_WAIT, Site};
use super::work;
use crate::error::ViewerError;
use crate::live::Act;
use crate::still::{StillRequest, files_of};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use eagpt_scene::files;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;

/// Most stills that wait for their turn.
const MAX_WAITING: usize = 16;

impl Site for Editor {
    fn answer(&self, request: &Request, place: &str) -> Reply {
        let answered = match (request.method.as_str(), place) {
            ("GET", "") => Ok(Reply::html(&self.page)),
            ("GET", "state") => state(request, self),
            ("GET", "scene") => scene(request, self),
            ("GET", "still") => picture(request, self),
            ("POST", "act") => act(request, self),
            ("POST", "select") => select(request, self),
            ("POST", "light") => light(request, self),
            ("POST", "still") => still(request, self),
            (_, "" | "state" | "scene" | "still" | "act" | "select" | "light") => {
                Err(refused("405 Method Not Allowed", "not this method"))
            }
            _ => Err(refused("404 Not Found", "there is no such place")),
        };
        answered.unwrap_or_else(|refusal| refusal)
    }

    fn work(&self) {
        work::run(self);
    }

    fn stop(&self) {
        self.is_stopping.store(true, Ordering::Relaxed);
        // Under the lock: who has looked at the flag before waits by now.
        self.board().stop_bake.store(true, Ordering::Relaxed);
        self.changed.notify_all();
    }
}

fn body<T: DeserializeOwned>(request: &Request, what: &str) -> Result<T, Reply> {
    serde_json::from_slice(&request.body).map_err(|error| {
        refused(
            "400 Bad Request",
            &format!("the body is no {what}: {error}"),
        )
    })
}

fn state(request: &Request, editor: &Editor) -> Result<Reply, Reply> {
    let after: Option<u64> = request.number("after")?;
    let board = editor.board();
    let (board, _) = editor
        .changed
        .wait_timeout_while(board, LONGEST_WAIT, |board| {
            Some(board.revision) == after && !editor.is_stopping.load(Ordering::Relaxed)
        })
        .unwrap_or_else(PoisonError::into_inner);
    Ok(Reply::json("200 OK", &board.state()))
}

fn act(request: &Request, editor: &Editor) -> Result<Reply, Reply> {
    let act: Act = body(request, "act")?;
    // One act after the other; pages can ask for the state meanwhile.
    let mut edit = editor.edit();
    let before = edit.changed().map(Arc::as_ptr);
    edit.act(act).map_err(|error| unprocessable(&error))?;
    let is_same = edit.changed().map(Arc::as_ptr) == before;
    let mut board = editor.board();
    let followed = if is_same {
        board.edit = edit.state();
        board.revision += 1;
        Ok(())
    } else {
        board.follow(&edit, editor.has_bake())
    };
    editor.changed.notify_all();
    followed.map_err(|error| unprocessable(&error))?;
    Ok(Reply::json("200 OK", &board.state()))
}

/// The scene that is shown now, packed.
fn scene(request: &Request, editor: &Editor) -> Result<Reply, Reply> {
    let id: Option<u64> = request.number("id")?;
    let shown = Arc::clone(&editor.board().shown);
    if shown.id == 0 || id != Some(shown.id) {
        return Err(refused("404 Not Found", "this scene is not shown"));
    }
    Ok(Reply::json_text(&shown.packed))
}

/// A selector of edit scripts.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Selection {
    select: Value,
}

/// Which of the packed Gaussians a selector selects, a bit for each, low bits first.
fn select(request: &Request, editor: &Editor) -> Result<Reply, Reply> {
    let Selection { select } = body(request, "selection")?;
    let shown = Arc::clone(&editor.board().shown);
    let selected = editor.original.selected(&shown.gaussians, &select);
    let selected = selected.map_err(|error| unprocessable(&error))?;
    let mut bits = vec![0_u8; shown.order.len().div_ceil(8)];
    for (place, _) in (shown.order.iter().enumerate()).filter(|(_, i)| selected[**i as usize]) {
        bits[place / 8] |= 1 << (place % 8);
    }
    let positions = shown.gaussians.positions.iter().zip(&selected);
    let bounds = positions.filter(|(_, is)| **is).map(|(p, _)| (*p, *p));
    let bounds = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    Ok(Reply::json(
        "200 OK",
        &json!({
            "scene": shown.id,
            "num": selected.iter().filter(|is| **is).count(),
            "bounds": bounds,
            "bits": STANDARD.encode(bits),
        }),
    ))
}

/// A request about the light.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum LightOrder {
    Stop,
    Bake,
}

fn light(request: &Request, editor: &Editor) -> Result<Reply, Reply> {
    let order: LightOrder = body(request, "order")?;
    let mut board = editor.board();
    board.order_light(matches!(order, LightOrder::Bake) && editor.has_bake());
    editor.changed.notify_all();
    Ok(Reply::json("200 OK", &board.state()))
}

fn still(request: &Request, editor: &Editor) -> Result<Reply, Reply> {
    let order: StillRequest = body(request, "still")?;
    order.check().map_err(|error| unprocessable(&error))?;
    let mut board = editor.board();
    let mut orders = editor.orders();
    if orders.len() >= MAX_WAITING {
        let problem = format!("{MAX_WAITING} stills wait already");
        return Err(unprocessable(&ViewerError::Still(problem)));
    }
    let is_taken = |file: &PathBuf| {
        let mut others = board.stills.iter().map(|still| &still.file);
        others.any(|other| other == file) || files_of(file).iter().any(|path| path.exists())
    };
    let file = (1_u32..).map(|number| {
        editor
            .workshop
            .stills
            .join(format!("still-{number:03}.png"))
    });
    let Some(file) = file.into_iter().find(|file| !is_taken(file)) else {
        return Err(refused(
            "507 Insufficient Storage",
            "no name is free for a still",
        ));
    };
    orders.push_back((board.stills.len(), order));
    board.stills.push(Still {
        state: StillState::Waiting,
        file,
    });
    board.revision += 1;
    editor.changed.notify_all();
    Ok(Reply::json("200 OK", &board.state()))
}

/// A still that is done.
fn picture(request: &Request, editor: &Editor) -> Result<Reply, Reply> {
    let index: Option<usize> = request.number("index")?;
    let none = || refused("404 Not Found", "there is no such still");
    let still = index.and_then(|index| editor.board().stills.get(index).cloned());
    let still = still.ok_or_else(none)?;
    if !matches!(still.state, StillState::Done { .. }) {
        return Err(none());
    }
    let bytes = files::read(&still.file).map_err(|error| unprocessable(&error.into()))?;
    Ok(Reply {
        status: "200 OK",
        kind: "image/png",
        body: bytes,
    })
}
