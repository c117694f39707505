//! Irradiance of every Gaussian, gathered once.
//!
//! Stage 1 of the paper samples the hemisphere above every pixel anew in each iteration, although
//! irradiance does not change while albedos do. Here it is gathered at one point of each Gaussian,
//! the one that a training camera sees best; the irradiance of a pixel is the blend of that of its
//! Gaussians, and the image is linear in the albedo. The radiance of a diffuse Gaussian over its
//! irradiance is its albedo in closed form, `ρ = π r / E`: the start of the image loss.

use crate::error::Result;
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_light::irradiance::{self, NoisyLight};
use eagpt_light::surfaces;
use eagpt_scene::gaussians::MAX_ALBEDO;
use eagpt_scene::lamps::emits;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::{Front, Receiver};
use glam::{Vec3, Vec4};
use std::ops::Range;

/// Least and largest albedo in closed form, which the image loss may leave. What sends nothing, as
/// the back of a flat lamp, is to be black once the lamp is off.
const RANGE: (f32, f32) = (0.001, 0.95 * MAX_ALBEDO);
/// Share of its own light that a Gaussian must receive for the quotient to mean something.
const MIN_IRRADIANCE: f32 = 1e-4;
/// Opacity that gathered Gaussians must have in a pixel to shade it.
const MIN_KNOWN: f32 = 1e-3;

/// The Gaussians that training cameras see, each with a point of the surface it is part of, and the
/// light there.
pub(super) struct GaussianIrradiance {
    /// Indices and surfaces of the Gaussians seen.
    seen: Vec<Receiver>,
    /// Sides from which all Gaussians are seen, `[n]`.
    fronts: Vec<Front>,
    /// Light of emitters, of the first of `seen`.
    direct: NoisyLight,
    /// Light of all others.
    indirect: NoisyLight,
    /// Irradiance over π, once all is gathered.
    irradiance: Vec<Vec3>,
}

impl GaussianIrradiance {
    /// Looks for each best pixel of the `gaussians` that `scene` traces in all `cameras`.
    ///
    /// # Errors
    /// If the device of the `scene` fails.
    pub(super) fn new(
        scene: &dyn Tracer,
        gaussians: &Gaussians,
        cameras: &[Camera],
    ) -> Result<Self> {
        let seen = surfaces::best_seen(scene, gaussians.len(), cameras)?;
        Ok(Self {
            seen: surfaces::receivers(&seen),
            fronts: surfaces::fronts(gaussians, &seen),
            direct: NoisyLight::default(),
            indirect: NoisyLight::default(),
            irradiance: Vec::new(),
        })
    }

    /// Number of Gaussians to gather for.
    pub(super) fn len(&self) -> usize {
        self.seen.len()
    }

    /// Gathers for the next of them, `range`, in `num_samples` directions at each, of the light of
    /// the `gaussians` that `scene` traces; random numbers are those of `key`. The light is known
    /// once all is gathered.
    ///
    /// # Errors
    /// If the device of the `scene` fails.
    pub(super) fn gather(
        &mut self,
        (scene, gaussians): (&dyn Tracer, &Gaussians),
        range: Range<usize>,
        num_samples: u32,
        key: RandomKey,
    ) -> Result<()> {
        debug_assert_eq!(range.start, self.direct.irradiance.len());
        let directions = irradiance::directions(num_samples);
        let scene = (scene, gaussians, self.fronts.as_slice());
        let matrix = irradiance::rows(scene, &self.seen[range], directions, key)?;
        let indirect = NoisyLight::indirect(&matrix, directions, &gaussians.radiances);
        self.direct.append(NoisyLight::direct(&matrix, directions));
        self.indirect.append(indirect);
        if self.direct.irradiance.len() == self.seen.len() {
            let smoothing = Smoothing::new(&self.seen);
            let [direct, indirect] =
                [&self.direct, &self.indirect].map(|light| light.smoothed(&smoothing));
            self.irradiance = direct.iter().zip(&indirect).map(|(d, i)| *d + *i).collect();
        }
        Ok(())
    }

    /// The Gaussians seen, with the irradiance over π there; none before all is gathered.
    pub(super) fn received(&self) -> Vec<(Receiver, Vec3)> {
        let seen = self.seen.iter().copied();
        seen.zip(self.irradiance.iter().copied()).collect()
    }

    /// Irradiance over π of each Gaussian, and 1 where it is known or else zeros, `[n]`.
    pub(super) fn by_gaussian(&self, num: usize) -> Vec<Vec4> {
        let mut known = vec![Vec4::ZERO; num];
        for ((i, _), irradiance) in self.seen.iter().zip(&self.irradiance) {
            known[*i as usize] = irradiance.extend(1.0);
        }
        known
    }
}

/// `gaussians`, of which [`irradiance::bright`] ones emit, too. What is left of a lamp that was not
/// found, and a patch of sun, are small and bright: cosine samples meet them by chance, and where one
/// does, a Gaussian is lit ten times too much, its albedo a tenth of what it is. As emitters they
/// are sampled; the mean stays.
pub(super) fn with_bright_as_emitters(gaussians: &Gaussians) -> Gaussians {
    let mut lit = gaussians.clone();
    for i in irradiance::bright(gaussians, &gaussians.radiances) {
        lit.emissions[i] = 1.0;
    }
    lit
}

