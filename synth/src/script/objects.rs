//! `[[object]]`: things in the room.

use super::builder::{Builder, Object, Vocabulary};
use super::{decor, furniture, solids};
use crate::room::Surface;
use eagpt_scene::Result;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::script::Spanned;
use eagpt_scene::script::value::{Array, Number, checked, one_of};
use glam::{Mat3, Vec3};
use serde::{Deserialize, Deserializer};

/// Surfaces of a room, at most: more would be a mistake in a file that people write.
const MAX_SURFACES: usize = 50_000;

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
            room: Option<solids::Room>,
            #[serde(rename = "box")]
            cuboid: Option<solids::Cuboid>,
            panel: Option<solids::Panel>,
            ball: Option<solids::Ball>,
            can: Option<solids::Can>,
            lathe: Option<solids::Lathe>,
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

fn object<T: Object + 'static>(keys: Option<T>) -> Option<Box<dyn Object>> {
    keys.map(|keys| Box::new(keys) as Box<dyn Object>)
}

/// The surfaces of all objects.
pub(super) fn surfaces(
    words: &Vocabulary<'_>,
    objects: &Spanned<Vec<Spanned<ObjectKeys>>>,
) -> Result<Vec<Surface>> {
    let key = RandomKey::new(0, Purpose::Furnish, 0);
    let mut surfaces = Vec::new();
    for (index, object) in (0..).zip(objects.get_ref()) {
        let keys = object.get_ref();
        keys.object.build(&mut Builder {
            words,
            at: keys.at,
            turn: Mat3::from_rotation_z(keys.turn_rad),
            random: key.stream(index, 0),
            surfaces: &mut surfaces,
        })?;
        if surfaces.len() > MAX_SURFACES {
            let problem = format!("the room has more than {MAX_SURFACES} surfaces by now");
            return Err(words.file.error(object.span(), problem));
        }
    }
    if surfaces.is_empty() {
        return Err(words.file.error(objects.span(), "there are no objects"));
    }
    Ok(surfaces)
}
