//! `[[object]]`: what stands in the room.

use super::{Names, unknown};
use crate::room::Surface;
use crate::room::shape::{Ball, Block, Drum, Ends, Quad, Shape};
use eagpt_scene::Result;
use eagpt_scene::rng::{Purpose, RandomKey, RandomStream};
use eagpt_scene::script::{Node, Table};
use glam::{Mat3, Vec2, Vec3};

/// Surfaces of a room, at most: more would be a mistake in a file that people write.
const MAX_SURFACES: usize = 50_000;

/// What objects may refer to.
pub(super) struct Vocabulary {
    pub(super) materials: Names,
    pub(super) lights: Names,
}

/// What a surface looks like.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finish {
    pub(super) material: u32,
    pub(super) light: Option<u32>,
}

impl Finish {
    pub(super) fn of(material: u32) -> Self {
        Self {
            material,
            light: None,
        }
    }
}

/// An object under construction: shapes in its own frame (z up, its foot at the origin, its front
/// towards −y), which go into the room turned and moved.
pub(super) struct Builder<'a> {
    pub(super) words: &'a Vocabulary,
    at: Vec3,
    turn: Mat3,
    pub(super) random: RandomStream,
    surfaces: &'a mut Vec<Surface>,
}

pub(super) fn surfaces(node: &Node<'_>, words: &Vocabulary) -> Result<Vec<Surface>> {
    let key = RandomKey::new(0, Purpose::Furnish, 0);
    let mut surfaces = Vec::new();
    for (index, node) in node.array()?.iter().enumerate() {
        let table =
            node.table(&[&KINDS[..], &super::furniture::KINDS, &["at", "turn"]].concat())?;
        let (kind, value) = table.one_of(&[&KINDS[..], &super::furniture::KINDS].concat())?;
        let at = match table.get("at") {
            Some(node) => node.vec3()?,
            None => Vec3::ZERO,
        };
        let turn = match table.get("turn") {
            Some(node) => node.number()?.to_radians(),
            None => 0.0,
        };
        let mut builder = Builder {
            words,
            at,
            turn: Mat3::from_rotation_z(turn),
            random: key.stream(index as u32, 0),
            surfaces: &mut surfaces,
        };
        if KINDS.contains(&kind) {
            builder.simple(kind, &value)?;
        } else {
            builder.furniture(kind, &value)?;
        }
        if surfaces.len() > MAX_SURFACES {
            return Err(node.error(format!(
                "the room has more than {MAX_SURFACES} surfaces by now"
            )));
        }
    }
    if surfaces.is_empty() {
        return Err(node.error("there are no objects"));
    }
    Ok(surfaces)
}

/// Objects of one or a few shapes.
const KINDS: [&str; 6] = ["room", "box", "panel", "ball", "can", "lathe"];

