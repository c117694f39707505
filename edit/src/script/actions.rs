//! Actions and placements in a script.

use crate::act::{Action, Paint};
use crate::place::{Goal, Pivot, Placement};
use eagpt_scene::Result;
use eagpt_scene::color::luminance;
use eagpt_scene::script::{Node, Table};
use glam::{Quat, Vec3};

/// Actions that need to know nothing more.
const PLAIN: [&str; 5] = [
    "remove",
    "keep_only",
    "lights_off",
    "make_emissive",
    "make_not_emissive",
];
/// Actions with a value.
const VALUED: [&str; 12] = [
    "scale_light",
    "tint_light",
    "set_radiance",
    "set_albedo",
    "scale_albedo",
    "swap_albedo",
    "move",
    "rotate",
    "scale",
    "place",
    "duplicate",
    "snap_to_floor",
];

/// The actions of a step.
pub(super) fn actions(node: &Node<'_>) -> Result<Vec<Action>> {
    let nodes = node.array()?;
    let mut actions = Vec::with_capacity(nodes.len());
    for node in &nodes {
        if actions.last() == Some(&Action::Remove) {
            return Err(node.error("after `remove` there is nothing left to act on"));
        }
        actions.push(action(node)?);
    }
    Ok(actions)
}

fn action(node: &Node<'_>) -> Result<Action> {
    if !node.is_table() {
        return match node.string()? {
            "remove" => Ok(Action::Remove),
            "keep_only" => Ok(Action::KeepOnly),
            "lights_off" => Ok(Action::Paint(Paint::LightsOff)),
            "make_emissive" => Ok(Action::Paint(Paint::SetEmission(1.0))),
            "make_not_emissive" => Ok(Action::Paint(Paint::SetEmission(0.0))),
            other => Err(node.error(format!(
                "`{other}` is no action without a value; those are {}",
                PLAIN.join(", ")
            ))),
        };
    }
    let (key, value) = node.table(&VALUED)?.only()?;
    let paint = match key {
        "scale_light" => Paint::ScaleLight(value.color()?),
        "tint_light" => Paint::TintLight(tint(&value)?),
        "set_radiance" => Paint::SetRadiance(value.color()?),
        "set_albedo" => Paint::SetAlbedo(value.albedo()?),
        "scale_albedo" => Paint::ScaleAlbedo(value.color()?),
        "swap_albedo" => Paint::SwapAlbedo(channels(&value)?),
        "move" => return Ok(Action::Place(Placement::by(value.vec3()?))),
        "rotate" => {
            let table = value.table(&["axis", "degrees", "about"])?;
            return Ok(Action::Place(Placement {
                rotation: table.rotation()?,
                pivot: pivot(&table)?,
                ..Placement::by(Vec3::ZERO)
            }));
        }
        "scale" => {
            let table = value.table(&["factor", "about"])?;
            return Ok(Action::Place(Placement {
                scale: table.need("factor")?.positive()?,
                pivot: pivot(&table)?,
                ..Placement::by(Vec3::ZERO)
            }));
        }
        "place" => return whole_placement(&value).map(Action::Place),
        "duplicate" => return whole_placement(&value).map(Action::Duplicate),
        _ => return Ok(Action::SnapToFloor(value.number()?)),
    };
    Ok(Action::Paint(paint))
}

fn tint(node: &Node<'_>) -> Result<Vec3> {
    let color = node.color()?;
    if luminance(color.to_array()) <= 0.0 {
        return Err(node.error("black has no colour to tint with"));
    }
    Ok(color)
}

/// "bgr" and the like: from which channel each one comes.
fn channels(node: &Node<'_>) -> Result<[usize; 3]> {
    let text = node.string()?;
    let places: Vec<usize> = text.chars().filter_map(|c| "rgb".find(c)).collect();
    let mut sorted = places.clone();
    sorted.sort_unstable();
    match (places.as_slice(), text.len()) {
        (&[r, g, b], 3) if sorted == [0, 1, 2] => Ok([r, g, b]),
        _ => Err(node.error(format!("`{text}` is no order of the letters r, g, b"))),
    }
}

fn whole_placement(node: &Node<'_>) -> Result<Placement> {
    placement(&node.table(&["scale", "rotate", "about", "move", "to"])?)
}

/// The placement that a table gives, among other things.
pub(super) fn placement(table: &Table<'_>) -> Result<Placement> {
    Ok(Placement {
        scale: match table.get("scale") {
            Some(node) => node.positive()?,
            None => 1.0,
        },
        rotation: match table.get("rotate") {
            Some(node) => node.rotation()?,
            None => Quat::IDENTITY,
        },
        pivot: pivot(table)?,
        goal: match (table.get("move"), table.get("to")) {
            (Some(_), Some(to)) => {
                return Err(to.error("a placement has a `move` or a `to`, not both"));
            }
            (Some(offset), None) => Goal::By(offset.vec3()?),
            (None, Some(point)) => Goal::To(point.vec3()?),
            (None, None) => Goal::By(Vec3::ZERO),
        },
    })
}

fn pivot(table: &Table<'_>) -> Result<Pivot> {
    let Some(node) = table.get("about") else {
        return Ok(Pivot::Centre);
    };
    match node.string() {
        Ok("centre") => Ok(Pivot::Centre),
        Ok("base") => Ok(Pivot::Base),
        Ok(other) => Err(node.error(format!(
            "`{other}` is neither centre, base nor a point [x, y, z]"
        ))),
        Err(_) => node.vec3().map(Pivot::Point),
    }
}
