//! Lights of a scene that was baked with the light of each lamp.

use anyhow::{Context, Result, bail};
use eagpt_scene::light_basis::lights_file_beside;
use eagpt_scene::{Gaussians, LightBasis};
use glam::Vec3;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

/// A light, or several by a pattern, and its factor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SetLight {
    pattern: String,
    factor: Vec3,
}

impl FromStr for SetLight {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || format!("`{text}` is not NAME=F or NAME=R,G,B");
        let (pattern, factors) = text.rsplit_once('=').ok_or_else(form)?;
        let factors: Result<Vec<f32>, _> = factors.split(',').map(str::parse).collect();
        let factor = match *factors.map_err(|_| form())? {
            [all] => Vec3::splat(all),
            [r, g, b] => Vec3::new(r, g, b),
            _ => return Err(form()),
        };
        if !(factor.is_finite() && factor.min_element() >= 0.0) {
            return Err(format!("`{text}`: a factor is negative or not finite"));
        }
        let pattern = pattern.to_owned();
        Ok(Self { pattern, factor })
    }
}

impl fmt::Display for SetLight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.factor.to_array();
        write!(f, "{}={r},{g},{b}", self.pattern)
    }
}

/// File of the lights of `scene` that are to be set; `None` if none are.
pub(super) fn file(scene: &Path, given: Option<&Path>, set: &[SetLight]) -> Option<PathBuf> {
    let beside = || lights_file_beside(scene);
    (!set.is_empty()).then(|| given.map_or_else(beside, Path::to_owned))
}

/// Gives `gaussians` of the scene the light of `file`, with lights set one after the other; returns
/// the time of the sum, seconds.
///
/// # Errors
/// If the file cannot be read or is not of this scene, or a name is of no light.
pub(super) fn apply(gaussians: &mut Gaussians, file: &Path, set: &[SetLight]) -> Result<f64> {
    let mut basis = LightBasis::read(file).context("--set-light")?;
    if let Err(problem) = basis.check(gaussians) {
        bail!("{}: {problem}", file.display());
    }
    for SetLight { pattern, factor } in set {
        let fitting = basis.matching(pattern);
        if fitting.is_empty() {
            let names: Vec<&str> = basis.lights().iter().map(|l| l.name.as_str()).collect();
            let names = names.join(", ");
            bail!("--set-light: `{pattern}` is no light: there are {names}");
        }
        for index in fitting {
            basis.set_factor(index, *factor);
        }
    }
    let begun = Instant::now();
    basis.light(gaussians);
    Ok(begun.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_names_and_factors() {
        let read = |text: &str| text.parse::<SetLight>();
        let set = read("a=b=1,0.5,2").unwrap();
        assert_eq!(set.pattern, "a=b");
        assert_eq!(set.factor, Vec3::new(1.0, 0.5, 2.0));
        assert_eq!(read(&set.to_string()).unwrap(), set);
        assert_eq!(read("wall-*=0").unwrap().factor, Vec3::ZERO);
        for (text, problem) in [
            ("a", "NAME=F"),
            ("a=", "NAME=F"),
            ("a=1,2", "NAME=R,G,B"),
            ("a=1,x,2", "NAME=R,G,B"),
            ("a=-1", "negative"),
            ("a=inf", "not finite"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(problem), "{error}");
        }
    }
}
