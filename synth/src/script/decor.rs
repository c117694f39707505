//! Lamps, plants, and things on a wall.

use super::builder::{Builder, Finish, Name, Object, Size2, wall};
use crate::room::shape::Ends;
use eagpt_scene::Result;
use eagpt_scene::script::value::{Array, Direction, NonEmpty, Positive, Whole};
use glam::{Mat3, Vec2, Vec3};
use serde::Deserialize;
use std::f32::consts::TAU;

/// Width of the gap between an object and the wall it hangs on, metres: coincident surfaces would
/// hide each other at random.
const GAP_M: f32 = 0.004;

/// A `pole` on a foot, and a `shade` that emits `light`; of any `height`, to stand on the
/// floor or on a table.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Lamp {
    height: Positive,
    radius: Option<Positive>,
    pole: Name,
    shade: Name,
    light: Option<Name>,
}

impl Object for Lamp {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let height = f32::from(self.height);
        let radius = self.radius.map_or(0.2, f32::from);
        let pole = builder.finish(&self.pole)?;
        let shade = builder.lit(&self.shade, self.light.as_ref())?;
        let tall = 1.2 * radius;
        builder.drum(Vec3::ZERO, 0.02, [0.7 * radius; 2], (Ends::Closed, pole));
        let stem = height - 0.5 * tall - 0.02;
        builder.drum(Vec3::Z * 0.02, stem, [0.014; 2], (Ends::Closed, pole));
        let radii = [radius, 0.72 * radius];
        // Closed by diffusers: light out of a tube would be hard to find.
        builder.drum(
            Vec3::Z * (height - tall),
            tall,
            radii,
            (Ends::Closed, shade),
        );
        Ok(())
    }
}

/// A shade that hangs on a `cord` from the ceiling; its lower rim is at the origin.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Pendant {
    cord_length: Positive,
    radius: Option<Positive>,
    cord: Name,
    shade: Name,
    light: Option<Name>,
}

impl Object for Pendant {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let length = f32::from(self.cord_length);
        let radius = self.radius.map_or(0.2, f32::from);
        let cord = builder.finish(&self.cord)?;
        let shade = builder.lit(&self.shade, self.light.as_ref())?;
        let tall = 0.75 * radius;
        builder.drum(
            Vec3::ZERO,
            tall,
            [radius, 0.55 * radius],
            (Ends::Closed, shade),
        );
        builder.drum(Vec3::Z * tall, length, [0.008; 2], (Ends::Closed, cord));
        Ok(())
    }
}

/// A `pane` that emits `light`, in a `frame` with `bars`, between `curtains`, over a
/// `sill`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Window {
    size: Size2,
    facing: Option<Direction>,
    frame: Name,
    pane: Name,
    light: Option<Name>,
    bars: Option<Array<Whole<1, 20>, 2>>,
    curtains: Option<Name>,
}

impl Object for Window {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let (size, frame) = (Vec2::from(self.size), wall(self.facing));
        let wood = builder.finish(&self.frame)?;
        let pane = builder.lit(&self.pane, self.light.as_ref())?;
        let [columns, rows] = self.bars.map_or([2, 2], <[u32; 2]>::from);
        let bar = 0.05;
        builder.panel(frame.z_axis * GAP_M, frame, size, pane);
        for i in 0..=columns {
            let x = (i as f32 / columns as f32 - 0.5) * (size.x + bar);
            let length = Vec3::new(bar, size.y + 2.0 * bar, 0.05);
            builder.hung(frame, Vec3::new(x, 0.0, 0.03), length, wood);
        }
        for i in 0..=rows {
            let y = (i as f32 / rows as f32 - 0.5) * (size.y + bar);
            // Flush with the uprights they would fight with them.
            let length = Vec3::new(size.x + 2.0 * bar - 0.002, bar, 0.046);
            builder.hung(frame, Vec3::new(0.0, y, 0.03), length, wood);
        }
        let sill = Vec3::new(size.x + 0.3, 0.03, 0.16);
        builder.hung(
            frame,
            Vec3::new(0.0, -0.5 * size.y - 0.07, 0.085),
            sill,
            wood,
        );
        if let Some(curtains) = &self.curtains {
            let cloth = builder.finish(curtains)?;
            builder.curtains(frame, size, cloth);
            let rod = Vec3::new(size.x + 1.1, 0.025, 0.025);
            builder.hung(frame, Vec3::new(0.0, 0.5 * size.y + 0.17, 0.13), rod, wood);
        }
        Ok(())
    }
}

