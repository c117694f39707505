//! Lamps of a scene: groups of Gaussians that emit, each a clean surface with the light that leaves
//! it. [`LAMPS_FILE`] stands beside the `scene.ply` that a training writes.

mod file;

#[cfg(test)]
mod tests;

pub use file::{ALL_LAMPS_DIR, LAMPS_FILE, lamps_file_beside, read_lamps, write_lamps};

use crate::color::luminance;
use crate::rotation;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f32::consts::PI;
use std::fmt;

/// Emission above which a Gaussian or a blended hit is an emitter, τ_E of the paper.
pub const EMISSION_THRESHOLD: f32 = 0.1;

/// Whether a Gaussian of this emission is an emitter: it keeps its radiance whatever lights it.
pub fn emits(emission: f32) -> bool {
    emission > EMISSION_THRESHOLD
}

/// Grows the box of a lamp on every side, in parts of its largest size: centres of its Gaussians
/// scatter about the clean surface, and a panel's box has no thickness of its own.
pub const BOX_MARGIN: f32 = 0.15;

/// The form of a lamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LampShape {
    /// Flat.
    Panel,
    /// Round.
    Ball,
    /// Long and round.
    Tube,
    /// Six rectangles.
    Box,
    /// None of these.
    Other,
}

impl LampShape {
    /// Whether it encloses a volume.
    pub fn is_solid(self) -> bool {
        matches!(self, Self::Ball | Self::Tube | Self::Box)
    }

    /// Its name, as the file has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Panel => "panel",
            Self::Ball => "ball",
            Self::Tube => "tube",
            Self::Box => "box",
            Self::Other => "other",
        }
    }
}

impl fmt::Display for LampShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A lamp of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lamp {
    /// Name that no other lamp of the scene has, without `*`, as "ceiling-2".
    pub name: String,
    /// Its form.
    pub shape: LampShape,
    /// Middle of its box, world space, scene units.
    pub centre: [f32; 3],
    /// Unit quaternion, w first: world from the lamp's own axes. z is the normal of a panel and the
    /// axis of a tube.
    pub rotation: [f32; 4],
    /// Whole lengths of its box along its own axes, scene units, at least one positive; the third
    /// of a panel is 0.
    pub size: [f32; 3],
    /// Whether only the side that its z axis points to was seen to shine.
    pub one_sided: bool,
    /// Whether bars or a frame stand before it, as before a window.
    #[serde(default)]
    pub bars: bool,
    /// Radius of the opaque shade around it, whose inside shines with it, scene units; 0 without.
    #[serde(default)]
    pub shade: f32,
    /// Distance from its box up to which what emits, if it is in the grown box of no lamp, belongs
    /// to it, as parts of its fixture that it lights; scene units, 0 without.
    #[serde(default)]
    pub reach: f32,
    /// Area that emits, scene units², positive; of a tube with open ends that of its side.
    pub area: f32,
    /// Mean radiance of that area, linear Rec.709.
    pub radiance: [f32; 3],
    /// Radiant flux that leaves it, linear Rec.709: radiance × scene units² × sr.
    pub power: [f32; 3],
    /// Number of Gaussians that were taken for a part of it.
    pub num_gaussians: usize,
    /// Names of the views that see it.
    pub views: Vec<String>,
    /// Pixels of the emission masks of all these views that show it.
    pub num_pixels: usize,
    /// Standard deviation of the flux between views over its mean: how sure the flux is. 0 for a
    /// single view, which says nothing.
    pub deviation: f32,
    /// Multiplier, by channel, by which it sends more light than views see of it, as what it lights
    /// tells; 1 where that is nothing. Radiance and power have it already.
    pub factor: [f32; 3],
}

impl Lamp {
    /// A lamp without a name that no view has measured, in a box of this middle (world space),
    /// rotation (world from the lamp's own axes) and size (scene units), whose `area` (scene
    /// units²) sends `radiance` to one side of it.
    pub fn unmeasured(
        shape: LampShape,
        (centre, rotation, size): (Vec3, Quat, Vec3),
        (area, radiance): (f32, Vec3),
    ) -> Self {
        Self {
            name: String::new(),
            shape,
            centre: centre.to_array(),
            rotation: [rotation.w, rotation.x, rotation.y, rotation.z],
            size: size.to_array(),
            one_sided: false,
            bars: false,
            shade: 0.0,
            reach: 0.0,
            area,
            radiance: radiance.to_array(),
            power: (PI * area * radiance).to_array(),
            num_gaussians: 0,
            views: Vec::new(),
            num_pixels: 0,
            deviation: 0.0,
            factor: [1.0; 3],
        }
    }

    /// Whether `position` (world space, scene units) is in the box of the lamp, grown on every side
    /// by 15 % of its largest size, or as large as its shade.
    pub fn contains(&self, position: Vec3) -> bool {
        self.relative_distance(position) <= 1.0
    }

    /// Distance of its box from a place, world space, scene units; 0 within.
    pub fn distance(&self, position: Vec3) -> f32 {
        let local = self.world_from_lamp().conjugate() * (position - self.centre());
        let outside = local.abs() - 0.5 * Vec3::from(self.size);
        outside.max(Vec3::ZERO).length()
    }

