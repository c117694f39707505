//! Lamps by comparison with other lights: what a lamp gives is the difference between a photograph
//! with it and one without it, from the same place.

use super::request::MaskRequest;
use crate::error::Result;
use eagpt_scene::{Camera, Dataset, Image, SceneError, View};
use std::borrow::Cow;

/// Least share of a pixel's light that is more than noise of two photographs.
const MIN_SHARE: f32 = 0.02;

/// # Errors
/// If a dataset of another light has no camera of the request's.
pub(super) fn check(request: &MaskRequest<'_>) -> Result<()> {
    let frames = request.dataset.frames();
    for other in &request.off {
        if !frames
            .iter()
            .any(|frame| same(other, &frame.camera).is_some())
        {
            let problem = format!(
                "no view has a camera of {}: lights are compared pixel by pixel",
                request.dataset.root().display()
            );
            return Err(SceneError::invalid(other.transforms(), "frames", problem).into());
        }
    }
    Ok(())
}

/// Index of the view of `dataset` that `camera` took.
fn same(dataset: &Dataset, camera: &Camera) -> Option<usize> {
    let frames = dataset.frames();
    frames.iter().position(|frame| frame.camera == *camera)
}

impl MaskRequest<'_> {
    /// Linear radiance that a threshold applies to: all of the view, or that which the darkest of
    /// the other lights does not have, at least 0. `None` where no other light has the view.
    pub(super) fn light<'v>(&self, view: &'v View) -> Result<Option<Cow<'v, Image<3>>>> {
        let others = &self.off;
        if others.is_empty() {
            return Ok(Some(Cow::Borrowed(&view.radiance)));
        }
        let mut light: Option<Image<3>> = None;
        for other in others {
            let Some(index) = same(other, &view.camera) else {
                continue;
            };
            let dark = other.load_view(index)?.radiance;
            let light = light.get_or_insert_with(|| view.radiance.map(|_| [0.0; 3]));
            let pairs = view.radiance.pixels().iter().zip(dark.pixels());
            for (more, (lit, dark)) in light.pixels_mut().iter_mut().zip(pairs) {
                *more = std::array::from_fn(|c| {
                    let added = lit[c] - dark[c];
                    match added > MIN_SHARE * lit[c] {
                        true => more[c].max(added),
                        false => more[c],
                    }
                });
            }
        }
        Ok(light.map(Cow::Owned))
    }

    /// The values of `light` that a level is looked for in: where lights are compared, those that
    /// are there at all. What another lamp lights says nothing of the surfaces that this one does.
    pub(super) fn measured(&self, light: &Image<3>) -> impl Iterator<Item = f32> {
        let rule = self.options.rule;
        let compares = !self.off.is_empty();
        let values = light.pixels().iter().map(move |&rgb| rule.value(rgb));
        values.filter(move |value| !compares || *value > 0.0)
    }
}
