//! The state of an edit that pages see: its script, the scene it makes, whether its light fits,
//! stills.

use crate::error::Result;
use crate::live::{Edit, EditState};
use crate::pack::Pack;
use crate::page;
use eagpt_scene::{Gaussians, Lamps};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most baked scenes that are kept.
const MAX_BAKED: usize = 4;

/// A scene as pages show it.
#[derive(Debug)]
pub(super) struct Shown {
    /// 0 is the scene that the page came with.
    pub(super) id: u64,
    pub(super) gaussians: Arc<Gaussians>,
    /// For each packed Gaussian its index in the scene.
    pub(super) order: Vec<u32>,
    /// The packed scene as JSON; of the scene that the page came with nothing.
    pub(super) packed: String,
}

impl Shown {
    fn of(id: u64, gaussians: Arc<Gaussians>, lamps: &Lamps) -> Result<Self> {
        let pack = Pack::new(&gaussians, lamps, None)?;
        Ok(Self {
            id,
            packed: page::packed(id, &pack, &gaussians)?,
            gaussians,
            order: pack.order,
        })
    }
}

/// Whether the light of the scene fits what was done to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase", tag = "state")]
pub(super) enum Light {
    /// It does.
    Fits,
    /// It is that of before, and is going to be baked.
    Waiting,
    /// It is that of before, and is being baked.
    Baking {
        /// The job under way.
        task: String,
        /// Of that, 0 to 1.
        share: f64,
    },
    /// It is that of before, and stays so.
    Stale {
        /// Why.
        problem: String,
    },
}

/// A path-traced picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Still {
    pub(super) state: StillState,
    /// File of the picture, where it is or will be.
    pub(super) file: PathBuf,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase", tag = "is")]
pub(super) enum StillState {
    Waiting,
    Rendering {
        /// About how long it will take, once that is known.
        seconds: Option<f64>,
    },
    Done {
        /// Wall time of the rendering.
        seconds: f64,
    },
    Failed {
        problem: String,
    },
}

/// All that pages see.
#[derive(Debug)]
pub(super) struct Board {
    /// Grows with every change of anything.
    pub(super) revision: u64,
    pub(super) edit: EditState,
    pub(super) shown: Arc<Shown>,
    pub(super) light: Light,
    pub(super) stills: Vec<Still>,
    /// Set to end the bake under way.
    pub(super) stop_bake: Arc<AtomicBool>,
    before: Arc<Shown>,
    next_id: u64,
    /// Scripts and what was baked of them, the last one last: an undo brings it back at once.
    baked: VecDeque<(String, Arc<Gaussians>)>,
}

impl Board {
    /// `order` is that of the page's own scene.
    pub(super) fn new(edit: &Edit, order: Vec<u32>) -> Self {
        let before = Arc::new(Shown {
            id: 0,
            gaussians: Arc::clone(&edit.original().gaussians),
            order,
            packed: String::new(),
        });
        Self {
            revision: 0,
            edit: edit.state(),
            shown: Arc::clone(&before),
            light: Light::Fits,
            stills: Vec::new(),
            stop_bake: Arc::default(),
            before,
            next_id: 1,
            baked: VecDeque::new(),
        }
    }

    pub(super) fn state(&self) -> Value {
        let mut state = json!(self.edit);
        state["revision"] = json!(self.revision);
        state["scene"] = json!(self.shown.id);
        state["light"] = json!(self.light);
        state["stills"] = json!(self.stills);
        state
    }

    /// Takes the state of the edit over after an act, and its scene if that is another.
    ///
    /// # Errors
    /// As [`Pack::new`].
    pub(super) fn follow(&mut self, edit: &Edit, has_bake: bool) -> Result<()> {
        self.edit = edit.state();
        self.revision += 1;
        let Some(changed) = edit.changed() else {
            if self.shown.id != 0 {
                self.stop_bake.store(true, Ordering::Relaxed);
                self.shown = Arc::clone(&self.before);
                self.light = Light::Fits;
            }
            return Ok(());
        };
        self.stop_bake.store(true, Ordering::Relaxed);
        let lamps = &edit.original().lamps;
        let known = self
            .baked
            .iter()
            .find(|(script, _)| *script == self.edit.script);
        if let Some((_, baked)) = known {
            self.light = Light::Fits;
            return self.show(Arc::clone(baked), lamps);
        }
        self.show(Arc::clone(changed), lamps)?;
        self.light = if has_bake {
            Light::Waiting
        } else {
            let problem = "no cameras to bake for: --dataset names them".to_owned();
            Light::Stale { problem }
        };
        Ok(())
    }

    /// Shows the present scene with its light.
    ///
    /// # Errors
    /// As [`Pack::new`].
    pub(super) fn show_baked(&mut self, baked: Arc<Gaussians>, lamps: &Lamps) -> Result<()> {
        if self.baked.len() >= MAX_BAKED {
            self.baked.pop_front();
        }
        let script = self.edit.script.clone();
        self.baked.push_back((script, Arc::clone(&baked)));
        self.light = Light::Fits;
        self.show(baked, lamps)
    }

    /// Bakes light that does not fit, or stops the bake.
    pub(super) fn order_light(&mut self, is_wanted: bool) {
        let is_stale = matches!(self.light, Light::Stale { .. });
        if is_wanted && is_stale {
            self.light = Light::Waiting;
        } else if !is_wanted && !is_stale && self.light != Light::Fits {
            self.stop_bake.store(true, Ordering::Relaxed);
            let problem = "the bake was stopped".to_owned();
            self.light = Light::Stale { problem };
        }
        self.revision += 1;
    }

    /// Shows a scene.
    ///
    /// # Errors
    /// As [`Pack::new`].
    pub(super) fn show(&mut self, gaussians: Arc<Gaussians>, lamps: &Lamps) -> Result<()> {
        self.shown = Arc::new(Shown::of(self.next_id, gaussians, lamps)?);
        self.next_id += 1;
        self.revision += 1;
        Ok(())
    }
}
