//! Camera paths in TOML files.

use super::turntable::TurntableKeys;
use super::{
    CameraPath, Common, DEFAULT_FPS, DEFAULT_SECONDS, NUM_FRAMES, Pace, PathOverrides, SIZE, fly,
    turntable, view,
};
use crate::dataset::Dataset;
use crate::error::Result;
use crate::script::{Node, Table, Text};
use std::path::Path;

/// Frames a second are at most this.
const MAX_FPS: f64 = 1000.0;

pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    dataset: &Dataset,
    overrides: &PathOverrides,
) -> Result<CameraPath> {
    let text = Text::new(path, bytes)?;
    let value = text.parse()?;
    let table = Node::root(text, &value).table(&[
        "frames",
        "seconds",
        "fps",
        "size",
        "fov_y",
        "ease",
        "fly",
        "turntable",
    ])?;
    let common = common(&table)?.overridden(overrides);
    match table.one_of(&["fly", "turntable"])? {
        ("fly", node) => read_fly(&node, dataset, &common),
        (_, node) => {
            let keys = turntable_keys(&node)?;
            turntable(dataset, keys, &common).map_err(|problem| node.error(problem))
        }
    }
}

fn common(table: &Table<'_>) -> Result<Common> {
    let fps = match table.get("fps") {
        Some(node) => match node.double()? {
            fps if fps > 0.0 && fps <= MAX_FPS => fps,
            fps => return Err(node.error(format!("{fps} is not above 0 and at most {MAX_FPS}"))),
        },
        None => DEFAULT_FPS,
    };
    let frames_in = |seconds: f64| (seconds * fps).round();
    let num_frames = match (table.get("frames"), table.get("seconds")) {
        (Some(_), Some(seconds)) => {
            return Err(seconds.error("a path has `frames` or `seconds`, not both"));
        }
        (Some(frames), None) => frames.whole(NUM_FRAMES)?,
        (None, Some(node)) => {
            let (seconds, most) = (node.double()?, NUM_FRAMES.end());
            let num = frames_in(seconds);
            if !(1.0..=f64::from(*most)).contains(&num) {
                return Err(node.error(format!(
                    "{seconds} at {fps} frames a second are {num} frames, not 1 to {most}"
                )));
            }
            num as u32
        }
        (None, None) => (frames_in(DEFAULT_SECONDS) as u32).max(1),
    };
    Ok(Common {
        num_frames,
        fps,
        size: match table.get("size") {
            Some(node) => {
                let [width, height] = node.fixed_array()?;
                Some((width.whole(SIZE)?, height.whole(SIZE)?))
            }
            None => None,
        },
        fov_y_rad: match table.get("fov_y") {
            Some(node) => match node.double()? {
                degrees if degrees > 0.0 && degrees < 180.0 => Some(degrees.to_radians()),
                degrees => {
                    return Err(node.error(format!("{degrees} is not between 0 and 180 degrees")));
                }
            },
            None => None,
        },
        ease: match table.get("ease") {
            Some(node) => node.flag()?,
            None => false,
        },
    })
}

fn read_fly(node: &Node<'_>, dataset: &Dataset, common: &Common) -> Result<CameraPath> {
    let table = node.table(&["views", "closed", "pace"])?;
    let (mut names, mut keys) = (Vec::new(), Vec::new());
    let list = table.need("views")?;
    for node in list.array()? {
        let name = node.string()?;
        keys.push(view(dataset, name).map_err(|problem| node.error(problem))?);
        names.push(name.to_owned());
    }
    let closed = match table.get("closed") {
        Some(node) => node.flag()?,
        None => false,
    };
    let pace = match table.get("pace") {
        Some(node) => match node.string()? {
            "even" => Pace::Even,
            "views" => Pace::Views,
            other => return Err(node.error(format!("`{other}` is none of even, views"))),
        },
        None => Pace::default(),
    };
    fly(names, &keys, closed, pace, common).map_err(|problem| list.error(problem))
}

fn turntable_keys(node: &Node<'_>) -> Result<TurntableKeys> {
    let table = node.table(&[
        "centre", "radius", "height", "look_at", "up", "start", "degrees",
    ])?;
    let number = |key| table.get(key).map(|node| node.double()).transpose();
    let point = |key| table.get(key).map(|node| node.dvec3()).transpose();
    if let (Some(node), Some(radius)) = (table.get("radius"), number("radius")?)
        && radius <= 0.0
    {
        return Err(node.error(format!("{radius} is not above 0")));
    }
    Ok(TurntableKeys {
        centre: point("centre")?,
        radius: number("radius")?,
        height: number("height")?,
        look_at: point("look_at")?,
        up: match table.get("up") {
            Some(node) => Some(node.string()?.parse().map_err(|e: String| node.error(e))?),
            None => None,
        },
        start: number("start")?,
        degrees: number("degrees")?,
    })
}
