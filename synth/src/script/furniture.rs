//! Furniture, composed of simple shapes. All of it stands on the floor at its origin and looks
//! towards −y, unless it hangs on a wall.

use super::objects::{Builder, Finish, facing, size2, size3};
use super::positive_or;
use crate::room::shape::Ends;
use eagpt_scene::Result;
use eagpt_scene::script::{Node, Table};
use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::TAU;

/// What there is.
pub(super) const KINDS: [&str; 11] = [
    "table", "chair", "shelf", "sofa", "lamp", "pendant", "window", "picture", "plant", "books",
    "fruit",
];

/// Width of the gap between a thing and the wall it hangs on, metres: surfaces in one place fight.
const GAP_M: f32 = 0.004;

impl Builder<'_> {
    pub(super) fn furniture(&mut self, kind: &str, node: &Node<'_>) -> Result<()> {
        match kind {
            "table" => self.table(node),
            "chair" => self.chair(node),
            "shelf" => self.shelf(node),
            "sofa" => self.sofa(node),
            "lamp" => self.lamp(node),
            "pendant" => self.pendant(node),
            "window" => self.window(node),
            "picture" => self.picture(node),
            "plant" => self.plant(node),
            "fruit" => self.fruit(node),
            _ => self.books(node),
        }
    }

    /// A number from `low` to `high`.
    fn between(&mut self, low: f32, high: f32) -> f32 {
        let [u, ..] = self.random.next_uniforms();
        low + (high - low) * u
    }

    /// `top`, four `legs`, and a `cloth` that hangs over the edge.
    fn table(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["size", "top", "legs", "cloth"])?;
        let (size, top) = (size3(&table)?, self.need(&table, "top")?);
        let legs = self.or(&table, "legs", top)?;
        let (board, leg) = (0.035, 0.055);
        self.block(Vec3::Z * (size.z - 0.5 * board), size.with_z(board), top);
        self.legs(size - Vec3::new(0.04, 0.04, board), leg, legs);
        let apron = 0.08;
        let z = size.z - board - 0.5 * apron;
        for side in [-1.0, 1.0] {
            let y = side * (0.5 * size.y - 0.06);
            self.block(
                Vec3::new(0.0, y, z),
                Vec3::new(size.x - 0.15, 0.02, apron),
                legs,
            );
            let x = side * (0.5 * size.x - 0.06);
            self.block(
                Vec3::new(x, 0.0, z),
                Vec3::new(0.02, size.y - 0.15, apron),
                legs,
            );
        }
        if table.get("cloth").is_some() {
            let cloth = self.need(&table, "cloth")?;
            let (hem, thick) = (0.16, 0.006);
            let over = size + 2.0 * thick;
            self.block(Vec3::Z * (size.z + 0.5 * thick), over.with_z(thick), cloth);
            let z = size.z - 0.5 * hem;
            for side in [-1.0, 1.0] {
                let y = side * 0.5 * (size.y + thick);
                self.block(Vec3::new(0.0, y, z), Vec3::new(over.x, thick, hem), cloth);
                let x = side * 0.5 * (size.x + thick);
                self.block(Vec3::new(x, 0.0, z), Vec3::new(thick, size.y, hem), cloth);
            }
        }
        Ok(())
    }

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

    /// `frame` and `cushion`; a back of slats.
    fn chair(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["seat_height", "frame", "cushion"])?;
        let frame = self.need(&table, "frame")?;
        let cushion = self.or(&table, "cushion", frame)?;
        let height = positive_or(&table, "seat_height", 0.45)?;
        let (width, depth) = (0.42, 0.42);
        self.legs(Vec3::new(width, depth, height - 0.03), 0.04, frame);
        self.block(
            Vec3::Z * (height - 0.015),
            Vec3::new(width, depth, 0.03),
            frame,
        );
        let pad = Vec3::new(width - 0.04, depth - 0.04, 0.04);
        self.block(Vec3::Z * (height + 0.02), pad, cushion);
        let back = 0.5 * depth - 0.02;
        let rise = 0.46;
        for x in [-1.0, 1.0] {
            let post = Vec3::new(x * (0.5 * width - 0.02), back + 0.03, height + 0.5 * rise);
            self.leaning(post, Vec3::new(0.04, 0.03, rise), (-0.12, frame));
        }
        for level in [0.18, 0.3, 0.42] {
            let slat = Vec3::new(0.0, back + 0.01 + 0.12 * level, height + level);
            self.leaning(slat, Vec3::new(width - 0.06, 0.02, 0.07), (-0.12, frame));
        }
        Ok(())
    }

    /// A case of `boards` levels whose `books` are materials to choose from.
    fn shelf(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["size", "boards", "material", "back", "books"])?;
        let (size, wood) = (size3(&table)?, self.need(&table, "material")?);
        let back = self.or(&table, "back", wood)?;
        let num = match table.get("boards") {
            Some(node) => node.whole(1..=20)?,
            None => 4,
        };
        let books = self.list(&table, "books")?;
        let board = 0.025;
        for x in [-1.0, 1.0] {
            let side = Vec3::new(x * 0.5 * (size.x - board), 0.0, 0.5 * size.z);
            self.block(side, size.with_x(board), wood);
        }
        let behind = Vec3::new(0.0, 0.5 * size.y - 0.008, 0.5 * size.z);
        let inner = size.x - 2.0 * board;
        self.block(behind, Vec3::new(inner, 0.008, size.z - 2.0 * board), back);
        let step = (size.z - board) / num as f32;
        for level in 0..=num {
            let z = level as f32 * step;
            let middle = Vec3::new(0.0, 0.0, z + 0.5 * board);
            self.block(middle, Vec3::new(inner, size.y, board), wood);
            if level < num && !books.is_empty() {
                let room = Vec3::new(inner, size.y, step - board);
                self.row(z + board, room, &books);
            }
        }
        Ok(())
    }

    /// Upright books on a board at height `z`.
    fn row(&mut self, z: f32, room: Vec3, books: &[Finish]) {
        let mut x = -0.5 * room.x + 0.01;
        while x < 0.5 * room.x - 0.06 {
            // Now and then a gap, where something was taken out.
            if self.between(0.0, 1.0) < 0.07 {
                x += self.between(0.04, 0.18);
                continue;
            }
            let thick = self.between(0.018, 0.05);
            let tall = (room.z * self.between(0.62, 0.93)).min(0.34);
            let deep = room.y * self.between(0.6, 0.85);
            let finish = self.any(books);
            let y = -0.5 * room.y + 0.5 * deep + self.between(0.01, 0.04);
            let middle = Vec3::new(x + 0.5 * thick, y, z + 0.5 * tall);
            self.block(middle, Vec3::new(thick - 0.002, deep, tall), finish);
            x += thick;
        }
    }

    fn any(&mut self, finishes: &[Finish]) -> Finish {
        let [word, ..] = self.random.next_words();
        finishes[word as usize % finishes.len()]
    }

    /// `material` and loose `cushions`.
    fn sofa(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["size", "material", "cushions", "feet"])?;
        let (size, cover) = (size3(&table)?, self.need(&table, "material")?);
        let feet = self.or(&table, "feet", cover)?;
        let cushions = self.list(&table, "cushions")?;
        let (arm, lift, seat) = (0.16, 0.1, 0.42_f32.min(0.6 * size.z));
        self.legs(size.with_z(lift), 0.05, feet);
        let body = Vec3::new(size.x, size.y, seat - lift - 0.14);
        self.block(Vec3::Z * (lift + 0.5 * body.z), body, cover);
        let num = (size.x / 0.75).floor().max(1.0);
        let width = (size.x - 2.0 * arm) / num;
        let deep = size.y - 0.2;
        for i in 0..num as u32 {
            let x = -0.5 * size.x + arm + (i as f32 + 0.5) * width;
            let pad = Vec3::new(width - 0.012, deep, 0.14);
            self.block(Vec3::new(x, -0.1, seat - 0.07), pad, cover);
            let rest = Vec3::new(width - 0.015, 0.16, size.z - seat - 0.02);
            let place = Vec3::new(x, 0.5 * size.y - 0.24, seat + 0.5 * rest.z);
            self.leaning(place, rest, (-0.16, cover));
        }
        for side in [-1.0, 1.0] {
            let x = side * 0.5 * (size.x - arm);
            let height = seat + 0.18 - lift;
            let place = Vec3::new(x, 0.0, lift + 0.5 * height);
            self.block(place, Vec3::new(arm, size.y, height), cover);
        }
        let back = Vec3::new(size.x - 2.0 * arm, 0.14, size.z - lift);
        let place = Vec3::new(0.0, 0.5 * size.y - 0.07, lift + 0.5 * back.z);
        self.block(place, back, cover);
        for (i, &finish) in cushions.iter().enumerate() {
            let along = (i as f32 + 0.5) / cushions.len() as f32 - 0.5;
            let x = along * (size.x - 2.0 * arm - 0.3) * 1.1;
            let place = Vec3::new(x, 0.5 * size.y - 0.38, seat + 0.19);
            self.leaning(place, Vec3::new(0.38, 0.1, 0.36), (-0.35, finish));
        }
        Ok(())
    }

    /// A `pole` on a foot, and a `shade` that shines as `light`; of any `height`, to stand on the
    /// floor or on a table.
    fn lamp(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["height", "radius", "pole", "shade", "light"])?;
        let height = table.need("height")?.positive()?;
        let radius = positive_or(&table, "radius", 0.2)?;
        let (pole, shade) = (self.need(&table, "pole")?, self.shade(&table)?);
        let tall = 1.2 * radius;
        self.drum(Vec3::ZERO, 0.02, [0.7 * radius; 2], (Ends::Closed, pole));
        let stem = height - 0.5 * tall - 0.02;
        self.drum(Vec3::Z * 0.02, stem, [0.014; 2], (Ends::Closed, pole));
        let radii = [radius, 0.72 * radius];
        // Closed by diffusers: light out of a tube would be hard to find.
        self.drum(
            Vec3::Z * (height - tall),
            tall,
            radii,
            (Ends::Closed, shade),
        );
        Ok(())
    }

    /// A shade that hangs on a `cord` from the ceiling; its lower rim is at the origin.
    fn pendant(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["cord_length", "radius", "cord", "shade", "light"])?;
        let length = table.need("cord_length")?.positive()?;
        let radius = positive_or(&table, "radius", 0.2)?;
        let (cord, shade) = (self.need(&table, "cord")?, self.shade(&table)?);
        let tall = 0.75 * radius;
        self.drum(
            Vec3::ZERO,
            tall,
            [radius, 0.55 * radius],
            (Ends::Closed, shade),
        );
        self.drum(Vec3::Z * tall, length, [0.008; 2], (Ends::Closed, cord));
        Ok(())
    }

    fn shade(&self, table: &Table<'_>) -> Result<Finish> {
        Ok(Finish {
            light: self.light(table)?,
            ..self.need(table, "shade")?
        })
    }

    /// A `pane` that shines as `light`, in a `frame` with `bars`, between `curtains`, over a
    /// `sill`.
    fn window(&mut self, node: &Node<'_>) -> Result<()> {
        let keys = [
            "size", "facing", "frame", "pane", "light", "bars", "curtains",
        ];
        let table = node.table(&keys)?;
        let (size, frame) = (size2(&table)?, facing(&table)?);
        let wood = self.need(&table, "frame")?;
        let pane = Finish {
            light: self.light(&table)?,
            ..self.need(&table, "pane")?
        };
        let [columns, rows] = match table.get("bars") {
            Some(node) => {
                let [x, y] = node.fixed_array()?;
                [x.whole(1..=20)?, y.whole(1..=20)?]
            }
            None => [2, 2],
        };
        let bar = 0.05;
        self.panel(frame.z_axis * GAP_M, frame, size, pane);
        for i in 0..=columns {
            let x = (i as f32 / columns as f32 - 0.5) * (size.x + bar);
            let length = Vec3::new(bar, size.y + 2.0 * bar, 0.05);
            self.hung(frame, Vec3::new(x, 0.0, 0.03), length, wood);
        }
        for i in 0..=rows {
            let y = (i as f32 / rows as f32 - 0.5) * (size.y + bar);
            // Flush with the uprights they would fight with them.
            let length = Vec3::new(size.x + 2.0 * bar - 0.002, bar, 0.046);
            self.hung(frame, Vec3::new(0.0, y, 0.03), length, wood);
        }
        let sill = Vec3::new(size.x + 0.3, 0.03, 0.16);
        self.hung(
            frame,
            Vec3::new(0.0, -0.5 * size.y - 0.07, 0.085),
            sill,
            wood,
        );
        if table.get("curtains").is_some() {
            let cloth = self.need(&table, "curtains")?;
            self.curtains(frame, size, cloth);
            let rod = Vec3::new(size.x + 1.1, 0.025, 0.025);
            self.hung(frame, Vec3::new(0.0, 0.5 * size.y + 0.17, 0.13), rod, wood);
        }
        Ok(())
    }

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

    /// A `canvas` in a `frame`.
    fn picture(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["size", "facing", "frame", "canvas"])?;
        let (size, frame) = (size2(&table)?, facing(&table)?);
        let (wood, canvas) = (self.need(&table, "frame")?, self.need(&table, "canvas")?);
        let edge = 0.035;
        self.panel(frame.z_axis * 0.015, frame, size, canvas);
        for side in [-1.0, 1.0] {
            let x = side * 0.5 * (size.x + edge);
            let upright = Vec3::new(edge, size.y + 2.0 * edge, 0.03);
            self.hung(frame, Vec3::new(x, 0.0, 0.5 * 0.03 + GAP_M), upright, wood);
            let y = side * 0.5 * (size.y + edge);
            let level = Vec3::new(size.x, edge, 0.03);
            self.hung(frame, Vec3::new(0.0, y, 0.5 * 0.03 + GAP_M), level, wood);
        }
        Ok(())
    }

    /// A `pot` with `leaves` on arching stems, as high as `height`.
    fn plant(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["height", "pot", "soil", "leaves"])?;
        let height = table.need("height")?.positive()?;
        let pot = self.need(&table, "pot")?;
        let soil = self.or(&table, "soil", pot)?;
        let leaves = self.list(&table, "leaves")?;
        if leaves.is_empty() {
            return Err(table.node.error("`leaves` are missing"));
        }
        let (tall, wide) = (0.32 * height, 0.16 * height);
        self.drum(Vec3::ZERO, tall, [0.75 * wide, wide], (Ends::Closed, pot));
        let earth = (Ends::Closed, soil);
        self.drum(Vec3::Z * tall, 0.01, [0.9 * wide; 2], earth);
        let num_stems = 13;
        for stem in 0..num_stems {
            let angle = TAU * (stem as f32 * 0.618 + self.between(-0.03, 0.03));
            let steep = self.between(0.35, 1.0);
            let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let reach = 0.55 * height * (1.15 - steep);
            let rise = (height - tall) * (0.35 + 0.65 * steep);
            let num_leaves = 7;
            for leaf in 1..=num_leaves {
                let t = leaf as f32 / num_leaves as f32;
                // Stems rise and bend over.
                let at = out * (reach * t * (0.4 + 0.6 * t))
                    + Vec3::Z * (tall + rise * (1.0 - (1.0 - t).powi(2)) - 0.1 * reach * t * t);
                let finish = self.any(&leaves);
                self.leaf(at, out, 0.11 * height * (1.15 - 0.5 * t), finish);
            }
        }
        Ok(())
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

    /// A pile of `num` books.
    fn books(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["num", "covers"])?;
        let num = match table.get("num") {
            Some(node) => node.whole(1..=50)?,
            None => 4,
        };
        let covers = self.list(&table, "covers")?;
        if covers.is_empty() {
            return Err(table.node.error("`covers` are missing"));
        }
        let mut z = 0.0;
        for _ in 0..num {
            let thick = self.between(0.02, 0.045);
            let size = Vec3::new(self.between(0.19, 0.26), self.between(0.13, 0.18), thick);
            let place = Vec3::new(self.between(-0.02, 0.02), self.between(-0.02, 0.02), 0.0);
            let finish = self.any(&covers);
            self.block(place + Vec3::Z * (z + 0.5 * thick), size, finish);
            z += thick + 5e-4;
        }
        Ok(())
    }

    /// A `bowl` with `fruits`.
    fn fruit(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["bowl", "fruits"])?;
        let (bowl, fruits) = (self.need(&table, "bowl")?, self.list(&table, "fruits")?);
        let profile = [[0.06, 0.0], [0.055, 0.015], [0.13, 0.05], [0.15, 0.075]];
        self.turned(&profile.map(Vec2::from_array), bowl);
        for (i, &finish) in fruits.iter().enumerate() {
            let (ring, angle) = (f32::from(u8::from(i > 0)), TAU * i as f32 / 5.0);
            let reach = 0.085 * ring;
            let z = 0.075 + 0.035 - 0.008 * ring;
            let radius = self.between(0.034, 0.042);
            self.ball(
                Vec3::new(reach * angle.cos(), reach * angle.sin(), z),
                radius,
                finish,
            );
        }
        Ok(())
    }

    fn or(&self, table: &Table<'_>, key: &str, default: Finish) -> Result<Finish> {
        table
            .get(key)
            .map_or(Ok(default), |node| Ok(Finish::of(self.material(&node)?)))
    }

    /// Materials of a list; none if it is not there.
    fn list(&self, table: &Table<'_>, key: &str) -> Result<Vec<Finish>> {
        let Some(node) = table.get(key) else {
            return Ok(Vec::new());
        };
        let names = node.array()?;
        names
            .iter()
            .map(|node| Ok(Finish::of(self.material(node)?)))
            .collect()
    }
}
