//! Recently used views, within a budget of memory.

use super::Dataset;
use super::view::View;
use crate::error::Result;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Loads views when they are asked for and keeps the most recently used ones.
///
/// Views handed out stay alive as long as their holder keeps them; the budget counts those the
/// cache itself holds, of which there is always at least one. Nothing is locked while a view loads,
/// so that a thread pool whose threads wait for each other cannot come to a stop; two threads that
/// ask for the same absent view at once both load it.
#[derive(Debug)]
pub struct ViewCache {
    dataset: Arc<Dataset>,
    budget_bytes: usize,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    /// View and the time of its last use.
    views: HashMap<usize, (Arc<View>, u64)>,
    num_bytes: usize,
    time: u64,
}

impl ViewCache {
    /// A cache that holds up to `budget_bytes` of pixels.
    pub fn new(dataset: Arc<Dataset>, budget_bytes: usize) -> Self {
        Self {
            dataset,
            budget_bytes,
            held: Mutex::default(),
        }
    }

    /// The dataset the views come from.
    pub fn dataset(&self) -> &Arc<Dataset> {
        &self.dataset
    }

    /// Bytes of pixels held.
    pub fn num_bytes(&self) -> usize {
        self.lock().num_bytes
    }

    /// The view of frame `index`, loaded if it is not held.
    ///
    /// # Errors
    /// As [`Dataset::load_view`]; nothing is kept of a view that fails.
    ///
    /// # Panics
    /// If `index` is not below the number of frames.
    pub fn get(&self, index: usize) -> Result<Arc<View>> {
        if let Some(view) = self.lock().touch(index) {
            return Ok(view);
        }
        let view = Arc::new(self.dataset.load_view(index)?);
        Ok(self.lock().insert(index, view, self.budget_bytes))
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        // No code that can panic runs under the lock, so a poisoned state is a whole state.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    fn touch(&mut self, index: usize) -> Option<Arc<View>> {
        self.time += 1;
        let (view, last_used) = self.views.get_mut(&index)?;
        *last_used = self.time;
        Some(Arc::clone(view))
    }

    fn insert(&mut self, index: usize, view: Arc<View>, budget_bytes: usize) -> Arc<View> {
        if let Some(held) = self.touch(index) {
            return held;
        }
        self.num_bytes += view.num_bytes();
        self.views.insert(index, (Arc::clone(&view), self.time));
        while self.num_bytes > budget_bytes && self.views.len() > 1 {
            let oldest = self.views.iter().min_by_key(|(_, (_, used))| *used);
            let Some(oldest) = oldest.map(|(index, _)| *index) else {
                break;
            };
            if let Some((evicted, _)) = self.views.remove(&oldest) {
                self.num_bytes -= evicted.num_bytes();
            }
        }
        view
    }
}
