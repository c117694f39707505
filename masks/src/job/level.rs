//! The level of a dataset: from the radiances of all views, and the regions of dim lamps.

use super::MaskJob;
use super::request::MaskProgress;
use crate::error::{MaskError, Result};
use crate::level::{Dimmer, Histogram, Level};
use crate::options::MaskSource;

impl MaskJob<'_> {
    /// The level; `None` if the options ask for another source.
    pub(super) fn find_level(&mut self) -> Result<Option<Level>> {
        if self.request.options.source != MaskSource::Auto {
            return Ok(None);
        }
        let total = self.num_views();
        let mut histogram = Histogram::default();
        for index in 0..total {
            let view = self.request.dataset.load_view(index)?;
            if let Some(light) = self.request.light(&view)? {
                histogram.add(self.request.measured(&light));
            }
            let done = index + 1;
            (self.progress)(MaskProgress::Measuring { done, total });
        }
        let level = histogram.level();
        let dimmest = self.dimmest(histogram.dimmer(level.as_ref().ok()))?;
        let level = match dimmest {
            Some(level) => level,
            None => level.map_err(|problem| {
                let path = self.request.dataset.root().to_owned();
                MaskError::NoLevel { path, problem }
            })?,
        };
        (self.progress)(MaskProgress::Level(level));
        Ok(Some(level))
    }

    /// The level of the first of some peaks that is a lamp's.
    fn dimmest(&mut self, mut peaks: Vec<Dimmer>) -> Result<Option<Level>> {
        if peaks.is_empty() {
            return Ok(None);
        }
        let options = &self.request.options;
        for index in 0..self.num_views() {
            let view = self.request.dataset.load_view(index)?;
            let Some(light) = self.request.light(&view)? else {
                continue;
            };
            let values = light.map(|&rgb| [options.rule.value(rgb)]);
            for peak in &mut peaks {
                peak.add(&values, options.min_pixels);
            }
        }
        let lamp = peaks.iter().find(|peak| peak.is_lamp());
        Ok(lamp.map(|peak| peak.level))
    }
}
