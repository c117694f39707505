//! Surfaces of one material have one albedo wherever they are: by it, light that no view shows is
//! told from the brightness of what it lights.

mod fit;
#[cfg(test)]
pub(crate) mod testing;

pub(crate) use fit::{Expected, Fit, Residual, Row};

use crate::irradiance::smooth::Smoothing;
use crate::segments::Segments;
use eagpt_scene::Gaussians;
use eagpt_scene::lamps::emits;
use eagpt_scene::median::median_of;
use eagpt_trace::transport::matrix::Receiver;
use fit::Equations;
use glam::Vec3;
use std::collections::BTreeMap;

/// Albedo in a channel that surfaces have at most.
pub(crate) const MAX_ALBEDO: f32 = 0.9;
/// Receivers that are compared, at most: differences between them are few.
const MAX_RECEIVERS: usize = 16_384;
/// Light of single receivers below this part of the median is noise. The mean would be that of the
/// few beside lamps.
const DARK: f32 = 0.02;
/// Receivers of a surface of one material, at least.
const LEAST_OF_SEGMENT: usize = 30;

/// Receivers that are compared: they are lit, and do not shine themselves.
pub(crate) struct Compared {
    pub(crate) receivers: Vec<Receiver>,
    /// Radiance, `[receivers]`.
    pub(crate) radiances: Vec<Vec3>,
    /// Irradiance over π of all that is known, `[receivers]`.
    pub(crate) known: Vec<Vec3>,
    pub(crate) smoothing: Smoothing,
}

impl Compared {
    /// Some of the receivers of `received`, the light that `gaussians` get of all that is known.
    pub(crate) fn new(gaussians: &Gaussians, received: &[(Receiver, Vec3)]) -> Self {
        let reflects = |of: &&(Receiver, Vec3)| !emits(gaussians.emissions[of.0.0 as usize]);
        let received: Vec<_> = received.iter().filter(reflects).collect();
        let step = received.len().div_ceil(MAX_RECEIVERS).max(1);
        let radiance = |of: &(Receiver, Vec3)| gaussians.radiances[of.0.0 as usize];
        let least = |light: &dyn Fn(&(Receiver, Vec3)) -> Vec3| {
            DARK * median_of(received.iter().map(|of| light(of).max_element()))
        };
        let (sent, got) = (least(&radiance), least(&|of| of.1));
        let is_lit =
            |of: &&(Receiver, Vec3)| radiance(of).min_element() > sent && of.1.min_element() > got;
        let some: Vec<_> = received.into_iter().step_by(step).filter(is_lit).collect();
        let receivers: Vec<Receiver> = some.iter().map(|of| of.0).collect();
        Self {
            smoothing: Smoothing::new(&receivers),
            receivers,
            radiances: some.iter().map(|of| radiance(of)).collect(),
            known: some.iter().map(|of| of.1).collect(),
        }
    }

    /// The radiance of sources, of each the `expected`, that makes albedos of each of `segments`
    /// alike in a channel of colour, where receivers have these radiances and this known light, and
    /// get of sources what `rows` say. If all `reflects`, albedos above 1 count as well.
    pub(crate) fn fit(
        &self,
        (segments, reflects): (&Segments, bool),
        rows: &[Row],
        [radiances, known]: [&[f64]; 2],
        expected: &BTreeMap<usize, Expected>,
    ) -> Fit {
        let equations = Equations {
            rows,
            radiances,
            known,
            expected,
            segments: &segments.of,
            least: LEAST_OF_SEGMENT,
            reflects,
        };
        equations.fit()
    }

    /// Residuals where receivers have these radiances and this light, and none may reflect more than
    /// it gets, `[receivers]`.
    pub(crate) fn residuals(
        &self,
        segments: &Segments,
        [radiances, light]: [&[f64]; 2],
    ) -> Vec<Residual> {
        let equations = Equations {
            rows: &vec![Row::new(); radiances.len()],
            radiances,
            known: light,
            expected: &BTreeMap::new(),
            segments: &segments.of,
            least: LEAST_OF_SEGMENT,
            reflects: true,
        };
        equations.residuals()
    }

    /// Radiances and known light in a channel, each `[receivers]`.
    pub(crate) fn channel(&self, channel: usize) -> [Vec<f64>; 2] {
        [&self.radiances, &self.known].map(|of| of.iter().map(|v| f64::from(v[channel])).collect())
    }

    /// Surfaces of one material where receivers get `more` light than is known, `[receivers]`: by
    /// albedo, not by radiance, as beside a lamp that differs more than materials do.
    pub(crate) fn segments(&self, more: &[Vec3]) -> Segments {
        let albedo = |i: usize| {
            let albedo = self.radiances[i] / (self.known[i] + more[i]);
            // Brighter than white is no material, but the one beside it in more light.
            albedo / (albedo.max_element() / MAX_ALBEDO).max(1.0)
        };
        let albedos: Vec<Vec3> = (0..self.radiances.len()).map(albedo).collect();
        Segments::of_colors(&albedos, &self.smoothing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_testkit::gaussians::{cube, material};
    use testing::in_cube;

    #[test]
    fn what_shines_itself_tells_no_albedo() {
        let emission = |p: Vec3| if p.z > 0.99 { 1.0 } else { 0.0 };
        let discs = cube(1.0, 0.1, |p| material(Vec3::ONE, emission(p), Vec3::ONE));
        let received: Vec<(Receiver, Vec3)> = (discs.iter().zip(0..))
            .map(|(disc, i)| (in_cube(disc, i), Vec3::ONE))
            .collect();
        let gaussians: Gaussians = discs.into_iter().collect();
        let compared = Compared::new(&gaussians, &received);
        let num_shining = gaussians.emissions.iter().filter(|e| **e > 0.0).count();
        assert!(num_shining > 0);
        assert_eq!(compared.receivers.len(), received.len() - num_shining);
    }

    #[test]
    fn receivers_beside_a_lamp_do_not_outshine_the_others() {
        let gaussians: Gaussians =
            (cube(1.0, 0.1, |_| material(Vec3::ONE, 0.0, Vec3::ONE)).into_iter()).collect();
        let received: Vec<(Receiver, Vec3)> = (gaussians.iter().zip(0..))
            .map(|(disc, i)| {
                let beside = disc.position.distance(Vec3::X) < 0.2;
                (
                    in_cube(&disc, i),
                    Vec3::splat(if beside { 1e5 } else { 1.0 }),
                )
            })
            .collect();
        let compared = Compared::new(&gaussians, &received);
        assert_eq!(compared.receivers.len(), received.len());
    }
}
