//! The box around a scene, whose faces are divided into cells.

use eagpt_trace::transport::start::Surface;
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::PI;

/// Receivers beyond either end of an axis that are strays, and what the box is larger by on every
/// side, in parts of its longest edge: so that no surface is outside of it.
const STRAYS: f32 = 0.001;
const MARGIN: f32 = 0.02;
/// Cells along the edge of a cube of the volume of the box. With four to eight the same light is
/// found.
const CELLS_ALONG: f32 = 6.0;
/// Cells along any edge, at most.
const MAX_ALONG: u32 = 24;

/// Two sides of each of three axes.
pub(super) const NUM_FACES: u32 = 6;
/// The face below, where no lamps are.
pub(super) const FLOOR: u32 = 4;

/// The box, whose third axis is upright, and its cells, which are counted face by face.
pub(crate) struct Hull {
    /// World from the box's own axes.
    pub(crate) rotation: Quat,
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
    /// Cells along each axis.
    pub(super) num: [u32; 3],
}

/// A cell of a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Cell {
    /// Twice the axis that it is at right angles to, and one more on the high side.
    pub(super) face: u32,
    /// Numbers along the two axes after that one.
    pub(super) at: [u32; 2],
}

impl Hull {
    /// The box around surfaces at `places`, `up` being the unit vector upwards; `None` if there are
    /// none or they have no extent.
    pub(crate) fn around(places: &[Vec3], up: Vec3) -> Option<Self> {
        let rotation = Quat::from_rotation_arc(Vec3::Z, up);
        let to_local = Mat3::from_quat(rotation).transpose();
        let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
        let strays = (STRAYS * places.len() as f32) as usize;
        for axis in 0..3 {
            let along = places.iter().map(|place| (to_local * *place)[axis]);
            let mut along: Vec<f32> = along.collect();
            along.sort_unstable_by(f32::total_cmp);
            low[axis] = *along.get(strays)?;
            high[axis] = along[along.len() - 1 - strays];
        }
        let margin = MARGIN * (high - low).max_element();
        (low, high) = (low - margin, high + margin);
        let size = (high - low).element_product().cbrt() / CELLS_ALONG;
        if size <= 0.0 {
            return None;
        }
        let num = |axis: usize| {
            let num = ((high[axis] - low[axis]) / size).round() as u32;
            num.clamp(1, MAX_ALONG)
        };
        Some(Self {
            rotation,
            low,
            high,
            num: [0, 1, 2].map(num),
        })
    }

    /// Number that no cell's number reaches.
    pub(super) fn num_cells(&self) -> usize {
        (NUM_FACES * MAX_ALONG * MAX_ALONG) as usize
    }

    /// The number of a cell.
    pub(super) fn number(&self, cell: Cell) -> usize {
        ((cell.face * MAX_ALONG + cell.at[0]) * MAX_ALONG + cell.at[1]) as usize
    }

    /// The cell of a number.
    pub(super) fn cell(&self, number: usize) -> Cell {
        let (rest, second) = (number as u32 / MAX_ALONG, number as u32 % MAX_ALONG);
        Cell {
            face: rest / MAX_ALONG,
            at: [rest % MAX_ALONG, second],
        }
    }

    /// World from the own axes of cells of a face, the third of which points into the box.
    pub(super) fn rotation_of(&self, face: u32) -> Quat {
        let turned = match face / 2 {
            0 => Quat::from_mat3(&Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::X)),
            1 => Quat::from_mat3(&Mat3::from_cols(Vec3::Z, Vec3::X, Vec3::Y)),
            _ => Quat::IDENTITY,
        };
        let inwards = match face % 2 {
            0 => Quat::IDENTITY,
            _ => Quat::from_rotation_x(PI),
        };
        self.rotation * turned * inwards
    }

    /// The inner side of a cell.
    pub(super) fn surface(&self, number: usize) -> Surface {
        let cell = self.cell(number);
        Surface {
            position: self.middle(cell),
            normal: self.rotation_of(cell.face) * Vec3::Z,
            offset: 0.0,
        }
    }

    /// Lengths of a cell of a face.
    pub(super) fn lengths(&self, face: u32) -> [f32; 2] {
        axes(face).map(|axis| (self.high - self.low)[axis] / self.num[axis] as f32)
    }

    /// Middle of a cell, in world space.
    pub(super) fn middle(&self, cell: Cell) -> Vec3 {
        let mut middle = self.corner(cell.face);
        let local = axes(cell.face).into_iter().zip(self.lengths(cell.face));
        for ((axis, length), at) in local.zip(cell.at) {
            middle[axis] = self.low[axis] + length * (at as f32 + 0.5);
        }
        self.rotation * middle
    }

    /// Whether a place of world space is in the box.
    pub(super) fn holds(&self, place: Vec3) -> bool {
        let local = self.rotation.conjugate() * place;
        local.cmpge(self.low).all() && local.cmple(self.high).all()
    }

    /// The corner of the box, on its own axes, where a face is.
    pub(super) fn corner(&self, face: u32) -> Vec3 {
        match face.is_multiple_of(2) {
            true => self.low,
            false => self.high,
        }
    }

    /// The cell at which a ray leaves the box, in world space.
    pub(super) fn left_at(&self, origin: Vec3, direction: Vec3) -> Cell {
        let to_local = Mat3::from_quat(self.rotation).transpose();
        let (origin, direction) = (to_local * origin, to_local * direction);
        let inside = origin.clamp(self.low, self.high);
        let end = |axis: usize| {
            let towards = direction[axis];
            let side = if towards > 0.0 { self.high } else { self.low };
            match towards == 0.0 {
                true => f32::INFINITY,
                false => (side[axis] - inside[axis]) / towards,
            }
        };
        let ends = [0, 1, 2].map(end);
        let axis = (0..3).fold(
            0,
            |best, axis| if ends[axis] < ends[best] { axis } else { best },
        );
        let face = 2 * axis as u32 + u32::from(direction[axis] > 0.0);
        let place = inside + direction * ends[axis];
        let at = axes(face).map(|along| {
            let share = (place - self.low)[along] / (self.high - self.low)[along];
            let number = (share * self.num[along] as f32).max(0.0) as u32;
            number.min(self.num[along] - 1)
        });
        Cell { face, at }
    }
}

/// The two axes of a face.
fn axes(face: u32) -> [usize; 2] {
    let axis = face as usize / 2;
    [(axis + 1) % 3, (axis + 2) % 3]
}