impl Builder<'_> {
    fn simple(&mut self, kind: &str, node: &Node<'_>) -> Result<()> {
        match kind {
            "room" => self.room(node),
            "box" => {
                let table = node.table(&["size", "material", "light"])?;
                let (size, finish) = (size3(&table)?, self.finish(&table)?);
                self.block(Vec3::Z * (0.5 * size.z), size, finish);
                Ok(())
            }
            "panel" => {
                let table = node.table(&["size", "facing", "material", "light"])?;
                let frame = facing(&table)?;
                let (size, finish) = (size2(&table)?, self.finish(&table)?);
                self.panel(Vec3::ZERO, frame, size, finish);
                Ok(())
            }
            "ball" => {
                let table = node.table(&["radius", "material", "light"])?;
                let (radius, finish) = (table.need("radius")?.positive()?, self.finish(&table)?);
                self.ball(Vec3::ZERO, radius, finish);
                Ok(())
            }
            "can" => {
                let table =
                    node.table(&["radius", "top", "height", "open", "material", "light"])?;
                let radius = table.need("radius")?.positive()?;
                let top = super::positive_or(&table, "top", radius)?;
                let height = table.need("height")?.positive()?;
                let ends = match table.get("open") {
                    Some(flag) if flag.flag()? => Ends::Open,
                    _ => Ends::Closed,
                };
                let finish = self.finish(&table)?;
                self.drum(Vec3::ZERO, height, [radius, top], (ends, finish));
                Ok(())
            }
            _ => self.lathe(node),
        }
    }

    /// Floor, ceiling and four walls around the origin, seen from inside.
    fn room(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&[
            "size", "floor", "ceiling", "walls", "north", "south", "east", "west",
        ])?;
        let size = size3(&table)?;
        let (half, up) = (0.5 * size, size.z);
        let wall = |builder: &Self, key: &str| match table.get(key) {
            Some(node) => builder.material(&node),
            None => builder.material(&table.need("walls")?),
        };
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x * half.x, y * half.y, z * up);
        let (x, y, z) = (Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * up);
        for (key, corner, edges) in [
            ("floor", corner(-1.0, -1.0, 0.0), [x, y]),
            ("ceiling", corner(-1.0, 1.0, 1.0), [x, -y]),
            ("north", corner(-1.0, 1.0, 0.0), [x, z]),
            ("south", corner(1.0, -1.0, 0.0), [-x, z]),
            ("east", corner(1.0, 1.0, 0.0), [-y, z]),
            ("west", corner(-1.0, -1.0, 0.0), [y, z]),
        ] {
            let material = match key {
                "floor" | "ceiling" => self.material(&table.need(key)?)?,
                _ => wall(self, key)?,
            };
            self.quad(corner, edges, Finish::of(material));
        }
        Ok(())
    }

    /// A body of rotation: radius and height from the bottom up.
    fn lathe(&mut self, node: &Node<'_>) -> Result<()> {
        let table = node.table(&["profile", "material", "light"])?;
        let profile_node = table.need("profile")?;
        let mut profile = Vec::new();
        for node in profile_node.array()? {
            let [radius, height] = node.fixed_array()?;
            let point = Vec2::new(radius.positive()?, height.number()?);
            if profile.last().is_some_and(|last: &Vec2| point.y <= last.y) {
                return Err(height.error(format!("{} is not above the point before", point.y)));
            }
            profile.push(point);
        }
        if profile.len() < 2 {
            return Err(profile_node.error("a profile has two points or more"));
        }
        let finish = self.finish(&table)?;
        self.turned(&profile, finish);
        Ok(())
    }

    /// A name of a material.
    pub(super) fn material(&self, node: &Node<'_>) -> Result<u32> {
        let name = node.string()?;
        let materials = &self.words.materials;
        let found = materials.get(name).copied();
        found.ok_or_else(|| unknown(node, name, materials, "material"))
    }

    /// Material of a key that has to be there.
    pub(super) fn need(&self, table: &Table<'_>, key: &str) -> Result<Finish> {
        Ok(Finish::of(self.material(&table.need(key)?)?))
    }

    /// `material` and `light` of a table.
    fn finish(&self, table: &Table<'_>) -> Result<Finish> {
        let finish = self.need(table, "material")?;
        Ok(Finish {
            light: self.light(table)?,
            ..finish
        })
    }

    /// `light` of a table.
    pub(super) fn light(&self, table: &Table<'_>) -> Result<Option<u32>> {
        let Some(node) = table.get("light") else {
            return Ok(None);
        };
        let name = node.string()?;
        let lights = &self.words.lights;
        let found = lights.get(name).copied();
        found
            .map(Some)
            .ok_or_else(|| unknown(&node, name, lights, "light"))
    }

    /// A box by its middle and whole edges.
    pub(super) fn block(&mut self, centre: Vec3, size: Vec3, finish: Finish) {
        let shape = Shape::Block(Block {
            centre: self.at + self.turn * centre,
            half: 0.5 * size,
            axes: self.turn,
        });
        self.push(shape, finish);
    }

    /// A box by its middle and whole edges, leaning back about its x axis.
    pub(super) fn leaning(&mut self, centre: Vec3, size: Vec3, (angle_rad, finish): (f32, Finish)) {
        let shape = Shape::Block(Block {
            centre: self.at + self.turn * centre,
            half: 0.5 * size,
            axes: self.turn * Mat3::from_rotation_x(angle_rad),
        });
        self.push(shape, finish);
    }

    pub(super) fn ball(&mut self, centre: Vec3, radius: f32, finish: Finish) {
        let centre = self.at + self.turn * centre;
        self.push(Shape::Ball(Ball { centre, radius }), finish);
    }

    /// An upright drum by the middle of its base.
    pub(super) fn drum(
        &mut self,
        base: Vec3,
        height: f32,
        radii: [f32; 2],
        (ends, finish): (Ends, Finish),
    ) {
        let shape = Shape::Drum(Drum {
            base: self.at + self.turn * base,
            axes: self.turn,
            height,
            radii,
            ends,
        });
        self.push(shape, finish);
    }

    /// A body of rotation about the z axis, closed below and, where it is narrow enough to be a
    /// lid, above.
    pub(super) fn turned(&mut self, profile: &[Vec2], finish: Finish) {
        for pair in profile.windows(2) {
            let base = Vec3::Z * pair[0].y;
            let part = (Ends::Closed, finish);
            self.drum(base, pair[1].y - pair[0].y, [pair[0].x, pair[1].x], part);
        }
    }

    pub(super) fn quad(&mut self, corner: Vec3, edges: [Vec3; 2], finish: Finish) {
        let edges = edges.map(|edge| self.turn * edge);
        let corner = self.at + self.turn * corner;
        self.push(Shape::Quad(Quad::new(corner, edges)), finish);
    }

    /// A rectangle by its middle, facing along `frame.z_axis`.
    pub(super) fn panel(&mut self, centre: Vec3, frame: Mat3, size: Vec2, finish: Finish) {
        let edges = [frame.x_axis * size.x, frame.y_axis * size.y];
        self.quad(centre - 0.5 * (edges[0] + edges[1]), edges, finish);
    }

    fn push(&mut self, shape: Shape, Finish { material, light }: Finish) {
        self.surfaces.push(Surface {
            shape,
            material,
            light,
        });
    }
}

/// Right, up and out of what hangs on a wall: `facing` says where it looks.
pub(super) fn facing(table: &Table<'_>) -> Result<Mat3> {
    let out = match table.get("facing") {
        Some(node) => node.direction()?,
        None => Vec3::NEG_Y,
    };
    let up = if out.z.abs() > 0.9 { Vec3::Y } else { Vec3::Z };
    let right = up.cross(out).normalize();
    Ok(Mat3::from_cols(right, out.cross(right), out))
}

/// Three lengths.
pub(super) fn size3(table: &Table<'_>) -> Result<Vec3> {
    let [x, y, z] = table.need("size")?.fixed_array()?;
    Ok(Vec3::new(x.positive()?, y.positive()?, z.positive()?))
}

/// Two lengths.
pub(super) fn size2(table: &Table<'_>) -> Result<Vec2> {
    let [x, y] = table.need("size")?.fixed_array()?;
    Ok(Vec2::new(x.positive()?, y.positive()?))
}
