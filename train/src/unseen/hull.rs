//! The box around a scene, in cells, and how much of each cell surfaces see.

use crate::error::Result;
use crate::irradiance::smooth::Smoothing;
use eagpt_scene::Camera;
use eagpt_scene::rng::RandomKey;
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::sampling::cosine_direction;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::{Ray, Tracer};
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f32::consts::PI;

/// Directions from each receiver.
const NUM_DIRECTIONS: u32 = 64;
/// Opacity along a ray from which on it has met something.
const MET: f32 = 0.9;
/// Receivers beyond either end of an axis that are strays, and what the box is larger by on every
/// side, in parts of its longest edge: so that no surface is outside of it.
const STRAYS: f32 = 0.001;
const MARGIN: f32 = 0.02;
/// Cells along the edge of a cube of the volume of the box. With four to eight the same light is
/// found.
const CELLS_ALONG: f32 = 6.0;
/// Cells along any edge, at most.
const MAX_ALONG: u32 = 24;
/// Mean share of their cosine-weighted directions in which receivers see a cell, at least, for
/// anything to be known of it.
const LEAST_SEEN: f64 = 3e-4;
/// What is this near to a face, in parts of the box's length there, and faces as it does (cosine),
/// is part of it; share of receivers that tell its albedo, at least.
const NEAR_FACE: f32 = 0.1;
const FACING: f32 = 0.9;
const LEAST_OF_FACE: f32 = 0.005;
/// Albedo of a channel that cells have, at most.
const MAX_ALBEDO: f32 = 0.9;
/// Pixels of all views that look past a cell, at most, for it to be unseen.
const MAX_PASSED: usize = 8;
/// Rays that are traced together.
const RAYS_AT_ONCE: usize = 1 << 18;

/// Cells that a receiver sees, and the shares of its directions, ascending by cell.
pub(super) type Row = Vec<(usize, f64)>;

/// Two sides of each of three axes.
pub(super) const NUM_FACES: u32 = 6;
/// The face below, where no lamps are.
pub(super) const FLOOR: u32 = 4;

