//! The solver of [`Cache`].
//!
//! Cells are some centimetres wide. From each, rays go out once and remember the cell they meet;
//! light then travels along these transport matrix entries, bounce after bounce, in all conditions
//! (the progressive form of radiosity, gathered by Monte Carlo).
//!
//! Within a cell of a lamp light changes by more than a cell can say: behind a lamp that is flush
//! with the ceiling a cell is bright that shows the room its dark part alone. Where rays meet such
//! a cell, direct light is sampled at the very point.

use super::cache::{Cache, Grid};
use super::emitters::{Receiver, cosine_direction};
use super::path::Lighting;
use super::points::Points;
use crate::room::{LIFT, MAX_CONDITIONS, PerCondition, Room};
use eagpt_scene::rng::RandomKey;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Cells along a side of a face, at most.
const MAX_CELLS: f32 = 96.0;
/// A cell of which more rays than this share start inside of something counts as buried.
const MAX_BURIED: f32 = 0.75;
/// Bounces that light is followed over; albedos of 0.8 leave 1 % of the light after as many.
const NUM_SWEEPS: usize = 24;
/// Distance from a light within which a cell is not even, in its widths.
const NEAR: f32 = 1.5;

/// Settings of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CacheOptions {
    /// Width of a cell, metres.
    pub(crate) cell_m: f32,
    /// Rays that leave a cell.
    pub(crate) num_links: u32,
    /// Shadow rays from a cell in each condition.
    pub(crate) num_direct: u32,
}

impl Default for CacheOptions {
    fn default() -> Self {
        Self {
            cell_m: 0.1,
            num_links: 96,
            num_direct: 32,
        }
    }
}

/// Geometry and direct light of a cell.
struct Cell {
    albedo: Vec3,
    direct: PerCondition,
    /// Rays that start outside of things.
    num_rays: usize,
    /// Cells that they meet, …
    entries: Vec<u32>,
    /// … and those close to a light, with the direct light where they do.
    near: Vec<(u32, PerCondition)>,
}

impl Cache {
    /// Solves the light of a room.
    pub(crate) fn solve(lighting: &Lighting<'_>, key: RandomKey, options: &CacheOptions) -> Self {
        let room = lighting.room;
        let mut cache = Self {
            grids: Vec::new(),
            first_grid: Vec::new(),
            light: Vec::new(),
            is_near: Vec::new(),
        };
        let mut num_cells = 0;
        for (surface, it) in (0..).zip(room.surfaces()) {
            cache.first_grid.push(cache.grids.len() as u32);
            for face in 0..it.shape.num_faces() {
                let cells = it.shape.extent(face) / options.cell_m;
                let size = [cells.x, cells.y].map(|n| n.ceil().clamp(1.0, MAX_CELLS) as u32);
                let size = if it.shape.area(face) > 0.0 {
                    size
                } else {
                    [0; 2]
                };
                cache.grids.push(Grid {
                    surface,
                    face,
                    size,
                    first_cell: num_cells,
                });
                num_cells += size[0] * size[1];
            }
        }
        cache.is_near = cache.near_lights(room, options.cell_m);
        let grids = cache.grids.par_iter();
        let cells: Vec<Cell> = grids
            .flat_map_iter(|grid| (0..grid.num_cells()).map(move |cell| (grid, cell)))
            .map(|(grid, cell)| cache.look(lighting, grid, cell, (key, options)))
            .collect();
        for condition in 0..room.num_conditions() {
            cache.light.push(cache.travel(room, condition, &cells));
        }
        cache
    }

    /// Whether cells are close to a surface that emits in some condition.
    fn near_lights(&self, room: &Room, cell_m: f32) -> Vec<bool> {
        let emits = |surface: u32| {
            let mut faces = 0..room.surfaces()[surface as usize].shape.num_faces();
            faces.any(|face| room.emitted(surface, face).is_some())
        };
        let lights: Vec<[Vec3; 2]> = (0..room.surfaces().len() as u32)
            .filter(|surface| emits(*surface))
            .map(|surface| room.surfaces()[surface as usize].shape.bounds())
            .collect();
        let cells = self.grids.iter().flat_map(|grid| {
            (0..grid.num_cells()).map(move |cell| {
                let st = grid.st(cell, Vec2::splat(0.5));
                room.point(grid.surface, grid.face, st).position
            })
        });
        cells
            .map(|place| {
                let distance = |[low, high]: &[Vec3; 2]| place.distance(place.clamp(*low, *high));
                lights.iter().any(|bounds| distance(bounds) < NEAR * cell_m)
            })
            .collect()
    }

