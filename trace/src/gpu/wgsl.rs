//! The kernels' sources: what is declared from Rust, what modules share, and what is their own.

use super::layout;

/// Bodies that modules of other crates share with those of this one.
pub mod shared {
    /// `Lanes`, and the order of blending.
    pub const BLEND: &str = include_str!("blend.wgsl");
    /// Hits of rays with Gaussians; `exp_of_negative`.
    pub const SURFEL: &str = include_str!("surfel.wgsl");
    /// Functions of the direction a Gaussian is seen from.
    pub const HARMONICS: &str = include_str!("harmonics.wgsl");
}

use shared::{BLEND, HARMONICS, SURFEL};

const INDEX: &str = include_str!("index.wgsl");
const BINS: &str = include_str!("bins.wgsl");
const THREADS: &str = include_str!("threads.wgsl");
const PENDING: &str = include_str!("pending.wgsl");
pub(super) const RANDOM: &str = include_str!("random.wgsl");
pub(super) const POINTS: &str = include_str!("points.wgsl");
const VIEW: &str = include_str!("view.wgsl");

/// What kernels of cameras' pixels share.
const PIXELS: &[&str] = &[SURFEL, BLEND, VIEW, PENDING];

/// What stages of the adjoint share.
const ADJOINT: &[&str] = &[SURFEL, BLEND, VIEW, include_str!("adjoint.wgsl")];

/// What the adjoint adds up: one of these.
const GRADIENTS: &[&str] = &[include_str!("adjoint_gradients.wgsl")];
const CONTRIBUTIONS: &[&str] = &[include_str!("adjoint_contributions.wgsl")];
/// How it does that.
const ROWS: &[&str] = &[include_str!("adjoint_rows.wgsl")];
const GATHER: &[&str] = &[include_str!("adjoint_gather.wgsl")];

/// What searches along single rays share.
const SEARCH: &[&str] = &[SURFEL, BLEND, PENDING, include_str!("bvh.wgsl")];

/// What looks for light from surfaces, beside [`SEARCH`].
const LIGHTS: &[&str] = &[
    RANDOM,
    POINTS,
    include_str!("start.wgsl"),
    include_str!("sampling.wgsl"),
    include_str!("lights.wgsl"),
];

/// What the integrators share, beside [`LIGHTS`].
const GATHERED: &[&str] = &[VIEW, include_str!("light.wgsl")];

/// A WGSL module: parts of text, some of which other modules have, too.
#[derive(Debug)]
pub struct Module {
    pub(super) name: &'static str,
    declare: Option<fn() -> String>,
    parts: &'static [&'static [&'static str]],
}

impl Module {
    /// A module of another crate: what all modules have, the text of `declare`, and its parts.
    pub const fn with_declarations(
        name: &'static str,
        declare: fn() -> String,
        parts: &'static [&'static [&'static str]],
    ) -> Self {
        Self {
            name,
            declare: Some(declare),
            parts,
        }
    }

    pub(super) const fn own(name: &'static str, parts: &'static [&'static [&'static str]]) -> Self {
        Self {
            name,
            declare: None,
            parts,
        }
    }

    /// Its name, different for all modules.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// All of its text.
    pub fn source(&self) -> String {
        let mut source = layout::declarations();
        if let Some(declare) = self.declare {
            source.push_str(&declare());
        }
        source.push_str(&layout::sobol_function());
        source.push_str(INDEX);
        for part in self.parts.iter().copied().flatten() {
            source.push_str(part);
        }
        source
    }
}

pub(super) static SCAN: Module = Module::own("scan", &[&[THREADS, include_str!("scan.wgsl")]]);
pub(super) static SORT: Module = Module::own("sort", &[&[THREADS, include_str!("sort.wgsl")]]);
pub(super) static PROJECT: Module = Module::own(
    "project",
    &[&[SURFEL, BINS, include_str!("bins_project.wgsl")]],
);
pub(super) static LOOK: Module = Module::own(
    "look",
    &[&[
        SURFEL,
        BLEND,
        HARMONICS,
        include_str!("harmonics_view.wgsl"),
    ]],
);
pub(super) static EXPAND: Module =
    Module::own("expand", &[&[BINS, include_str!("bins_expand.wgsl")]]);
pub(super) static LISTS: Module = Module::own("lists", &[&[BINS, include_str!("bins_lists.wgsl")]]);
pub(super) static CAMERA: Module = Module::own(
    "camera",
    &[
        PIXELS,
        &[
            include_str!("camera_forget.wgsl"),
            include_str!("camera.wgsl"),
        ],
    ],
);
pub(super) static CAMERA_RECORD: Module = Module::own(
    "camera with a record",
    &[
        PIXELS,
        &[
            include_str!("camera_record.wgsl"),
            include_str!("camera.wgsl"),
        ],
    ],
);
pub(super) static ADJOINT_COUNT: Module =
    Module::own("adjoint: count", &[&[include_str!("adjoint_count.wgsl")]]);
pub(super) static ADJOINT_WEIGHTS: Module = Module::own(
    "adjoint: weights",
    &[ADJOINT, &[include_str!("adjoint_weights.wgsl")]],
);
pub(super) static GRADIENT_ROWS: Module =
    Module::own("gradients: rows", &[ADJOINT, GRADIENTS, ROWS]);
pub(super) static GRADIENT_GATHER: Module =
    Module::own("gradients: gather", &[ADJOINT, GRADIENTS, GATHER]);
pub(super) static CONTRIBUTION_ROWS: Module =
    Module::own("contributions: rows", &[ADJOINT, CONTRIBUTIONS, ROWS]);
pub(super) static CONTRIBUTION_GATHER: Module =
    Module::own("contributions: gather", &[ADJOINT, CONTRIBUTIONS, GATHER]);
pub(super) static RAYS: Module = Module::own("rays", &[SEARCH, &[include_str!("rays.wgsl")]]);
pub(super) static BOUNCE: Module = Module::own(
    "bounce",
    &[SEARCH, LIGHTS, GATHERED, &[include_str!("bounce.wgsl")]],
);
pub(super) static PATH: Module = Module::own(
    "path",
    &[SEARCH, LIGHTS, GATHERED, &[include_str!("path.wgsl")]],
);
pub(super) static LINKS: Module =
    Module::own("matrix", &[SEARCH, LIGHTS, &[include_str!("matrix.wgsl")]]);

#[cfg(test)]
mod tests {
    use super::*;

    /// Without an adapter: what a device would reject is found here, and no module asks for more
    /// than WebGPU has.
    #[test]
    fn all_modules_are_valid() {
        for module in [
            &SCAN,
            &SORT,
            &PROJECT,
            &LOOK,
            &EXPAND,
            &LISTS,
            &CAMERA,
            &CAMERA_RECORD,
            &ADJOINT_COUNT,
            &ADJOINT_WEIGHTS,
            &GRADIENT_ROWS,
            &GRADIENT_GATHER,
            &CONTRIBUTION_ROWS,
            &CONTRIBUTION_GATHER,
            &RAYS,
            &BOUNCE,
            &PATH,
            &LINKS,
        ] {
            assert_eq!(
                eagpt_testkit::kernels::check(module.name, &module.source()),
                Ok(())
            );
        }
    }
}
