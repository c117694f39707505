//! Overlays, dropped regions and reports, once views have been compared.

use super::request::MaskProgress;
use super::{MaskJob, Masked, mask_file, overlay_file};
use crate::consistency::{Comparison, Verdict};
use crate::error::Result;
use crate::mask::{Mask, Region};
use crate::options::Inconsistent;
use crate::overlay;
use crate::report::{RegionReport, ViewReport, ViewVerdict};
use eagpt_scene::Camera;
use eagpt_scene::exr;
use std::path::Path;

impl MaskJob<'_> {
    /// Writes overlays, drops inconsistent regions if asked to, and reports on all views.
    pub(super) fn finish_views(
        &mut self,
        masked: &Masked,
        comparison: Option<&Comparison>,
    ) -> Result<(Vec<ViewReport>, Vec<RegionReport>)> {
        let total = self.num_views();
        let (mut views, mut all_regions) = (Vec::new(), Vec::new());
        for index in 0..total {
            let (view, regions) = self.finish_view(index, masked, comparison)?;
            views.push(view);
            all_regions.extend(regions);
            let done = index + 1;
            (self.progress)(MaskProgress::Drawing { done, total });
        }
        Ok((views, all_regions))
    }

    fn finish_view(
        &self,
        index: usize,
        masked: &Masked,
        comparison: Option<&Comparison>,
    ) -> Result<(ViewReport, Vec<RegionReport>)> {
        let frame = &self.request.dataset.frames()[index];
        let check = self.request.options.check;
        let mask_path = self.request.out.join(mask_file(&frame.name));
        let mask = masked.is_known[index].then(|| read_mask(&mask_path, &frame.camera));
        let mut mask = mask.transpose()?;
        let regions = mask.as_ref().map(Mask::regions).unwrap_or_default();
        let mut reports = Vec::with_capacity(regions.len());
        for (number, region) in regions.iter().enumerate() {
            let support = comparison.map(|found| found.support[index][number].clone());
            let verdict = support.as_ref().map(|s| s.verdict(check.min_support));
            let dropped =
                verdict == Some(Verdict::Inconsistent) && check.inconsistent == Inconsistent::Drop;
            if let (true, Some(mask)) = (dropped, &mut mask) {
                mask.remove(region);
            }
            reports.push(RegionReport {
                view: frame.name.clone(),
                centre: region.centre(),
                num_pixels: region.pixels.len(),
                verdict,
                support: support.unwrap_or_default(),
                dropped,
            });
        }
        if let (true, Some(mask)) = (reports.iter().any(|r| r.dropped), &mask) {
            self.write_mask(&frame.name, mask)?;
        }
        let radiance = exr::read_rgb(&frame.files.radiance)?;
        let verdicts = reports.iter().map(|report| report.verdict);
        let drawn: Vec<(Region, Option<Verdict>)> = regions.into_iter().zip(verdicts).collect();
        let picture = self.place(&overlay_file(&frame.name))?;
        overlay::write(&picture, &radiance, &drawn, masked.meter.stops())?;
        let num_dropped = reports.iter().filter(|r| r.dropped).count();
        let mut view = ViewReport {
            name: frame.name.clone(),
            verdict: ViewVerdict::Unknown,
            num_pixels: mask.as_ref().map(Mask::count),
            coverage: mask.as_ref().map(Mask::coverage),
            num_regions: reports.len() - num_dropped,
            labelled: self.label(index).is_some(),
            num_inconsistent: reports
                .iter()
                .filter(|r| r.verdict == Some(Verdict::Inconsistent))
                .count(),
            missed: comparison.and_then(|found| found.missed[index]),
        };
        view.verdict = view.judge();
        Ok((view, reports))
    }
}

/// A mask that this job has written.
fn read_mask(path: &Path, camera: &Camera) -> Result<Mask> {
    let image = exr::read_single(path)?;
    Ok(Mask::from_fn(camera.width, camera.height, |x, y| {
        image.get(x, y)[0] > 0.5
    }))
}