/// Gaussians in one light.
pub(super) struct LitGaussians<'a> {
    pub(super) gaussians: &'a Gaussians,
    /// The light gathered there.
    pub(super) irradiance: &'a GaussianIrradiance,
    /// Of the radiance of each, the share that an albedo is to explain, `[n]`; empty where it is
    /// all.
    pub(super) shares: &'a [f32],
}

/// The closed form for every Gaussian that reflects and that light reaches; others keep their
/// albedo. Of several lights, those in which it reflects count together. `[n]`
///
/// `lights`: at least one.
pub(super) fn albedos(lights: &[LitGaussians]) -> Vec<Vec3> {
    let mut albedos = lights[0].gaussians.albedos.clone();
    let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); albedos.len()];
    for light in lights {
        let gathered = light.irradiance;
        for ((i, _), irradiance) in gathered.seen.iter().zip(&gathered.irradiance) {
            let i = *i as usize;
            // The light that an emitter reflects is not seen beside its own.
            if !emits(light.gaussians.emissions[i]) {
                let share = light.shares.get(i).copied().unwrap_or(1.0);
                sums[i].0 += light.gaussians.radiances[i] * share;
                sums[i].1 += *irradiance;
            }
        }
    }
    for (albedo, (radiance, irradiance)) in albedos.iter_mut().zip(sums) {
        if irradiance.min_element() > MIN_IRRADIANCE * radiance.max_element() {
            *albedo = (radiance / irradiance).clamp(Vec3::splat(RANGE.0), Vec3::splat(RANGE.1));
        }
    }
    albedos
}

/// Irradiance over π of every pixel: what Gaussians in it know, given the features of their blend,
/// those of [`GaussianIrradiance::by_gaussian`].
pub(super) fn of_pixels(blended: &[Vec4]) -> Vec<Vec3> {
    let light = |sum: &Vec4| {
        if sum.w > MIN_KNOWN {
            sum.truncate() / sum.w
        } else {
            Vec3::ZERO
        }
    };
    blended.iter().map(light).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::Purpose;
    use eagpt_testkit::gaussians::{look_at, material, sphere};
    use eagpt_trace::cpu::CpuScene;
    use eagpt_trace::transport::start::Surface;
    use glam::DVec3;

    /// The albedo of a Gaussian of this radiance where irradiance over π is 0.5.
    fn albedo_of(radiance: f32) -> f32 {
        let disc = material(Vec3::splat(radiance), 0.0, Vec3::splat(0.4));
        let gaussians = [disc].into_iter().collect();
        let surface = Surface {
            position: Vec3::ZERO,
            normal: Vec3::Z,
            offset: 0.0,
        };
        let irradiance = GaussianIrradiance {
            seen: vec![(0, surface)],
            fronts: Vec::new(),
            direct: NoisyLight::default(),
            indirect: NoisyLight::default(),
            irradiance: vec![Vec3::splat(0.5)],
        };
        let light = LitGaussians {
            gaussians: &gaussians,
            irradiance: &irradiance,
            shares: &[],
        };
        albedos(&[light])[0].x
    }

    #[test]
    fn dark_surfaces_are_dark_and_what_sends_nothing_is_black() {
        for (radiance, albedo) in [(0.2, 0.4), (0.005, 0.01)] {
            assert!((albedo_of(radiance) - albedo).abs() < 1e-6, "{radiance}");
        }
        // The blackest paint reflects ten times more.
        assert!(albedo_of(1e-6) <= 1.001e-3);
    }

    /// Inside a sphere every point receives the same light of each of its parts. A disc far brighter
    /// than the rest gives noise alone unless it is sampled.
    #[test]
    fn a_small_bright_surface_lights_all_receivers_alike() {
        let light = |towards: Vec3| if towards.z > 0.999 { 500.0 } else { 1.0 };
        let scene = sphere(3000, 1.0, |towards| {
            material(Vec3::splat(light(towards)), 0.0, Vec3::splat(0.5))
        });
        let lit = with_bright_as_emitters(&scene);
        let num_lit = lit.emissions.iter().filter(|&&e| emits(e)).count();
        assert!((1..10).contains(&num_lit), "{num_lit}");
        let cameras = [DVec3::X, DVec3::Y].map(|to| look_at(DVec3::ZERO, to, 96, 96));
        let [plain, sampled] = [&scene, &lit].map(|scene| {
            let tracer = CpuScene::new(scene);
            let mut gathered = GaussianIrradiance::new(&tracer, scene, &cameras).unwrap();
            let key = RandomKey::new(3, Purpose::Albedo, 0);
            let all = 0..gathered.len();
            (gathered.gather((&tracer, scene), all, 64, key)).unwrap();
            let parts = gathered
                .direct
                .irradiance
                .iter()
                .zip(&gathered.indirect.irradiance);
            let light: Vec<f32> = parts.map(|(d, i)| d.x + i.x).collect();
            let num = light.len() as f32;
            let mean = light.iter().sum::<f32>() / num;
            let squares = light.iter().map(|l| (l - mean).powi(2)).sum::<f32>();
            (mean, (squares / num).sqrt(), num)
        });
        // Receivers are many, but all meet the same few discs: their noise is independent.
        assert!(
            (plain.0 - sampled.0).abs() < 4.0 * plain.1 / plain.2.sqrt(),
            "{plain:?} {sampled:?}"
        );
        assert!(sampled.1 < 0.2 * plain.1, "{plain:?} {sampled:?}");
    }
}
