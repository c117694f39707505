//! Furniture, composed of simple shapes: it stands on the floor with its front towards −y.

use super::builder::{Builder, Finish, Name, Object, Size3};
use eagpt_scene::Result;
use eagpt_scene::script::value::{NonEmpty, Positive, Whole};
use glam::{Vec2, Vec3};
use serde::Deserialize;
use std::f32::consts::TAU;

/// `top`, four `legs`, and a `cloth` that hangs over the edge.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    size: Size3,
    top: Name,
    legs: Option<Name>,
    cloth: Option<Name>,
}

impl Object for Table {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let (size, top) = (Vec3::from(self.size), builder.finish(&self.top)?);
        let legs = builder.or(self.legs.as_ref(), top)?;
        let (board, leg) = (0.035, 0.055);
        builder.block(Vec3::Z * (size.z - 0.5 * board), size.with_z(board), top);
        builder.legs(size - Vec3::new(0.04, 0.04, board), leg, legs);
        let apron = 0.08;
        let z = size.z - board - 0.5 * apron;
        for side in [-1.0, 1.0] {
            let y = side * (0.5 * size.y - 0.06);
            builder.block(
                Vec3::new(0.0, y, z),
                Vec3::new(size.x - 0.15, 0.02, apron),
                legs,
            );
            let x = side * (0.5 * size.x - 0.06);
            builder.block(
                Vec3::new(x, 0.0, z),
                Vec3::new(0.02, size.y - 0.15, apron),
                legs,
            );
        }
        if let Some(cloth) = &self.cloth {
            let cloth = builder.finish(cloth)?;
            let (hem, thick) = (0.16, 0.006);
            let over = size + 2.0 * thick;
            builder.block(Vec3::Z * (size.z + 0.5 * thick), over.with_z(thick), cloth);
            let z = size.z - 0.5 * hem;
            for side in [-1.0, 1.0] {
                let y = side * 0.5 * (size.y + thick);
                builder.block(Vec3::new(0.0, y, z), Vec3::new(over.x, thick, hem), cloth);
                let x = side * 0.5 * (size.x + thick);
                builder.block(Vec3::new(x, 0.0, z), Vec3::new(thick, size.y, hem), cloth);
            }
        }
        Ok(())
    }
}

/// `frame` and `cushion`; a back of slats.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Chair {
    seat_height: Option<Positive>,
    frame: Name,
    cushion: Option<Name>,
}

impl Object for Chair {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let frame = builder.finish(&self.frame)?;
        let cushion = builder.or(self.cushion.as_ref(), frame)?;
        let height = self.seat_height.map_or(0.45, f32::from);
        let (width, depth) = (0.42, 0.42);
        builder.legs(Vec3::new(width, depth, height - 0.03), 0.04, frame);
        builder.block(
            Vec3::Z * (height - 0.015),
            Vec3::new(width, depth, 0.03),
            frame,
        );
        let pad = Vec3::new(width - 0.04, depth - 0.04, 0.04);
        builder.block(Vec3::Z * (height + 0.02), pad, cushion);
        let back = 0.5 * depth - 0.02;
        let rise = 0.46;
        for x in [-1.0, 1.0] {
            let post = Vec3::new(x * (0.5 * width - 0.02), back + 0.03, height + 0.5 * rise);
            builder.leaning(post, Vec3::new(0.04, 0.03, rise), (-0.12, frame));
        }
        for level in [0.18, 0.3, 0.42] {
            let slat = Vec3::new(0.0, back + 0.01 + 0.12 * level, height + level);
            builder.leaning(slat, Vec3::new(width - 0.06, 0.02, 0.07), (-0.12, frame));
        }
        Ok(())
    }
}

/// A case of `boards` levels whose `books` are materials to choose from.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Shelf {
    size: Size3,
    boards: Option<Whole<1, 20>>,
    material: Name,
    back: Option<Name>,
    #[serde(default)]
    books: Vec<Name>,
}

impl Object for Shelf {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let (size, wood) = (Vec3::from(self.size), builder.finish(&self.material)?);
        let back = builder.or(self.back.as_ref(), wood)?;
        let num = self.boards.map_or(4, u32::from);
        let books = builder.finishes(&self.books)?;
        let board = 0.025;
        for x in [-1.0, 1.0] {
            let side = Vec3::new(x * 0.5 * (size.x - board), 0.0, 0.5 * size.z);
            builder.block(side, size.with_x(board), wood);
        }
        let behind = Vec3::new(0.0, 0.5 * size.y - 0.008, 0.5 * size.z);
        let inner = size.x - 2.0 * board;
        builder.block(behind, Vec3::new(inner, 0.008, size.z - 2.0 * board), back);
        let step = (size.z - board) / num as f32;
        for level in 0..=num {
            let z = level as f32 * step;
            let middle = Vec3::new(0.0, 0.0, z + 0.5 * board);
            builder.block(middle, Vec3::new(inner, size.y, board), wood);
            if level < num && !books.is_empty() {
                let space = Vec3::new(inner, size.y, step - board);
                builder.row(z + board, space, &books);
            }
        }
        Ok(())
    }
}

/// `material` and loose `cushions`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sofa {
    size: Size3,
    material: Name,
    #[serde(default)]
    cushions: Vec<Name>,
    feet: Option<Name>,
}

