//! The kernels' sources: what is declared from Rust, what modules share, and what is their own.

use super::layout;

/// Bodies that modules of other crates share with those of this one.
pub mod shared {
    /// `Lanes`, and the order of blending.
    pub const BLEND: &str = include_str!("blend.wgsl");
    /// Hits of rays with Gaussians; `exp_of_negative`.
    pub const SURFEL: &str = include_str!("surfel.wgsl");
}

const INDEX: &str = include_str!("index.wgsl");
use shared::{BLEND, SURFEL};
const BINS: &str = include_str!("bins.wgsl");
const ADJOINT: &str = include_str!("adjoint.wgsl");
const PENDING: &str = include_str!("pending.wgsl");
pub(super) const RANDOM: &str = include_str!("random.wgsl");
pub(super) const POINTS: &str = include_str!("points.wgsl");
const VIEW: &str = include_str!("view.wgsl");

/// A WGSL module.
#[derive(Debug)]
pub struct Module {
    pub(super) name: &'static str,
    declare: Option<fn() -> String>,
    parts: &'static [&'static str],
}

impl Module {
    /// A module of another crate: what all modules have, the text of `declare`, and its parts.
    pub const fn with_declarations(
        name: &'static str,
        declare: fn() -> String,
        parts: &'static [&'static str],
    ) -> Self {
        Self {
            name,
            declare: Some(declare),
            parts,
        }
    }

    pub(super) const fn own(name: &'static str, parts: &'static [&'static str]) -> Self {
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
        for part in self.parts {
            source.push_str(part);
        }
        source
    }
}

pub(super) static SCAN: Module = Module::own("scan", &[include_str!("scan.wgsl")]);
pub(super) static SORT: Module = Module::own("sort", &[include_str!("sort.wgsl")]);
pub(super) static PROJECT: Module = Module::own(
    "project",
    &[SURFEL, BINS, include_str!("bins_project.wgsl")],
);
pub(super) static EXPAND: Module = Module::own("expand", &[BINS, include_str!("bins_expand.wgsl")]);
pub(super) static LISTS: Module = Module::own("lists", &[BINS, include_str!("bins_lists.wgsl")]);
pub(super) static CAMERA: Module = Module::own(
    "camera",
    &[
        SURFEL,
        BLEND,
        VIEW,
        PENDING,
        include_str!("camera_forget.wgsl"),
        include_str!("camera.wgsl"),
    ],
);
pub(super) static CAMERA_RECORD: Module = Module::own(
    "camera with a record",
    &[
        SURFEL,
        BLEND,
        VIEW,
        PENDING,
        include_str!("camera_record.wgsl"),
        include_str!("camera.wgsl"),
    ],
);
pub(super) static ADJOINT_COUNT: Module =
    Module::own("adjoint: count", &[include_str!("adjoint_count.wgsl")]);
pub(super) static ADJOINT_WEIGHTS: Module = Module::own(
    "adjoint: weights",
    &[
        SURFEL,
        BLEND,
        ADJOINT,
        VIEW,
        include_str!("adjoint_weights.wgsl"),
    ],
);
pub(super) static ADJOINT_ROWS: Module = Module::own(
    "adjoint: rows",
    &[
        SURFEL,
        BLEND,
        ADJOINT,
        VIEW,
        include_str!("adjoint_rows.wgsl"),
    ],
);
pub(super) static ADJOINT_GATHER: Module = Module::own(
    "adjoint: gather",
    &[BLEND, ADJOINT, include_str!("adjoint_gather.wgsl")],
);
pub(super) static RAYS: Module = Module::own(
    "rays",
    &[
        SURFEL,
        BLEND,
        PENDING,
        include_str!("bvh.wgsl"),
        include_str!("rays.wgsl"),
    ],
);
pub(super) static BOUNCE: Module = Module::own(
    "bounce",
    &[
        SURFEL,
        BLEND,
        VIEW,
        PENDING,
        RANDOM,
        POINTS,
        include_str!("bvh.wgsl"),
        include_str!("start.wgsl"),
        include_str!("sampling.wgsl"),
        include_str!("lights.wgsl"),
        include_str!("light.wgsl"),
        include_str!("bounce.wgsl"),
    ],
);
pub(super) static PATH: Module = Module::own(
    "path",
    &[
        SURFEL,
        BLEND,
        VIEW,
        PENDING,
        RANDOM,
        POINTS,
        include_str!("bvh.wgsl"),
        include_str!("start.wgsl"),
        include_str!("sampling.wgsl"),
        include_str!("lights.wgsl"),
        include_str!("light.wgsl"),
        include_str!("path.wgsl"),
    ],
);
pub(super) static LINKS: Module = Module::own(
    "links",
    &[
        SURFEL,
        BLEND,
        PENDING,
        RANDOM,
        POINTS,
        include_str!("bvh.wgsl"),
        include_str!("start.wgsl"),
        include_str!("sampling.wgsl"),
        include_str!("lights.wgsl"),
        include_str!("links.wgsl"),
    ],
);

#[cfg(test)]
mod tests {
    use super::*;
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    fn modules() -> Vec<&'static Module> {
        vec![
            &SCAN,
            &SORT,
            &PROJECT,
            &EXPAND,
            &LISTS,
            &CAMERA,
            &CAMERA_RECORD,
            &ADJOINT_COUNT,
            &ADJOINT_WEIGHTS,
            &ADJOINT_ROWS,
            &ADJOINT_GATHER,
            &RAYS,
            &BOUNCE,
            &PATH,
            &LINKS,
        ]
    }

    fn parse(module: &Module) -> naga::Module {
        let source = module.source();
        naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}: {}", module.name, error.emit_to_string(&source)))
    }

    /// Without an adapter: what a device would reject is found here, and no module asks for more than WebGPU has.
    #[test]
    fn all_modules_are_valid() {
        for module in modules() {
            let parsed = parse(module);
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            if let Err(error) = validator.validate(&parsed) {
                panic!(
                    "{}: {}",
                    module.name,
                    error.emit_to_string(&module.source())
                );
            }
            assert!(!parsed.entry_points.is_empty(), "{}", module.name);
        }
    }

    /// Storage buffers that a kernel binds, at most eight.
    #[test]
    fn kernels_bind_no_more_buffers_than_every_device_has() {
        for module in modules() {
            let parsed = parse(module);
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            let info = validator.validate(&parsed).unwrap();
            for (number, entry) in parsed.entry_points.iter().enumerate() {
                let used = info.get_entry_point(number);
                let num = parsed
                    .global_variables
                    .iter()
                    .filter(|(handle, variable)| {
                        !used[*handle].is_empty()
                            && matches!(variable.space, naga::AddressSpace::Storage { .. })
                    })
                    .count();
                assert!(num <= 8, "{} binds {num} storage buffers", entry.name);
            }
        }
    }
}
