//! Edit scripts for scenes of 2D Gaussians: a TOML file of selections and actions, checked as a
//! whole before the scene is touched; replays are bit-identical.
//!
//! - [`script`]: scripts and their reader.
//! - [`mod@replay`], [`report`]: the loop over the steps, and its reports.
//!
//! # The grammar
//!
//! ```toml
//! up = "z"                                     # the world's up axis; z if absent
//!
//! [selections]                                 # names for selectors
//! lamps = { emission = { min = 0.1 }, half_space = { point = [0, 0, 2], normal = "z" } }
//!
//! [[step]]
//! title = "Lamps at half power, and warm"      # for people
//! select = "lamps"                             # what: a selector
//! then = [ { scale_light = 0.5 }, { tint_light = [1, 0.8, 0.5] } ]
//!
//! [[step]]
//! insert = { ball = { centre = [1, 0, 2], radius = 0.25, radiance = 12 } }
//! as = "ball"                                  # a name that later steps may select
//! ```
//!
//! **A selector** is the name of a selection, the name that an earlier step gave with `as`,
//! `"everything"`, or a table of conditions that all have to hold:
//!
//! | condition | value |
//! |---|---|
//! | `box` | `{ min, max }`, or `{ centre, size, rotate = { axis, degrees } }` |
//! | `sphere` | `{ centre, radius }` |
//! | `half_space` | `{ point, normal }`: the side that the normal points to |
//! | `cylinder` | `{ from, to, radius }` |
//! | `emission`, `opacity`, `radiance`, `albedo`, `size` | `{ min, max }`, one or both |
//! | `lamp` | a name, or a pattern in which `*` stands for any text |
//! | `cluster` | `{ seed, radius or reach, within }` |
//! | `all`, `any` | a list of selectors |
//! | `not` | a selector |
//!
//! Of radiance and albedo the luminance counts, and the size is the geometric mean of the two
//! scales. A cluster is all that is reached from the seed point in steps of at most `radius` scene
//! units, or `reach` sizes of the Gaussian that the step starts from (3, if nothing is said), over
//! Gaussians of the selector `within`. Lamps are those of `lamps.json` beside the scene
//! ([`eagpt_scene::lamps`]): selected are Gaussians that emit (emission above 0.1) and whose centre
//! lies in the box of the lamp, grown by a margin; of several boxes the nearest counts. The boxes
//! stay where training has found the lamps. Regions ask for centres. Selections are looked up in
//! the scene as it is when their step begins; a name given with `as` follows the Gaussians wherever
//! they go, and when they no longer emit.
//!
//! **A step** has one of `select`, `insert`, `import`, `set_light`, and a list `then` of actions,
//! done in order:
//!
//! | action | effect |
//! |---|---|
//! | `"remove"`, `"keep_only"` | of the selection |
//! | `"lights_off"` | radiance and emission 0 |
//! | `"make_emissive"`, `"make_not_emissive"` | emission 1 or 0 |
//! | `{ make_lamp = { shape, radiance, axis, radii, height } }` | one clean surface in the place of the selection |
//! | `{ scale_light = f }`, `{ tint_light = c }`, `{ set_radiance = c }` | linear; a tint keeps the luminance |
//! | `{ set_albedo = c }`, `{ scale_albedo = f }`, `{ swap_albedo = "bgr" }` | 0 to 1; a scaled albedo ends at 1, or where it was above |
//! | `{ set_specular = c }`, `{ set_roughness = r }` | F0 and roughness of what is mirrored, 0 to 1 |
//! | `{ metal = { color = c, roughness = r } }` | albedo 0, F0 `c`; roughness 0.2, if nothing is said |
//! | `{ move = [x, y, z] }`, `{ rotate = { axis, degrees, about } }`, `{ scale = { factor, about } }` | Gaussians turn and grow along |
//! | `{ place = placement }` | all of these at once |
//! | `{ duplicate = placement }` | of a copy, which the rest of the list acts on |
//! | `{ snap_to_floor = height }` | the lowest centre comes to this height |
//!
//! `make_lamp` fits a `shape` to the selection, `"rectangle"`, `"ellipse"`, `"ball"` or `"tube"` (a
//! cylinder or a cone without its tip, about `axis`; the up axis, if nothing is said), and replaces
//! it with a closed surface of that shape that emits `radiance` and has the mean albedo. Of a tube
//! with `radii = [r, r]`, at both ends in the direction of the axis, and a `height` nothing is
//! fitted: it is put in the middle of the selection.
//!
//! Colours `c` and factors `f` are a number or `[r, g, b]`. A placement is `{ scale, rotate = {
//! axis, degrees }, about, move or to }`: scaled and rotated about a pivot, which then moves by an
//! offset or to a point. The pivot is `"centre"` (of the bounds, if nothing is said), `"base"` (the
//! middle of their lower face) or a point. An axis is a name like `"z"` or `"-x"`, or a vector.
//!
//! `insert` is `{ ball = { centre, radius } }`, `{ quad = { centre, u, v } }` with whole edges u
//! and v, or `{ box = { centre, size, rotate } }`; each with `albedo`, or `radiance` if it emits,
//! or both, and the `spacing` of its discs. It mirrors with `specular` (F0) and `roughness` (0.2,
//! if nothing is said), or is a `metal = { color, roughness }` and nothing else. `import` is
//! `{ file, select }` and the keys of a placement; the file is relative to the script.
//!
//! `set_light` is a table of names of lights, or patterns, and factors, as `{ "ceiling-2" = [1,
//! 0.8, 0.6], "wall-*" = 0 }`: their light as parts of that which they had when the light basis of
//! the scene was baked ([`eagpt_scene::light_basis`]). Other lights stay as they are, and a name
//! outranks a pattern. All Gaussians get the radiance that they reflect then, and what emits its
//! own; those that emit are what `then` acts on. Neither geometry nor albedos nor gloss may have
//! changed since the bake, nor the light in another way.
//!
//! A step that finds nothing is an error unless it says `allow_empty = true`. With `trim =
//! "shrink"` or `"drop"`, discs that cross the boundary of the selection's regions are made smaller
//! or removed before the actions: of those that stay, if the selection is removed, else of the
//! selected. Where a step imports, or begins with `duplicate`, only the copy is trimmed.

mod act;
mod cluster;
mod lamp;
mod lights;
mod place;
mod quantity;
pub mod replay;
pub mod report;
pub mod script;
mod select;
mod shape;
mod trim;

#[cfg(test)]
mod testing;

pub use replay::{Edited, replay, selection};
pub use report::{SelectionReport, StepReport};
pub use script::Script;