    /// Sends out the rays of a cell.
    fn look(
        &self,
        lighting: &Lighting<'_>,
        grid: &Grid,
        cell: u32,
        (key, options): (RandomKey, &CacheOptions),
    ) -> Cell {
        let room = lighting.room;
        let points = Points::new(key, grid.first_cell + cell);
        let start = |a: f32, b: f32| {
            let st = grid.st(cell, Vec2::new(a, b));
            let point = room.point(grid.surface, grid.face, st);
            let receiver = Receiver {
                position: point.position + point.normal * LIFT,
                normal: point.normal,
            };
            (st, receiver)
        };
        let conditions = 0..room.num_conditions();
        let (mut albedo, mut direct) = (Vec3::ZERO, [Vec3::ZERO; MAX_CONDITIONS]);
        let (mut entries, mut near, mut num_buried) = (Vec::new(), Vec::new(), 0);
        for sample in 0..options.num_links {
            let [a, b, c, d] = points.block(sample, 0);
            let (st, at) = start(a, b);
            albedo += room.reflectance(grid.surface, grid.face, st);
            let direction = cosine_direction(at.normal, Vec2::new(c, d));
            match room.meet(at.position, direction) {
                Some(hit) if hit.is_inside => num_buried += 1,
                Some(hit) => {
                    for condition in conditions.clone() {
                        let found = lighting.found_by_bounce(condition, &at, (direction, &hit));
                        if let Some((emitted, weight)) = found {
                            direct[condition] += emitted * (weight / options.num_links as f32);
                        }
                    }
                    match self.cell(&hit) {
                        Some(cell) if self.is_near[cell as usize] => {
                            let [a, b, c, _] = points.block(sample, 2);
                            let [d, e, ..] = points.block(sample, 3);
                            let at = Receiver::of(&hit);
                            near.push((cell, lighting.lit(&at, Vec3::new(a, b, c), [d, e])));
                        }
                        Some(cell) => entries.push(cell),
                        None => (),
                    }
                }
                None => (),
            }
        }
        let open = 1.0 - num_buried as f32 / options.num_links as f32;
        if open < 1.0 - MAX_BURIED {
            entries.clear();
            near.clear();
            direct = [Vec3::ZERO; MAX_CONDITIONS];
        } else {
            for condition in conditions {
                for sample in 0..options.num_direct {
                    let [a, b, c, d] = points.block(sample, 1);
                    // The place within the cell: a lattice that does not share numbers with the
                    // choice of light.
                    let turn = (sample as f32 + 0.5) / options.num_direct as f32;
                    let (_, at) = start(turn, d);
                    let light = lighting.direct(condition, &at, Vec3::new(a, b, c));
                    direct[condition] += light / options.num_direct as f32;
                }
                // Places inside of something are buried for shadow rays as well.
                direct[condition] /= open;
            }
        }
        Cell {
            albedo: albedo / options.num_links as f32,
            direct,
            num_rays: options.num_links as usize - num_buried,
            entries,
            near,
        }
    }

    /// Light of one condition after all bounces.
    fn travel(&self, room: &Room, condition: usize, cells: &[Cell]) -> Vec<Vec3> {
        // Emitters reflect nothing, and their light has been counted as direct.
        let mut albedos: Vec<Vec3> = cells.iter().map(|cell| cell.albedo).collect();
        for grid in &self.grids {
            if room.emitted_in(condition, grid.surface, grid.face) != Vec3::ZERO {
                let (first, num) = (grid.first_cell, grid.num_cells());
                albedos[first as usize..(first + num) as usize].fill(Vec3::ZERO);
            }
        }
        let mut light: Vec<Vec3> = cells.iter().map(|cell| cell.direct[condition]).collect();
        for _ in 0..NUM_SWEEPS {
            let reflected: Vec<Vec3> = light.iter().zip(&albedos).map(|(l, a)| *l * *a).collect();
            light = cells
                .par_iter()
                .map(|cell| {
                    let even = cell.entries.iter().map(|&entry| reflected[entry as usize]);
                    let near = cell.near.iter().map(|(entry, direct)| {
                        let met = *entry as usize;
                        let indirect = light[met] - cells[met].direct[condition];
                        (direct[condition] + indirect) * albedos[met]
                    });
                    let sum: Vec3 = even.chain(near).sum();
                    cell.direct[condition] + sum / cell.num_rays.max(1) as f32
                })
                .collect();
        }
        light
    }
}
