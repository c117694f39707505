//! What the threads of a server share.

use super::LONGEST_WAIT;
use super::board::Board;
use crate::live::{Edit, Original};
use crate::still::StillRequest;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

#[derive(Debug)]
pub(super) struct Shared {
    pub(super) page: String,
    /// Locked before the board, never after it.
    pub(super) edit: Mutex<Edit>,
    pub(super) original: Arc<Original>,
    pub(super) board: Mutex<Board>,
    /// Of the board.
    pub(super) changed: Condvar,
    /// Stills to be made, by their index on the board. Locked after the board.
    pub(super) orders: Mutex<VecDeque<(usize, StillRequest)>>,
    pub(super) has_bake: bool,
    pub(super) stills: PathBuf,
    pub(super) num_connections: AtomicUsize,
    pub(super) is_stopping: AtomicBool,
}

impl Shared {
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
