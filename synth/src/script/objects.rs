//! `[[object]]`: things in the room.

use super::builder::{Builder, wall};
use super::{decor, furniture, unknown};
use crate::room::Surface;
use crate::room::shape::Ends;
use eagpt_scene::Result;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::script::value::{Array, Direction, Number, Positive, checked, one_of};
use eagpt_scene::script::{ScriptFile, Spanned};
use glam::{Mat3, Vec2, Vec3};
use serde::{Deserialize, Deserializer};

/// Surfaces of a room, at most: more would be a mistake in a file that people write.
const MAX_SURFACES: usize = 50_000;

/// The name of a material or a light.
pub(super) type Name = Spanned<String>;
/// Two lengths.
pub(super) type Size2 = Array<Positive, 2>;
/// Three lengths.
pub(super) type Size3 = Array<Positive, 3>;

/// An object as a scene file has it.
pub(super) struct ObjectKeys {
    at: Vec3,
    turn_rad: f32,
    object: Box<dyn Object>,
}

impl<'de> Deserialize<'de> for ObjectKeys {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Keys {
            at: Option<Array<Number, 3>>,
            turn: Option<Number>,
            room: Option<RoomKeys>,
            #[serde(rename = "box")]
            cuboid: Option<BoxKeys>,
            panel: Option<PanelKeys>,
            ball: Option<BallKeys>,
            can: Option<CanKeys>,
            lathe: Option<LatheKeys>,
            table: Option<furniture::Table>,
            chair: Option<furniture::Chair>,
            shelf: Option<furniture::Shelf>,
            sofa: Option<furniture::Sofa>,
            lamp: Option<decor::Lamp>,
            pendant: Option<decor::Pendant>,
            window: Option<decor::Window>,
            picture: Option<decor::Picture>,
            plant: Option<decor::Plant>,
            books: Option<furniture::Books>,
            fruit: Option<furniture::Fruit>,
        }

        checked(deserializer, |keys: Keys| {
            Ok(Self {
                at: keys.at.map_or(Vec3::ZERO, Vec3::from),
                turn_rad: keys.turn.map_or(0.0, |turn| f32::from(turn).to_radians()),
                object: one_of([
                    ("room", object(keys.room)),
                    ("box", object(keys.cuboid)),
                    ("panel", object(keys.panel)),
                    ("ball", object(keys.ball)),
                    ("can", object(keys.can)),
                    ("lathe", object(keys.lathe)),
                    ("table", object(keys.table)),
                    ("chair", object(keys.chair)),
                    ("shelf", object(keys.shelf)),
                    ("sofa", object(keys.sofa)),
                    ("lamp", object(keys.lamp)),
                    ("pendant", object(keys.pendant)),
                    ("window", object(keys.window)),
                    ("picture", object(keys.picture)),
                    ("plant", object(keys.plant)),
                    ("books", object(keys.books)),
                    ("fruit", object(keys.fruit)),
                ])?,
            })
        })
    }
}

/// The keys of an object, which build its surfaces.
pub(super) trait Object {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()>;
}

fn object<T: Object + 'static>(keys: Option<T>) -> Option<Box<dyn Object>> {
    keys.map(|keys| Box::new(keys) as Box<dyn Object>)
}

/// Names that objects may refer to, in the order of their indices.
pub(super) struct Vocabulary<'a> {
    pub(super) file: &'a ScriptFile,
    pub(super) materials: Vec<&'a str>,
    pub(super) lights: Vec<&'a str>,
}

impl Vocabulary<'_> {
    /// The surfaces of all objects.
    pub(super) fn surfaces(
        &self,
        objects: &Spanned<Vec<Spanned<ObjectKeys>>>,
    ) -> Result<Vec<Surface>> {
        let key = RandomKey::new(0, Purpose::Furnish, 0);
        let mut surfaces = Vec::new();
        for (index, object) in (0..).zip(objects.get_ref()) {
            let keys = object.get_ref();
            keys.object.build(&mut Builder {
                words: self,
                at: keys.at,
                turn: Mat3::from_rotation_z(keys.turn_rad),
                random: key.stream(index, 0),
                surfaces: &mut surfaces,
            })?;
            if surfaces.len() > MAX_SURFACES {
                let problem = format!("the room has more than {MAX_SURFACES} surfaces by now");
                return Err(self.file.error(object.span(), problem));
            }
        }
        if surfaces.is_empty() {
            return Err(self.file.error(objects.span(), "there are no objects"));
        }
        Ok(surfaces)
    }

    pub(super) fn index(&self, noun: &str, names: &[&str], name: &Name) -> Result<u32> {
        let found = names.iter().position(|other| other == name.get_ref());
        found.map(|index| index as u32).ok_or_else(|| {
            let names = names.iter().copied();
            unknown(self.file, name.span(), (noun, name.get_ref()), names)
        })
    }
}

