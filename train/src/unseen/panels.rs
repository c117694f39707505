//! Parts of the hull that shine, as Gaussians and as lamps.

use super::hull::{Cell, Hull};
use eagpt_scene::lamps::Lamp;
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics, LampShape};
use glam::{Quat, Vec2, Vec3};
use std::collections::BTreeSet;
use std::f32::consts::PI;

/// What names of such lamps begin with.
pub(crate) const NAME: &str = "unseen-";

/// Standard deviation of the disc of a cell, in its lengths: with it discs of neighbours cover all
/// between them.
const SPREAD: f32 = 0.5;
const OPACITY: f32 = 0.99;

/// Flat lamps on the hull, each of cells that are neighbours on a face.
pub(crate) struct Panels {
    /// Disc of each cell that shines, lamp by lamp.
    pub(crate) discs: Gaussians,
    /// The lamps, which have no names yet.
    pub(crate) lamps: Vec<Lamp>,
}

impl Panels {
    /// Those of cells with these radiances, by their numbers.
    pub(super) fn new(hull: &Hull, radiances: &[Vec3]) -> Self {
        let light = |cell: &Cell| radiances[hull.number(*cell)];
        let mut shining: BTreeSet<Cell> = hull.cells().filter(|c| light(c) != Vec3::ZERO).collect();
        let (mut discs, mut lamps) = (Vec::new(), Vec::new());
        while let Some(first) = shining.pop_first() {
            let mut cells = vec![first];
            let mut next = 0;
            while let Some(&Cell { face, at: [i, j] }) = cells.get(next) {
                for at in [
                    [i + 1, j],
                    [i, j + 1],
                    [i.wrapping_sub(1), j],
                    [i, j.wrapping_sub(1)],
                ] {
                    cells.extend(shining.take(&Cell { face, at }));
                }
                next += 1;
            }
            let own: Vec<Gaussian> = cells.iter().map(|c| disc(hull, *c, light(c))).collect();
            lamps.push(lamp(hull, &cells, &own));
            discs.extend(own);
        }
        Self {
            discs: discs.into_iter().collect(),
            lamps,
        }
    }
}

/// World from a cell's own axes, the third of which points into the box.
fn rotation(hull: &Hull, face: u32) -> Quat {
    let turned = match face / 2 {
        0 => Quat::from_mat3(&glam::Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::X)),
        1 => Quat::from_mat3(&glam::Mat3::from_cols(Vec3::Z, Vec3::X, Vec3::Y)),
        _ => Quat::IDENTITY,
    };
    let inwards = match face % 2 {
        0 => Quat::IDENTITY,
        _ => Quat::from_rotation_x(PI),
    };
    hull.rotation * turned * inwards
}

fn disc(hull: &Hull, cell: Cell, radiance: Vec3) -> Gaussian {
    Gaussian {
        position: hull.middle(cell),
        scale: SPREAD * Vec2::from_array(hull.lengths(cell.face)),
        rotation: rotation(hull, cell.face),
        opacity: OPACITY,
        radiance,
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 1.0,
        albedo: Vec3::ZERO,
    }
}

fn lamp(hull: &Hull, cells: &[Cell], discs: &[Gaussian]) -> Lamp {
    let lengths = Vec2::from_array(hull.lengths(cells[0].face));
    let rotation = discs[0].rotation;
    let local = |disc: &Gaussian| rotation.conjugate() * disc.position;
    let (low, high) = discs.iter().map(local).fold(
        (Vec3::INFINITY, Vec3::NEG_INFINITY),
        |(low, high), place| (low.min(place), high.max(place)),
    );
    let sum: Vec3 = discs.iter().map(|disc| disc.radiance).sum();
    let radiance = sum / discs.len() as f32;
    let area = lengths.element_product() * cells.len() as f32;
    Lamp {
        name: String::new(),
        shape: LampShape::Panel,
        centre: (rotation * (0.5 * (low + high))).to_array(),
        rotation: [rotation.w, rotation.x, rotation.y, rotation.z],
        size: ((high - low).truncate() + lengths).extend(0.0).to_array(),
        one_sided: true,
        bars: false,
        area,
        radiance: radiance.to_array(),
        power: (PI * area * radiance).to_array(),
        num_gaussians: discs.len(),
        views: Vec::new(),
        num_pixels: 0,
        deviation: 0.0,
        factor: [1.0; 3],
    }
}
