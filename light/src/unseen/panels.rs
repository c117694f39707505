//! Cells of the hull as Gaussians, and those that shine as lamps.

use super::hull::{Cell, Hull};
use crate::hidden_lamps::HiddenLamps;
use eagpt_scene::lamps::Lamp;
use eagpt_scene::{Gaussian, Gloss, Harmonics, LampShape, SceneEdit};
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;
use std::f32::consts::TAU;

/// Standard deviation of the disc of a cell that reflects, in its lengths: with it discs of
/// neighbours cover all between them.
const SPREAD: f32 = 0.5;
/// Discs before it that shine, along each edge of a cell, their standard deviation in parts of what
/// each is the middle of, and their distance from the other in lengths.
const ALONG: u32 = 4;
const SPREAD_OF_LIGHT: f32 = 0.2;
const BEFORE: f32 = 0.01;
const OPACITY: f32 = 0.99;
/// Part of a cell that these cover.
const COVERED: f32 = TAU * SPREAD_OF_LIGHT * SPREAD_OF_LIGHT * OPACITY;

/// A cell that closes the room.
pub(super) struct UnseenCell {
    pub(super) number: usize,
    pub(super) albedo: Vec3,
    /// Radiance that it reflects …
    pub(super) reflected: Vec3,
    /// … and mean radiance that it sends of its own, zero where it does not shine.
    pub(super) emitted: Vec3,
}

/// The cells in a scene of `num_gaussians`: discs that reflect, and then those that shine; and a
/// lamp of each set of cells that shine and are neighbours on a face.
pub(super) fn panels(
    (hull, num_gaussians): (&Hull, usize),
    cells: impl Iterator<Item = UnseenCell>,
) -> HiddenLamps {
    let (mut discs, mut shining) = (Vec::new(), BTreeMap::new());
    for unseen in cells {
        let cell = hull.cell(unseen.number);
        discs.push(Gaussian {
            radiance: unseen.reflected,
            albedo: unseen.albedo,
            ..disc(hull, cell, SPREAD)
        });
        if unseen.emitted != Vec3::ZERO {
            shining.insert(cell, unseen.emitted);
        }
    }
    let lights = shining.iter();
    discs.extend(lights.flat_map(|(cell, emitted)| lights_of(hull, *cell, *emitted)));
    HiddenLamps {
        edit: SceneEdit {
            fixed: discs.into_iter().collect(),
            ..SceneEdit::nothing(num_gaussians)
        },
        lamps: lamps(hull, shining),
    }
}

fn disc(hull: &Hull, cell: Cell, spread: f32) -> Gaussian {
    Gaussian {
        position: hull.middle(cell),
        scale: spread * Vec2::from_array(hull.lengths(cell.face)),
        rotation: hull.rotation_of(cell.face),
        opacity: OPACITY,
        radiance: Vec3::ZERO,
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 0.0,
        albedo: Vec3::ZERO,
    }
}

/// Discs that send this mean radiance from a cell, in rows: of a cell that is hidden in part, that
/// part of them is.
fn lights_of(hull: &Hull, cell: Cell, emitted: Vec3) -> Vec<Gaussian> {
    let whole = disc(hull, cell, SPREAD_OF_LIGHT);
    let lengths = Vec2::from_array(hull.lengths(cell.face));
    let place = |k: u32| (2 * k + 1) as f32 / (2 * ALONG) as f32 - 0.5;
    let light = |k: u32| {
        let along = lengths * Vec2::new(place(k % ALONG), place(k / ALONG));
        Gaussian {
            position: whole.position
                + whole.rotation * along.extend(BEFORE * lengths.min_element()),
            scale: whole.scale / ALONG as f32,
            radiance: emitted / COVERED,
            emission: 1.0,
            ..whole
        }
    };
    (0..ALONG * ALONG).map(light).collect()
}

/// One for each set of cells that are neighbours, of cells with the mean radiance of each.
fn lamps(hull: &Hull, mut shining: BTreeMap<Cell, Vec3>) -> Vec<Lamp> {
    let mut lamps = Vec::new();
    while let Some(first) = shining.pop_first() {
        let mut own = vec![first];
        let mut next = 0;
        while let Some((Cell { face, at: [i, j] }, _)) = own.get(next).copied() {
            for at in [
                [i + 1, j],
                [i, j + 1],
                [i.wrapping_sub(1), j],
                [i, j.wrapping_sub(1)],
            ] {
                own.extend(shining.remove_entry(&Cell { face, at }));
            }
            next += 1;
        }
        lamps.push(lamp(hull, &own));
    }
    lamps
}

fn lamp(hull: &Hull, cells: &[(Cell, Vec3)]) -> Lamp {
    let face = cells[0].0.face;
    let (rotation, lengths) = (hull.rotation_of(face), Vec2::from_array(hull.lengths(face)));
    let places = cells
        .iter()
        .map(|(cell, _)| rotation.conjugate() * hull.middle(*cell));
    let ends = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let [low, high] = places.fold(ends, |[low, high], p| [low.min(p), high.max(p)]);
    let area = lengths.element_product() * cells.len() as f32;
    let sum: Vec3 = cells.iter().map(|(_, radiance)| *radiance).sum();
    let radiance = sum / cells.len() as f32;
    let size = ((high - low).truncate() + lengths).extend(0.0);
    let frame = (rotation * (0.5 * (low + high)), rotation, size);
    Lamp {
        one_sided: true,
        num_gaussians: cells.len() * (ALONG * ALONG) as usize,
        ..Lamp::unmeasured(LampShape::Panel, frame, (area, radiance))
    }
}
