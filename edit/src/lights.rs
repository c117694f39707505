//! Lights by name, as `set_light` sets them.

use eagpt_scene::LightBasis;
use eagpt_scene::script::Spanned;
use glam::Vec3;
use std::ops::Range;

/// Factor of all lights whose name fits a pattern, by channel, not negative.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LightFactor {
    pub(crate) pattern: Spanned<String>,
    pub(crate) factor: Vec3,
}

/// Place of a name in the script, and the problem with it.
pub(crate) type Misnamed = (Range<usize>, String);

/// Indices of the lights of `basis` that are set, in order, and their factors. A name outranks a
/// pattern.
///
/// # Errors
/// In words, with the place of the name: it is of no light, or two patterns set the same one.
pub(crate) fn factors(
    basis: &LightBasis,
    set: &[LightFactor],
) -> Result<Vec<(usize, Vec3)>, Misnamed> {
    let mut found: Vec<Option<&LightFactor>> = vec![None; basis.lights().len()];
    for one in set {
        let pattern = one.pattern.get_ref();
        let fitting = basis.matching(pattern);
        if fitting.is_empty() {
            let names = basis.lights().iter().map(|light| light.name.as_str());
            let names: Vec<&str> = names.collect();
            let problem = format!("`{pattern}` is no light: there are {}", names.join(", "));
            return Err((one.pattern.span(), problem));
        }
        for index in fitting {
            let name = &basis.lights()[index].name;
            match found[index] {
                Some(earlier) if earlier.pattern.get_ref() == name => {}
                Some(earlier) if pattern != name => {
                    let earlier = earlier.pattern.get_ref();
                    let problem = format!("`{name}` is set by `{earlier}` too");
                    return Err((one.pattern.span(), problem));
                }
                _ => found[index] = Some(one),
            }
        }
    }
    let found = found.into_iter().enumerate();
    Ok(found
        .filter_map(|(index, one)| Some((index, one?.factor)))
        .collect())
}