/// The box, whose third axis is upright, and its cells, which are counted face by face.
pub(super) struct Hull {
    /// World from the box's own axes.
    pub(super) rotation: Quat,
    pub(super) low: Vec3,
    pub(super) high: Vec3,
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
    /// The box around the receivers, `up` being the unit vector upwards; `None` if they are too few
    /// or have no extent.
    pub(super) fn around<'a>(
        receivers: impl ExactSizeIterator<Item = &'a Receiver> + Clone,
        up: Vec3,
    ) -> Option<Self> {
        let rotation = Quat::from_rotation_arc(Vec3::Z, up);
        let to_local = Mat3::from_quat(rotation).transpose();
        let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
        let strays = (STRAYS * receivers.len() as f32) as usize;
        for axis in 0..3 {
            let mut along: Vec<f32> = (receivers.clone())
                .map(|(_, surface)| (to_local * surface.position)[axis])
                .collect();
            along.sort_unstable_by(f32::total_cmp);
            low[axis] = *along.get(strays)?;
            high[axis] = along[along.len() - 1 - strays];
        }
        let margin = MARGIN * (high - low).max_element();
        (low, high) = (low - margin, high + margin);
        let size = (high - low).element_product().cbrt() / CELLS_ALONG;
        if !(size > 0.0) {
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

    /// Albedo that cells of each face are expected to have: that of the surface that is seen of it,
    /// or, if that is too little, of all. `radiances` are those of receivers, and `known` the light
    /// that they get, both `[receivers]`.
    pub(super) fn albedos(
        &self,
        receivers: &[Receiver],
        radiances: &[Vec3],
        known: &[Vec3],
    ) -> [Vec3; NUM_FACES as usize] {
        let all: Vec<usize> = (0..receivers.len()).collect();
        let albedo = |of: &[usize]| {
            let sum = |light: &[Vec3]| of.iter().map(|&i| light[i]).sum::<Vec3>();
            (sum(radiances) / sum(known)).min(Vec3::splat(MAX_ALBEDO))
        };
        let least = (LEAST_OF_FACE * receivers.len() as f32) as usize;
        std::array::from_fn(|face| {
            let axis = face / 2;
            let inwards = self.rotation_of(face as u32) * Vec3::Z;
            let side = if face % 2 == 0 { self.low } else { self.high };
            let end = self.rotation * Vec3::AXES[axis] * side[axis];
            let near = NEAR_FACE * (self.high - self.low)[axis];
            let is_of = |&&i: &&usize| {
                let (_, surface) = &receivers[i];
                let faces = surface.normal.dot(inwards) > FACING;
                faces && (surface.position - end).dot(inwards).abs() < near
            };
            let own: Vec<usize> = all.iter().filter(is_of).copied().collect();
            albedo(if own.len() > least { &own } else { &all })
        })
    }

    /// Lengths of a cell of a face.
    pub(super) fn lengths(&self, face: u32) -> [f32; 2] {
        axes(face).map(|axis| (self.high - self.low)[axis] / self.num[axis] as f32)
    }

    /// Middle of a cell, in world space.
    pub(super) fn middle(&self, cell: Cell) -> Vec3 {
        let axis = cell.face as usize / 2;
        let mut middle = if cell.face % 2 == 0 {
            self.low
        } else {
            self.high
        };
        let lengths = self.lengths(cell.face);
        let local = axes(cell.face).into_iter().zip(lengths).zip(cell.at);
        for ((along, length), at) in local {
            debug_assert_ne!(along, axis);
            middle[along] = self.low[along] + length * (at as f32 + 0.5);
        }
        self.rotation * middle
    }

    /// The cell at which a ray of the box's own space leaves it.
    pub(super) fn left_at(&self, origin: Vec3, direction: Vec3) -> Cell {
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

    /// For each receiver, the numbers of cells that it sees past all surfaces, with the shares of
    /// its cosine-weighted directions, ascending; `[receivers]`. Shares are means over neighbours:
    /// with the noise of single receivers, light would seem to depend less on them. What `cameras`
    /// look past is left out: photographs show it.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn seen_by(
        &self,
        tracer: &dyn Tracer,
        (receivers, smoothing): (&[Receiver], &Smoothing),
        cameras: &[Camera],
        key: RandomKey,
    ) -> Result<Vec<Row>> {
        let mut rows = self.traced(tracer, receivers, key)?;
        if rows.iter().all(Vec::is_empty) {
            return Ok(rows);
        }
        let passed = self.passed_by(tracer, cameras)?;
        for row in &mut rows {
            row.retain(|(cell, _)| passed[*cell] <= MAX_PASSED);
        }
        rows = (0..rows.len())
            .into_par_iter()
            .map(|i| {
                let near = smoothing.neighbours(i).iter().map(|(j, _)| *j as usize);
                mean(&rows, near.chain([i]))
            })
            .collect();
        self.leave_out_unknown(&mut rows);
        Ok(rows)
    }

    /// Number of pixels of `cameras` that show what is beyond each cell or nothing, `[cells]`.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn passed_by(&self, tracer: &dyn Tracer, cameras: &[Camera]) -> Result<Vec<usize>> {
        let to_local = Mat3::from_quat(self.rotation).transpose();
        let mut passed = vec![0; self.num_cells()];
        for camera in cameras {
            let frame = camera.ray_frame();
            let origin = to_local * frame.origin;
            for (pixel, met) in (0..).zip(&tracer.gbuffer(camera)?.pixels) {
                let (x, y) = (pixel % camera.width, pixel / camera.width);
                let direction = to_local * frame.direction(x as f32 + 0.5, y as f32 + 0.5);
                let place = origin + direction * met.mean_distance();
                let is_inside = place.cmpge(self.low).all() && place.cmple(self.high).all();
                if met.alpha() < MET || !is_inside {
                    passed[self.number(self.left_at(origin, direction))] += 1;
                }
            }
        }
        Ok(passed)
    }

    /// Those of single receivers.
    fn traced(
        &self,
        tracer: &dyn Tracer,
        receivers: &[Receiver],
        key: RandomKey,
    ) -> Result<Vec<Row>> {
        let to_local = Mat3::from_quat(self.rotation).transpose();
        let mut rows = Vec::with_capacity(receivers.len());
        for some in receivers.chunks(RAYS_AT_ONCE / NUM_DIRECTIONS as usize) {
            let rays: Vec<Ray> = (some.iter())
                .flat_map(|(i, surface)| {
                    let points = Points::new(key, *i);
                    (0..NUM_DIRECTIONS).map(move |sample| {
                        let [a, b, ..] = points.block(sample, 0);
                        surface.ray(cosine_direction(surface.normal, a, b))
                    })
                })
                .collect();
            let met = tracer.trace_rays(&rays)?;
            let num = NUM_DIRECTIONS as usize;
            for (rays, met) in rays.chunks(num).zip(met.chunks(num)) {
                let mut row = BTreeMap::new();
                for (ray, met) in rays.iter().zip(met).filter(|(_, met)| met.alpha() < MET) {
                    let [origin, direction] =
                        [ray.origin, ray.direction].map(|v| to_local * Vec3::from_array(v));
                    let number = self.number(self.left_at(origin, direction));
                    *row.entry(number).or_insert(0.0) += f64::from(1.0 - met.alpha()) / num as f64;
                }
                rows.push(row.into_iter().collect());
            }
        }
        Ok(rows)
    }

    /// Takes cells out of all rows of which too little is seen.
    fn leave_out_unknown(&self, rows: &mut [Row]) {
        let mut sums = vec![0.0; self.num_cells()];
        for (cell, share) in rows.iter().flatten() {
            sums[*cell] += share;
        }
        let least = LEAST_SEEN * rows.len() as f64;
        for row in rows {
            row.retain(|(cell, _)| sums[*cell] >= least);
        }
    }
}

/// The mean of some rows, at least one.
fn mean(rows: &[Row], of: impl Iterator<Item = usize> + Clone) -> Row {
    let num = of.clone().count() as f64;
    let mut sums = BTreeMap::new();
    for (cell, share) in of.flat_map(|i| &rows[i]) {
        *sums.entry(*cell).or_insert(0.0) += share / num;
    }
    sums.into_iter().collect()
}

/// The two axes of a face.
fn axes(face: u32) -> [usize; 2] {
    let axis = face as usize / 2;
    [(axis + 1) % 3, (axis + 2) % 3]
}
