//! Projects made of others.

use super::plan::Plan;
use super::project::{self, Project, SECTIONS};
use crate::command::JobCommand;
use anyhow::{Context, Result};
use std::path::Path;
use toml::{Table, Value};

/// The content of a project file with all of its paths absolute, so that it may lie anywhere.
///
/// # Errors
/// If it cannot be read or is no TOML.
pub(crate) fn absolute(path: &Path) -> Result<Table> {
    let bytes = eagpt_scene::files::read(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut table: Table = text
        .parse()
        .with_context(|| format!("{}: TOML", path.display()))?;
    let full = std::path::absolute(path).with_context(|| format!("{}", path.display()))?;
    let here = full.parent().unwrap_or(Path::new("/"));
    for_each_path(&mut table, &mut |text| {
        *text = here.join(&*text).display().to_string();
    });
    Ok(table)
}

/// A step of a project.
pub(crate) struct PlannedStep {
    pub(crate) name: String,
    /// Its command, as one would type it.
    pub(crate) command: String,
}

/// The steps of a project that need not be written yet.
///
/// # Errors
/// Whatever is wrong with the project.
pub(crate) fn steps(path: &Path, text: &str) -> Result<Vec<PlannedStep>> {
    let project = Project::parse(path, text.as_bytes(), None)?;
    let plan = Plan::of(&project)?;
    let steps = plan.steps.iter().map(|step| PlannedStep {
        name: step.name.clone(),
        command: step.shown(),
    });
    Ok(steps.collect())
}

/// Calls `visit` with every path that a project file names.
fn for_each_path(root: &mut Table, visit: &mut dyn FnMut(&mut String)) {
    let command = JobCommand::program();
    for (section, name, _) in SECTIONS {
        let of = project::command(&command, name);
        let is_path = |key: &str| {
            of.and_then(|of| project::option(of, &key.replace('_', "-")))
                .is_some_and(project::takes_path)
                || (section, key) == ("poses", "model")
        };
        if let Some(Value::Table(table)) = root.get_mut(section) {
            for_each_text(table, &is_path, visit);
        }
    }
    let scene_is_file = |name: &Value| name.as_str().is_some_and(|name| name.contains(['/', '.']));
    let simulates_file = root.get("simulate").is_some_and(scene_is_file);
    let is_own = |key: &str| match key {
        "out" | "dataset" | "capture" | "measure" | "scene" => true,
        "simulate" => simulates_file,
        _ => false,
    };
    for (_, value) in root.iter_mut().filter(|(key, _)| is_own(key)) {
        if let Value::String(text) = value {
            visit(text);
        }
    }
    if let Some(Value::Array(relight)) = root.get_mut("relight") {
        for table in relight.iter_mut().filter_map(Value::as_table_mut) {
            for_each_text(table, &|key| ["script", "reference"].contains(&key), visit);
        }
    }
}

/// Calls `visit` with the texts of those keys, also in lists and in the tables of modes.
fn for_each_text(
    table: &mut Table,
    is_path: &dyn Fn(&str) -> bool,
    visit: &mut dyn FnMut(&mut String),
) {
    for (key, value) in table {
        match value {
            Value::Table(inner) => for_each_text(inner, is_path, visit),
            Value::String(text) if is_path(key) => visit(text),
            Value::Array(items) if is_path(key) => {
                for item in items {
                    if let Value::String(text) = item {
                        visit(text);
                    }
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_absolute_and_nothing_else_does() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.toml");
        let text = "simulate = \"small-room\"\nmeasure = \"a\"\n[masks]\nlabels = \"b\"\nrule = \"any\"\n\
                    [render.path]\noidn = \"c\"\n[[relight]]\nname = \"d\"\nscript = \"e/f.toml\"\n[poses]\nmodel = \"g\"\n\
                    [normals]\nmaps = \"h\"";
        std::fs::write(&path, text).unwrap();
        let found = absolute(&path).unwrap();
        let at = |name: &str| Value::from(dir.path().join(name).display().to_string());
        assert_eq!(found["measure"], at("a"));
        assert_eq!(found["masks"]["labels"], at("b"));
        assert_eq!(found["render"]["path"]["oidn"], at("c"));
        assert_eq!(found["relight"][0]["script"], at("e/f.toml"));
        assert_eq!(found["poses"]["model"], at("g"));
        assert_eq!(found["normals"]["maps"], at("h"));
        for (value, wanted) in [
            (&found["simulate"], "small-room"),
            (&found["masks"]["rule"], "any"),
            (&found["relight"][0]["name"], "d"),
        ] {
            assert_eq!(value.as_str(), Some(wanted));
        }
    }
}
