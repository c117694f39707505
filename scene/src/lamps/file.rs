//! `lamps.json`: an object with the list `lamps`, whose keys are the fields of [`Lamp`]. Other keys
//! are ignored.

use super::{Lamp, Lamps};
use crate::error::{Result, SceneError};
use crate::files;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Name of the file in the folder of a scene.
pub const LAMPS_FILE: &str = "lamps.json";
/// Folder, in that of a training in several lights, of the scene with the lamps of all of them on.
pub const ALL_LAMPS_DIR: &str = "all-lamps";
/// Largest difference from 1 of the length of a quaternion: a few digits are kept where a person
/// has written it.
const UNIT_TOLERANCE: f32 = 1e-3;

/// The file of the lamps of a scene: [`LAMPS_FILE`] in the folder of `scene`.
pub fn lamps_file_beside(scene: &Path) -> PathBuf {
    scene.with_file_name(LAMPS_FILE)
}

/// Reads the lamps of a scene.
///
/// # Errors
/// [`SceneError`] naming the file, and field and value of what cannot be: no JSON, a missing key, a
/// value of the wrong type, one that is not finite or out of its range, a name that is empty, has
/// a `*` in it, or that two lamps have.
pub fn read_lamps(path: &Path) -> Result<Lamps> {
    let lamps = files::read_json(path)?;
    check(path, &lamps)?;
    Ok(lamps)
}

/// Writes the lamps of a scene.
///
/// # Errors
/// [`SceneError`] naming the file if it cannot be written, and field and value of what
/// [`read_lamps`] would refuse.
pub fn write_lamps(path: &Path, lamps: &Lamps) -> Result<()> {
    check(path, lamps)?;
    let json = serde_json::to_vec_pretty(lamps)
        .map_err(|error| SceneError::invalid(path, "JSON", error.to_string()))?;
    files::write_bytes_atomic(path, &json)
}

fn check(path: &Path, lamps: &Lamps) -> Result<()> {
    let mut names = BTreeSet::new();
    for (index, lamp) in lamps.lamps.iter().enumerate() {
        let invalid = |(field, problem): (&str, String)| {
            SceneError::invalid(path, format!("lamps[{index}].{field}"), problem)
        };
        check_lamp(lamp).map_err(invalid)?;
        if !names.insert(&lamp.name) {
            let problem = format!("`{}` is the name of an earlier lamp too", lamp.name);
            return Err(invalid(("name", problem)));
        }
    }
    Ok(())
}

/// The first field that cannot be, and the problem with it.
fn check_lamp(lamp: &Lamp) -> Result<(), (&'static str, String)> {
    let unfit = |c: char| c == '*' || c.is_control();
    if lamp.name.is_empty() || lamp.name.contains(unfit) {
        let name = lamp.name.escape_debug();
        return Err(("name", format!("`{name}`: empty, or with a * in it")));
    }
    let not_negative: [(&str, &[f32]); 7] = [
        ("size", &lamp.size),
        ("shade", &[lamp.shade]),
        ("reach", &[lamp.reach]),
        ("radiance", &lamp.radiance),
        ("power", &lamp.power),
        ("deviation", &[lamp.deviation]),
        ("factor", &lamp.factor),
    ];
    for (field, values) in not_negative {
        if let Some(value) = values.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
            return Err((field, format!("{value:?} is not a number of at least 0")));
        }
    }
    if let Some(value) = lamp.centre.iter().find(|value| !value.is_finite()) {
        return Err(("centre", format!("{value:?} is not finite")));
    }
    let length = lamp.rotation.iter().map(|v| v * v).sum::<f32>().sqrt();
    // Not a number is outside of it, too.
    if !((1.0 - UNIT_TOLERANCE..=1.0 + UNIT_TOLERANCE).contains(&length)) {
        let rotation = lamp.rotation;
        return Err((
            "rotation",
            format!("{rotation:?} has the length {length:?}, not 1"),
        ));
    }
    if lamp.size == [0.0; 3] {
        return Err(("size", "all three lengths are 0".to_owned()));
    }
    if !(lamp.area.is_finite() && lamp.area > 0.0) {
        return Err(("area", format!("{:?} is not a positive number", lamp.area)));
    }
    Ok(())
}
