//! Actions on selected Gaussians.

use crate::lamp::NewLamp;
use crate::place::Placement;
use eagpt_scene::color::luminance;
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics};
use glam::Vec3;

/// An action on a selection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Action {
    /// Removes it.
    Remove,
    /// Removes everything else.
    KeepOnly,
    /// Replaces light or material of each Gaussian.
    Paint(Paint),
    /// Puts one clean surface in its place, which emits; further actions of the step act on that.
    MakeLamp(NewLamp),
    /// Moves, rotates or scales it.
    Place(Placement),
    /// Leaves it where it is and adds a copy; further actions of the step act on the copy.
    Duplicate(Placement),
    /// Moves it along the up axis until its lowest centre is at this height, scene units.
    SnapToFloor(f32),
}

/// A change of light or material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Paint {
    /// Radiance and emission become 0.
    LightsOff,
    /// Radiance times a factor for each channel, not negative.
    ScaleLight(Vec3),
    /// Radiance of this colour, its luminance kept.
    TintLight(Vec3),
    /// Radiance, linear Rec.709, not negative, the same in all directions.
    SetRadiance(Vec3),
    /// Emission score, 0 to 1.
    SetEmission(f32),
    /// Albedo, 0 to 1.
    SetAlbedo(Vec3),
    /// Albedo times a factor for each channel, not negative; ends at 1.
    ScaleAlbedo(Vec3),
    /// Albedo whose channel i was channel `[i]`.
    SwapAlbedo([usize; 3]),
    /// Roughness of the specular part, 0 to 1.
    SetRoughness(f32),
    /// F0 of the specular part, 0 to 1.
    SetSpecular(Vec3),
    /// No diffuse part, and this specular one.
    Metal(Gloss),
}

impl Paint {
    /// The Gaussian with the change made.
    pub(crate) fn apply(&self, mut g: Gaussian) -> Gaussian {
        match *self {
            Self::LightsOff => {
                g.radiance = Vec3::ZERO;
                g.harmonics = Harmonics::NONE;
                g.emission = 0.0;
            }
            Self::ScaleLight(factor) => g.radiance *= factor,
            Self::TintLight(color) => {
                let share = luminance(g.radiance.to_array()) / luminance(color.to_array());
                g.radiance = color * share;
            }
            Self::SetRadiance(radiance) => {
                g.radiance = radiance;
                g.harmonics = Harmonics::NONE;
            }
            Self::SetEmission(emission) => g.emission = emission,
            Self::SetAlbedo(albedo) => g.albedo = albedo,
            Self::ScaleAlbedo(factor) => {
                g.albedo = (g.albedo * factor).min(g.albedo.max(Vec3::ONE));
            }
            Self::SwapAlbedo([r, g_from, b]) => {
                g.albedo = Vec3::new(g.albedo[r], g.albedo[g_from], g.albedo[b]);
            }
            Self::SetRoughness(roughness) => g.gloss.roughness = roughness,
            Self::SetSpecular(specular) => g.gloss.specular = specular,
            Self::Metal(gloss) => (g.albedo, g.gloss) = (Vec3::ZERO, gloss),
        }
        g
    }
}

/// Bounds of the centres of the Gaussians in `mask`.
pub(crate) fn bounds(gaussians: &Gaussians, mask: &[bool]) -> Option<(Vec3, Vec3)> {
    let mut found: Option<(Vec3, Vec3)> = None;
    for (&p, _) in gaussians
        .positions
        .iter()
        .zip(mask)
        .filter(|(_, inside)| **inside)
    {
        found = Some(found.map_or((p, p), |(low, high)| (low.min(p), high.max(p))));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::disc;

    #[test]
    fn every_paint_changes_what_it_says() {
        let start = Gaussian {
            radiance: Vec3::new(1.0, 2.0, 4.0),
            emission: 0.75,
            albedo: Vec3::new(0.25, 0.5, 0.75),
            ..disc(Vec3::ZERO)
        };
        let lit = |radiance: [f32; 3], emission: f32| Gaussian {
            radiance: radiance.into(),
            emission,
            ..start
        };
        let diffuse = |albedo: [f32; 3]| Gaussian {
            albedo: albedo.into(),
            ..start
        };
        let shiny = Gloss {
            specular: Vec3::new(0.9, 0.7, 0.3),
            roughness: 0.125,
        };
        let glossy = |specular: Vec3, roughness: f32| Gaussian {
            gloss: Gloss {
                specular,
                roughness,
            },
            ..start
        };
        // 0.2126 · 1 + 0.7152 · 2 + 0.0722 · 4 = 1.9318; of green alone, 0.7152 to the unit.
        let green = 1.9318 / 0.7152;
        for (paint, expected) in [
            (Paint::LightsOff, lit([0.0; 3], 0.0)),
            (
                Paint::ScaleLight(Vec3::new(2.0, 1.0, 0.5)),
                lit([2.0; 3], 0.75),
            ),
            (Paint::TintLight(Vec3::Y), lit([0.0, green, 0.0], 0.75)),
            (
                Paint::TintLight(start.radiance * 7.0),
                lit([1.0, 2.0, 4.0], 0.75),
            ),
            (Paint::SetRadiance(Vec3::splat(9.0)), lit([9.0; 3], 0.75)),
            (Paint::SetEmission(1.0), lit([1.0, 2.0, 4.0], 1.0)),
            (Paint::SetAlbedo(Vec3::splat(0.1)), diffuse([0.1; 3])),
            (
                Paint::ScaleAlbedo(Vec3::splat(1.5)),
                diffuse([0.375, 0.75, 1.0]),
            ),
            (Paint::SwapAlbedo([2, 0, 1]), diffuse([0.75, 0.25, 0.5])),
            (
                Paint::SetSpecular(shiny.specular),
                glossy(shiny.specular, 1.0),
            ),
            (Paint::SetRoughness(0.25), glossy(Vec3::ZERO, 0.25)),
            (
                Paint::Metal(shiny),
                Gaussian {
                    albedo: Vec3::ZERO,
                    gloss: shiny,
                    ..start
                },
            ),
        ] {
            let painted = paint.apply(start);
            assert!((painted.radiance - expected.radiance).length() < 1e-5);
            assert_eq!(
                Gaussian {
                    radiance: expected.radiance,
                    ..painted
                },
                expected,
                "{paint:?}"
            );
        }
    }
}