/// Floor, ceiling and four walls around the origin, seen from inside.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RoomKeys {
    size: Size3,
    floor: Name,
    ceiling: Name,
    walls: Option<Name>,
    north: Option<Name>,
    south: Option<Name>,
    east: Option<Name>,
    west: Option<Name>,
}

impl Object for RoomKeys {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let size = Vec3::from(self.size);
        let (half, up) = (0.5 * size, size.z);
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x * half.x, y * half.y, z * up);
        let (x, y, z) = (Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * up);
        for (own, corner, edges) in [
            (Some(&self.floor), corner(-1.0, -1.0, 0.0), [x, y]),
            (Some(&self.ceiling), corner(-1.0, 1.0, 1.0), [x, -y]),
            (self.north.as_ref(), corner(-1.0, 1.0, 0.0), [x, z]),
            (self.south.as_ref(), corner(1.0, -1.0, 0.0), [-x, z]),
            (self.east.as_ref(), corner(1.0, 1.0, 0.0), [-y, z]),
            (self.west.as_ref(), corner(-1.0, -1.0, 0.0), [y, z]),
        ] {
            let Some(name) = own.or(self.walls.as_ref()) else {
                let problem = "`walls` is missing, or one of north, south, east, west";
                return Err(builder.words.file.error(self.floor.span(), problem));
            };
            let finish = builder.finish(name)?;
            builder.quad(corner, edges, finish);
        }
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxKeys {
    size: Size3,
    material: Name,
    light: Option<Name>,
}

impl Object for BoxKeys {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        let size = Vec3::from(self.size);
        builder.block(Vec3::Z * (0.5 * size.z), size, finish);
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PanelKeys {
    size: Size2,
    facing: Option<Direction>,
    material: Name,
    light: Option<Name>,
}

impl Object for PanelKeys {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        builder.panel(Vec3::ZERO, wall(self.facing), self.size.into(), finish);
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BallKeys {
    radius: Positive,
    material: Name,
    light: Option<Name>,
}

impl Object for BallKeys {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        builder.ball(Vec3::ZERO, self.radius.into(), finish);
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CanKeys {
    radius: Positive,
    top: Option<Positive>,
    height: Positive,
    #[serde(default)]
    open: bool,
    material: Name,
    light: Option<Name>,
}

impl Object for CanKeys {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        let radii = [self.radius, self.top.unwrap_or(self.radius)].map(f32::from);
        let ends = match self.open {
            true => Ends::Open,
            false => Ends::Closed,
        };
        builder.drum(Vec3::ZERO, self.height.into(), radii, (ends, finish));
        Ok(())
    }
}

/// A body of rotation: radius and height from the bottom up.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LatheKeys {
    #[serde(deserialize_with = "profile")]
    profile: Vec<Vec2>,
    material: Name,
    light: Option<Name>,
}

fn profile<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Vec2>, D::Error> {
    checked(deserializer, |points: Vec<Array<Number, 2>>| {
        let points: Vec<Vec2> = points.into_iter().map(Vec2::from).collect();
        if let Some(point) = points.iter().find(|point| point.x <= 0.0) {
            return Err(format!("a radius of {} is not above 0", point.x));
        }
        if points.len() < 2 {
            return Err("a profile has two points or more".to_owned());
        }
        match points.windows(2).find(|pair| pair[1].y <= pair[0].y) {
            Some(pair) => Err(format!("{} is not above the point before", pair[1].y)),
            None => Ok(points),
        }
    })
}

impl Object for LatheKeys {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        builder.turned(&self.profile, finish);
        Ok(())
    }
}
