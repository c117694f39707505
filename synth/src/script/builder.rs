//! Objects under construction: the names they refer to, and their shapes.

use super::unknown;
use crate::room::Surface;
use crate::room::shape::{Ball, Block, Drum, Ends, Quad, Shape};
use eagpt_scene::Result;
use eagpt_scene::rng::RandomStream;
use eagpt_scene::script::value::{Array, Direction, Positive};
use eagpt_scene::script::{ScriptFile, Spanned};
use glam::{Mat3, Vec2, Vec3};

/// The name of a material or a light.
pub(super) type Name = Spanned<String>;
/// Two lengths.
pub(super) type Size2 = Array<Positive, 2>;
/// Three lengths.
pub(super) type Size3 = Array<Positive, 3>;

/// The keys of an object, which build its surfaces.
pub(super) trait Object {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()>;
}

/// Names that objects may refer to, in the order of their indices.
pub(super) struct Vocabulary<'a> {
    pub(super) file: &'a ScriptFile,
    pub(super) materials: Vec<&'a str>,
    pub(super) lights: Vec<&'a str>,
}

impl Vocabulary<'_> {
    /// The index of a name.
    ///
    /// # Errors
    /// If it is not among `names`.
    pub(super) fn index(&self, noun: &str, names: &[&str], name: &Name) -> Result<u32> {
        let found = names.iter().position(|other| other == name.get_ref());
        found.map(|index| index as u32).ok_or_else(|| {
            let names = names.iter().copied();
            unknown(self.file, name.span(), (noun, name.get_ref()), names)
        })
    }
}

/// Material and light of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finish {
    material: u32,
    light: Option<u32>,
}

/// An object under construction: shapes in its own frame (z up, its foot at the origin, its front
/// towards −y), which go into the room turned and moved.
pub(super) struct Builder<'a> {
    pub(super) words: &'a Vocabulary<'a>,
    pub(super) at: Vec3,
    pub(super) turn: Mat3,
    pub(super) random: RandomStream,
    pub(super) surfaces: &'a mut Vec<Surface>,
}

impl Builder<'_> {
    /// The finish of a material.
    pub(super) fn finish(&self, material: &Name) -> Result<Finish> {
        self.lit(material, None)
    }

    /// The finish of a material that a light may pass through.
    pub(super) fn lit(&self, material: &Name, light: Option<&Name>) -> Result<Finish> {
        let words = self.words;
        Ok(Finish {
            material: words.index("material", &words.materials, material)?,
            light: light
                .map(|light| words.index("light", &words.lights, light))
                .transpose()?,
        })
    }

    /// The finish of a material, or `default` if none is named.
    pub(super) fn or(&self, material: Option<&Name>, default: Finish) -> Result<Finish> {
        material.map_or(Ok(default), |material| self.finish(material))
    }

    /// The finishes of several materials.
    pub(super) fn finishes(&self, materials: &[Name]) -> Result<Vec<Finish>> {
        materials
            .iter()
            .map(|material| self.finish(material))
            .collect()
    }

    /// A number from `low` to `high`.
    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        let [u, ..] = self.random.next_uniforms();
        low + (high - low) * u
    }

    /// One of several finishes.
    pub(super) fn any(&mut self, finishes: &[Finish]) -> Finish {
        let [word, ..] = self.random.next_words();
        finishes[word as usize % finishes.len()]
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

/// Right, up and out of an object on a wall: `facing` is out.
pub(super) fn wall(facing: Option<Direction>) -> Mat3 {
    let out = facing.map_or(Vec3::NEG_Y, |facing| facing.0);
    let up = if out.z.abs() > 0.9 { Vec3::Y } else { Vec3::Z };
    let right = up.cross(out).normalize();
    Mat3::from_cols(right, out.cross(right), out)
}