    /// Distance from the centre in parts of the grown box of [`Self::contains`]: 0 in the centre, 1
    /// on the faces of the box.
    pub fn relative_distance(&self, position: Vec3) -> f32 {
        let local = self.world_from_lamp().conjugate() * (position - self.centre());
        (local / self.half_grown()).abs().max_element()
    }

    /// Lowest and highest corner of the axis-aligned box around the lamp's own, world space, scene
    /// units.
    pub fn bounds(&self) -> [Vec3; 2] {
        let rotation = self.world_from_lamp();
        let half = 0.5 * Vec3::from(self.size);
        let reach = (rotation * Vec3::X).abs() * half.x
            + (rotation * Vec3::Y).abs() * half.y
            + (rotation * Vec3::Z).abs() * half.z;
        [self.centre() - reach, self.centre() + reach]
    }

    /// Middle, world space, scene units.
    pub fn centre(&self) -> Vec3 {
        self.centre.into()
    }

    /// World from the lamp's own axes, a unit quaternion.
    pub fn world_from_lamp(&self) -> Quat {
        let [w, x, y, z] = self.rotation;
        rotation::unit(Quat::from_xyzw(x, y, z, w))
    }

    /// Multiplies its light, and its [`Self::factor`].
    pub fn strengthen(&mut self, by: Vec3) {
        for light in [&mut self.radiance, &mut self.power, &mut self.factor] {
            *light = (Vec3::from(*light) * by).to_array();
        }
    }

    /// Luminance of [`Self::power`].
    pub fn luminous_power(&self) -> f32 {
        luminance(self.power)
    }

    /// Half the lengths of the grown box, all positive.
    fn half_grown(&self) -> Vec3 {
        let size = Vec3::from(self.size);
        let half = 0.5 * size + BOX_MARGIN * size.max_element();
        half.max(Vec3::splat(self.shade))
    }
}

/// The lamps of a scene, whose names differ.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Lamps {
    /// The lamps; none where nothing emits.
    pub lamps: Vec<Lamp>,
}

impl Lamps {
    /// Index of the lamp that a Gaussian that emits belongs to if its centre is at `position`
    /// (world space, scene units). Of several whose boxes hold it the one with the least
    /// [`Lamp::relative_distance`], of equal ones the first; where none does, of those within whose
    /// [`Lamp::reach`] it is the nearest one.
    pub fn of(&self, position: Vec3) -> Option<usize> {
        let distances = self
            .lamps
            .iter()
            .map(|lamp| lamp.relative_distance(position));
        let inside = distances
            .enumerate()
            .filter(|(_, distance)| *distance <= 1.0);
        let nearest = inside.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(index, _)| index).or_else(|| {
            let reaches = |lamp: &Lamp| lamp.distance(position) <= lamp.reach;
            self.nearest(position, reaches)
        })
    }

    /// Index of the lamp whose box is nearest to `position` (world space, scene units), of those
    /// that are `among` them; of equal ones the first.
    pub fn nearest(&self, position: Vec3, among: impl Fn(&Lamp) -> bool) -> Option<usize> {
        let lamps = self.lamps.iter().enumerate();
        let lamps = lamps.filter(|(_, lamp)| among(lamp));
        let distances = lamps.map(|(index, lamp)| (index, lamp.distance(position)));
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(index, _)| index)
    }

    /// The lamps of two lists, those with most power first, and numbered in that order.
    pub fn joined(mut self, others: Self) -> Self {
        self.lamps.extend(others.lamps);
        let power = |lamp: &Lamp| lamp.luminous_power();
        (self.lamps).sort_by(|a, b| power(b).total_cmp(&power(a)));
        let mut counts = BTreeMap::new();
        for lamp in &mut self.lamps {
            let kind = lamp
                .name
                .rsplit_once('-')
                .map_or(&*lamp.name, |name| name.0);
            let kind = kind.to_owned();
            let count = counts.entry(kind.clone()).or_insert(0);
            *count += 1;
            lamp.name = format!("{kind}-{count}");
        }
        self
    }

    /// The lamp of this name.
    pub fn named(&self, name: &str) -> Option<&Lamp> {
        self.lamps.iter().find(|lamp| lamp.name == name)
    }

    /// Indices of the lamps whose name fits a pattern, in which `*` stands for any text.
    pub fn matching(&self, pattern: &str) -> Vec<usize> {
        let lamps = self.lamps.iter().enumerate();
        let fitting = lamps.filter(|(_, lamp)| fits(&lamp.name, pattern));
        fitting.map(|(index, _)| index).collect()
    }

    /// Names of all lamps, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.lamps.iter().map(|lamp| lamp.name.as_str())
    }
}

/// Whether a name is the pattern with some text in place of each `*`.
pub(crate) fn fits(name: &str, pattern: &str) -> bool {
    let Some((first, rest)) = pattern.split_once('*') else {
        return name == pattern;
    };
    let Some(mut name) = name.strip_prefix(first) else {
        return false;
    };
    let (middle, last) = rest.rsplit_once('*').unwrap_or(("", rest));
    // The earliest place of each part leaves the most for those behind it.
    for part in middle.split('*') {
        match name.find(part) {
            Some(at) => name = &name[at + part.len()..],
            None => return false,
        }
    }
    name.ends_with(last)
}
