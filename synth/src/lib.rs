//! A virtual capture rig: rooms of analytic shapes, path-traced with exact ground truth,
//! photographed as RAW brackets.
//!
//! - `room`: shapes, patterns, materials, lights.
//! - [`script`]: scene files; [`scenes`]: those that come with the program.
//! - `light`: the path tracer; `photograph`: images of a camera.
//! - `lamps`: what is true of the room's lamps.
//! - `rig`: lens, sensor, exposures; [`dng`]: mosaics as DNG files.
//! - [`capture`]: the job.
//!
//! # Scene files
//!
//! ```toml
//! title = "A room"
//!
//! [materials]                        # names of materials
//! oak = { wood = { colors = ["#b98a54", "#84592c"], size = [1.5, 0.09] }, grain = 0.1 }
//! white = "#e6e1d6"
//! glaze = { plain = "#27456b", gloss = { reflectance = 0.05, roughness = 0.2 } }
//! steel = { plain = 0, gloss = { reflectance = [0.6, 0.58, 0.55], roughness = 0.4 } }
//!
//! [lights]                           # linear radiance when fully on
//! lamp = [18, 12, 7]
//!
//! [[condition]]                      # 1 to 4; a light that is not named is off
//! name = "evening"
//! lights = { lamp = 0.5 }
//!
//! [[object]]
//! room = { size = [4, 3, 2.5], floor = "oak", ceiling = "white", walls = "white" }
//!
//! [[object]]
//! lamp = { height = 1.5, pole = "oak", shade = "white", light = "lamp" }
//! at = [1, 1, 0]
//! turn = 30                          # degrees about the vertical
//!
//! [cameras]
//! views = 40
//! size = [240, 160]                  # of the truth, pixels
//! fov_x = 75                         # degrees
//!
//! [[cameras.ring]]                   # eyes on an ellipse, looking to its middle
//! centre = [0, 0]
//! radii = [1.2, 0.9]
//! heights = [1.5, 1.3]               # taken in turn, as the other lists
//! turns = [0, 30]                    # degrees from the direction to the middle
//! pitches = [-10, -20]               # degrees above the horizon
//! ```
//!
//! Lengths are metres, z is up. Colours are linear numbers, or `"#rrggbb"` as displays show them.
//!
//! **Materials** have one of `plain`, `checker`, `stripes`, `noise`, `bricks`, `wood`, `rug`,
//! `landscape`, `motif`; `grain` makes them uneven. `gloss` is a coat of GGX's facets, or bare
//! metal where what is beneath is black, that mirrors the room to the camera. Other surfaces
//! receive the light that it reflects, spread as by a diffuse surface.
//!
//! **Objects** stand with their foot at `at` and look towards −y, before `turn`:
//!
//! | object | keys |
//! |---|---|
//! | `room` | `size`, `floor`, `ceiling`, `walls` or `north`, `south`, `east`, `west` |
//! | `box`, `ball`, `can`, `panel`, `lathe` | `size`; `radius`; `radius`, `top`, `height`, `open`; `size`, `facing`; `profile`; each `material`, `light` |
//! | `table` | `size`, `top`, `legs`, `cloth` |
//! | `chair` | `frame`, `cushion`, `seat_height` |
//! | `shelf` | `size`, `boards`, `material`, `back`, `books` |
//! | `sofa` | `size`, `material`, `cushions`, `feet` |
//! | `lamp`, `pendant` | `height` or `cord_length`, `radius`, `pole` or `cord`, `shade`, `light` |
//! | `window` | `size`, `facing`, `frame`, `pane`, `light`, `bars`, `curtains`; `at` is its middle on the wall |
//! | `picture` | `size`, `facing`, `frame`, `canvas`; `at` is its middle on the wall |
//! | `plant` | `height`, `pot`, `soil`, `leaves` |
//! | `books`, `fruit` | `num`, `covers`; `bowl`, `fruits` |
//!
//! A surface that emits in a condition does not reflect in it, and has mask 1 (where it covers at
//! least half of a pixel) and albedo 0 in its truth.
//!
//! **`[rig]`** is the camera, all of it optional: `exposures_s`, `iso`, `f_number`,
//! `sensor_width_mm`, `oversampling` (sensor pixels along each side of one of the truth),
//! `vignetting` a, b, c, `distortion` k1, k2, p1, p2, `full_well_e`, `read_noise_e`, `black`,
//! `white`. The sensitivity is such that the shortest exposure holds the brightest light.

pub mod capture;
pub mod dng;
mod error;
mod lamps;
mod light;
mod photograph;
mod rig;
mod room;
pub mod scenes;
pub mod script;

pub use capture::{SynthOptions, SynthProgress, SynthSummary, simulate};
pub use error::{Result, SynthError};
pub use photograph::SampleNoise;
pub use rig::Rig;
pub use script::SceneScript;
