//! Mirrors that training finds, and what becomes of them in runs that were killed or done anew.

use crate::support::Workplace;
use eagpt_scene::{Gloss, ply};

const ROOM: &str = r##"
title = "A room with a mirror"
[materials]
tiles = { checker = { colors = ["#c8b090", "#6a7f95"], size = 0.4 }, grain = 0.1 }
cloth = { checker = { colors = ["#a04030", "#d8c8a0"], size = 0.3 }, grain = 0.1 }
white = { plain = "#e0ddd4", grain = 0.05 }
mirror = { plain = [0, 0, 0], gloss = { reflectance = [0.9, 0.9, 0.9], roughness = 0.02 } }
[lights]
panel = [12, 11, 9]
[[condition]]
name = "day"
lights = { panel = 1 }
[[object]]
room = { size = [3.0, 2.6, 2.4], floor = "cloth", ceiling = "white", walls = "tiles" }
at = [0, 0, 0]
[[object]]
panel = { size = [0.9, 0.7], facing = "-z", material = "white", light = "panel" }
at = [0, 0, 2.38]
[[object]]
panel = { size = [1.2, 0.9], facing = "-y", material = "mirror" }
at = [0.2, 1.28, 1.3]
[cameras]
views = 20
size = [80, 60]
fov_x = 75
[[cameras.ring]]
centre = [0, -0.2]
radii = [0.8, 0.4]
heights = [1.4, 1.1]
turns = [180, 140, 220, 90]
pitches = [-8, 6, -16]
"##;

/// Mirrors come into the scene after iteration 190.
const RUN: &str = "--preset fast --iterations 200 --albedo-iterations 6 --gaussians 9000 --set output.checkpoint_every=6";

/// A room with `whole`: [`RUN`] without interruption.
fn place() -> Workplace {
    Workplace::shared("mirrors", || {
        let place = Workplace::empty();
        place.write("room.toml", ROOM);
        place.succeeds("synth room.toml --parts truth --out room");
        place.succeeds(&format!("train room/truth/day --out whole {RUN}"));
        place
    })
}

#[test]
fn a_mirror_is_listed_marked_and_of_metal() {
    let place = place();
    let placed = place.json("whole/mirrors.json");
    assert_eq!(placed["iteration"], 190);
    let mirror = &placed["mirrors"][0];
    let centre: Vec<f64> = serde_json::from_value(mirror["centre"].clone()).unwrap();
    // It is 1.2 by 0.9 m; where few views show it, it may be found smaller.
    let off = [centre[0] - 0.2, centre[1] - 1.28, centre[2] - 1.3];
    assert!(
        off[0].abs() < 0.35 && off[1].abs() < 0.05 && off[2].abs() < 0.3,
        "{centre:?}"
    );
    let num_views = mirror["num_views"].as_u64().unwrap() as usize;
    let masks = place.names("whole/mirrors");
    assert!((2..=num_views).contains(&masks.len()), "{masks:?}");
    let scene = ply::read_gaussians(&place.path("whole/scene.ply")).unwrap();
    assert!(scene.gloss.iter().filter(|gloss| gloss.is_mirror()).count() > 500);

    // A run that does not look for mirrors leaves none of an earlier one.
    place.succeeds(&format!(
        "train room/truth/day --out whole {RUN} --set radiance.mirrors=false --force"
    ));
    assert!(!place.path("whole/mirrors.json").exists());
    assert!(!place.path("whole/mirrors").exists());
    let scene = ply::read_gaussians(&place.path("whole/scene.ply")).unwrap();
    assert!(!scene.gloss.iter().any(Gloss::is_mirror));
}

#[test]
#[cfg(debug_assertions)]
fn a_killed_run_places_mirrors_once() {
    let place = place();
    // First before there is a checkpoint that has them, so that they are found again, then nine
    // iterations after the one before, the last that there was.
    place.is_killed_at(
        "radiance=191",
        &format!("train room/truth/day --out run {RUN}"),
    );
    place.is_killed_at("radiance=9", "train room/truth/day --out run --resume");
    assert_eq!(
        place.json("run/mirrors.json"),
        place.json("whole/mirrors.json")
    );
    place.succeeds("train room/truth/day --out run --resume");
    assert_eq!(place.bytes("run/scene.ply"), place.bytes("whole/scene.ply"));
}