/// A `canvas` in a `frame`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Picture {
    size: Size2,
    facing: Option<Direction>,
    frame: Name,
    canvas: Name,
}

impl Object for Picture {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let (size, frame) = (Vec2::from(self.size), wall(self.facing));
        let wood = builder.finish(&self.frame)?;
        let canvas = builder.finish(&self.canvas)?;
        let edge = 0.035;
        builder.panel(frame.z_axis * 0.015, frame, size, canvas);
        for side in [-1.0, 1.0] {
            let x = side * 0.5 * (size.x + edge);
            let upright = Vec3::new(edge, size.y + 2.0 * edge, 0.03);
            builder.hung(frame, Vec3::new(x, 0.0, 0.5 * 0.03 + GAP_M), upright, wood);
            let y = side * 0.5 * (size.y + edge);
            let level = Vec3::new(size.x, edge, 0.03);
            builder.hung(frame, Vec3::new(0.0, y, 0.5 * 0.03 + GAP_M), level, wood);
        }
        Ok(())
    }
}

/// A `pot` with `leaves` on arching stems, as high as `height`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Plant {
    height: Positive,
    pot: Name,
    soil: Option<Name>,
    leaves: NonEmpty<Name>,
}

impl Object for Plant {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let height = f32::from(self.height);
        let pot = builder.finish(&self.pot)?;
        let soil = builder.or(self.soil.as_ref(), pot)?;
        let leaves = builder.finishes(&self.leaves.0)?;
        let (tall, wide) = (0.32 * height, 0.16 * height);
        builder.drum(Vec3::ZERO, tall, [0.75 * wide, wide], (Ends::Closed, pot));
        let earth = (Ends::Closed, soil);
        builder.drum(Vec3::Z * tall, 0.01, [0.9 * wide; 2], earth);
        let num_stems = 13;
        for stem in 0..num_stems {
            let angle = TAU * (stem as f32 * 0.618 + builder.between(-0.03, 0.03));
            let steep = builder.between(0.35, 1.0);
            let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let reach = 0.55 * height * (1.15 - steep);
            let rise = (height - tall) * (0.35 + 0.65 * steep);
            let num_leaves = 7;
            for leaf in 1..=num_leaves {
                let t = leaf as f32 / num_leaves as f32;
                // Stems rise and bend over.
                let at = out * (reach * t * (0.4 + 0.6 * t))
                    + Vec3::Z * (tall + rise * (1.0 - (1.0 - t).powi(2)) - 0.1 * reach * t * t);
                let finish = builder.any(&leaves);
                builder.leaf(at, out, 0.11 * height * (1.15 - 0.5 * t), finish);
            }
        }
        Ok(())
    }
}

impl Builder<'_> {
    /// Pleats at both sides.
    fn curtains(&mut self, frame: Mat3, size: Vec2, cloth: Finish) {
        let (num, width) = (7, 0.05);
        let length = size.y + 0.45;
        for side in [-1.0, 1.0] {
            for pleat in 0..num {
                let x = side * (0.5 * size.x + 0.12 + width * pleat as f32);
                let out = 0.1 + 0.04 * (pleat % 2) as f32;
                let place = Vec3::new(x, 0.15 - 0.5 * 0.45 + 0.05, out);
                self.hung(frame, place, Vec3::new(width + 0.004, length, 0.035), cloth);
            }
        }
    }

    /// A box in the frame of a wall: right, up, out.
    fn hung(&mut self, frame: Mat3, centre: Vec3, size: Vec3, finish: Finish) {
        // Walls have axes along those of the room: the box stays one of the builder's frame.
        let world = (frame * size).abs();
        self.block(frame * centre, world, finish);
    }

    /// A lozenge that points outwards and hangs a little.
    fn leaf(&mut self, at: Vec3, out: Vec3, length: f32, finish: Finish) {
        let lean = self.between(-0.9, 0.4);
        let roll = self.between(-0.7, 0.7);
        let along = (out + Vec3::Z * lean).normalize() * length;
        let across = Vec3::new(-out.y, out.x, roll).normalize() * (0.42 * length);
        // A rhombus about its middle: its edges are half the sum and half the difference of the
        // diagonals.
        let edges = [0.5 * (along + across), 0.5 * (along - across)];
        self.quad(at - 0.5 * along, edges, finish);
    }
}