impl Object for Sofa {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let (size, cover) = (Vec3::from(self.size), builder.finish(&self.material)?);
        let feet = builder.or(self.feet.as_ref(), cover)?;
        let cushions = builder.finishes(&self.cushions)?;
        let (arm, lift, seat) = (0.16, 0.1, 0.42_f32.min(0.6 * size.z));
        builder.legs(size.with_z(lift), 0.05, feet);
        let body = Vec3::new(size.x, size.y, seat - lift - 0.14);
        builder.block(Vec3::Z * (lift + 0.5 * body.z), body, cover);
        let num = (size.x / 0.75).floor().max(1.0);
        let width = (size.x - 2.0 * arm) / num;
        let deep = size.y - 0.2;
        for i in 0..num as u32 {
            let x = -0.5 * size.x + arm + (i as f32 + 0.5) * width;
            let pad = Vec3::new(width - 0.012, deep, 0.14);
            builder.block(Vec3::new(x, -0.1, seat - 0.07), pad, cover);
            let rest = Vec3::new(width - 0.015, 0.16, size.z - seat - 0.02);
            let place = Vec3::new(x, 0.5 * size.y - 0.24, seat + 0.5 * rest.z);
            builder.leaning(place, rest, (-0.16, cover));
        }
        for side in [-1.0, 1.0] {
            let x = side * 0.5 * (size.x - arm);
            let height = seat + 0.18 - lift;
            let place = Vec3::new(x, 0.0, lift + 0.5 * height);
            builder.block(place, Vec3::new(arm, size.y, height), cover);
        }
        let back = Vec3::new(size.x - 2.0 * arm, 0.14, size.z - lift);
        let place = Vec3::new(0.0, 0.5 * size.y - 0.07, lift + 0.5 * back.z);
        builder.block(place, back, cover);
        for (i, &finish) in cushions.iter().enumerate() {
            let along = (i as f32 + 0.5) / cushions.len() as f32 - 0.5;
            let x = along * (size.x - 2.0 * arm - 0.3) * 1.1;
            let place = Vec3::new(x, 0.5 * size.y - 0.38, seat + 0.19);
            builder.leaning(place, Vec3::new(0.38, 0.1, 0.36), (-0.35, finish));
        }
        Ok(())
    }
}

/// A pile of `num` books.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Books {
    num: Option<Whole<1, 50>>,
    covers: NonEmpty<Name>,
}

impl Object for Books {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let num = self.num.map_or(4, u32::from);
        let covers = builder.finishes(&self.covers.0)?;
        let mut z = 0.0;
        for _ in 0..num {
            let thick = builder.between(0.02, 0.045);
            let size = Vec3::new(
                builder.between(0.19, 0.26),
                builder.between(0.13, 0.18),
                thick,
            );
            let place = Vec3::new(
                builder.between(-0.02, 0.02),
                builder.between(-0.02, 0.02),
                0.0,
            );
            let finish = builder.any(&covers);
            builder.block(place + Vec3::Z * (z + 0.5 * thick), size, finish);
            z += thick + 5e-4;
        }
        Ok(())
    }
}

/// A `bowl` with `fruits`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Fruit {
    bowl: Name,
    #[serde(default)]
    fruits: Vec<Name>,
}

impl Object for Fruit {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let (bowl, fruits) = (builder.finish(&self.bowl)?, builder.finishes(&self.fruits)?);
        let profile = [[0.06, 0.0], [0.055, 0.015], [0.13, 0.05], [0.15, 0.075]];
        builder.turned(&profile.map(Vec2::from_array), bowl);
        for (i, &finish) in fruits.iter().enumerate() {
            let (ring, angle) = (f32::from(u8::from(i > 0)), TAU * i as f32 / 5.0);
            let reach = 0.085 * ring;
            let z = 0.075 + 0.035 - 0.008 * ring;
            let radius = builder.between(0.034, 0.042);
            builder.ball(
                Vec3::new(reach * angle.cos(), reach * angle.sin(), z),
                radius,
                finish,
            );
        }
        Ok(())
    }
}

impl Builder<'_> {
    /// Four legs within a footprint, up to a height.
    fn legs(&mut self, size: Vec3, width: f32, finish: Finish) {
        let reach = 0.5 * (size.truncate() - width);
        for x in [-reach.x, reach.x] {
            for y in [-reach.y, reach.y] {
                let leg = Vec3::new(width, width, size.z);
                self.block(Vec3::new(x, y, 0.5 * size.z), leg, finish);
            }
        }
    }

    /// Upright books on a board at height `z`.
    fn row(&mut self, z: f32, space: Vec3, books: &[Finish]) {
        let mut x = -0.5 * space.x + 0.01;
        while x < 0.5 * space.x - 0.06 {
            // Now and then a gap, where something was taken out.
            if self.between(0.0, 1.0) < 0.07 {
                x += self.between(0.04, 0.18);
                continue;
            }
            let thick = self.between(0.018, 0.05);
            let tall = (space.z * self.between(0.62, 0.93)).min(0.34);
            let deep = space.y * self.between(0.6, 0.85);
            let finish = self.any(books);
            let y = -0.5 * space.y + 0.5 * deep + self.between(0.01, 0.04);
            let middle = Vec3::new(x + 0.5 * thick, y, z + 0.5 * tall);
            self.block(middle, Vec3::new(thick - 0.002, deep, tall), finish);
            x += thick;
        }
    }
}
