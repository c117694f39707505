//! A scene that is edited, for pages at a server.

use super::board::Board;
use super::site::LONGEST_WAIT;
use crate::error::Result;
use crate::live::{Edit, Original};
use crate::still::StillRequest;
use crate::workshop::Workshop;
use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// The subject of a server.
#[derive(Debug)]
pub struct Served {
    /// The page.
    pub page: String,
    /// For each Gaussian that is packed in the page its index in the scene.
    pub order: Vec<u32>,
    /// The edit under way.
    pub edit: Edit,
    /// Device and options of its jobs.
    pub workshop: Workshop,
}

/// State that the threads of a server with an edit share.
#[derive(Debug)]
pub(super) struct Editor {
    pub(super) page: String,
    /// Locked before the board, never after it.
    edit: Mutex<Edit>,
    pub(super) original: Arc<Original>,
    board: Mutex<Board>,
    /// Of the board.
    pub(super) changed: Condvar,
    /// Stills to be made, by their index on the board. Locked after the board.
    orders: Mutex<VecDeque<(usize, StillRequest)>>,
    pub(super) workshop: Workshop,
    pub(super) is_stopping: AtomicBool,
}

impl Editor {
    /// # Errors
    /// If a scene that was edited before cannot be packed.
    pub(super) fn new(served: Served) -> Result<Self> {
        let Served {
            page,
            order,
            edit,
            workshop,
        } = served;
        let mut board = Board::new(&edit, order);
        if edit.changed().is_some() {
            board.follow(&edit, workshop.cameras.is_some())?;
        }
        Ok(Self {
            page,
            original: Arc::clone(edit.original()),
            board: Mutex::new(board),
            edit: Mutex::new(edit),
            changed: Condvar::new(),
            orders: Mutex::default(),
            workshop,
            is_stopping: AtomicBool::new(false),
        })
    }

    /// Whether light is baked anew after an edit.
    pub(super) fn has_bake(&self) -> bool {
        self.workshop.cameras.is_some()
    }

    pub(super) fn edit(&self) -> MutexGuard<'_, Edit> {
        self.edit.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn orders(&self) -> MutexGuard<'_, VecDeque<(usize, StillRequest)>> {
        self.orders.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a change of the board.
    pub(super) fn wait<'a>(&self, board: MutexGuard<'a, Board>) -> MutexGuard<'a, Board> {
        let woken = self.changed.wait_timeout(board, LONGEST_WAIT);
        woken.unwrap_or_else(PoisonError::into_inner).0
    }
}
