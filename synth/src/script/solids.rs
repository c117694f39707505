//! Rooms, boxes, panels, balls, cans and bodies of rotation.

use super::builder::{Builder, Name, Object, Size2, Size3, wall};
use crate::room::shape::Ends;
use eagpt_scene::Result;
use eagpt_scene::script::value::{Array, Direction, Number, Positive, checked};
use glam::{Vec2, Vec3};
use serde::{Deserialize, Deserializer};

/// Floor, ceiling and four walls around the origin, seen from inside.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Room {
    size: Size3,
    floor: Name,
    ceiling: Name,
    walls: Option<Name>,
    north: Option<Name>,
    south: Option<Name>,
    east: Option<Name>,
    west: Option<Name>,
}

impl Object for Room {
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
pub(super) struct Cuboid {
    size: Size3,
    material: Name,
    light: Option<Name>,
}

impl Object for Cuboid {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        let size = Vec3::from(self.size);
        builder.block(Vec3::Z * (0.5 * size.z), size, finish);
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Panel {
    size: Size2,
    facing: Option<Direction>,
    material: Name,
    light: Option<Name>,
}

impl Object for Panel {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        builder.panel(Vec3::ZERO, wall(self.facing), self.size.into(), finish);
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ball {
    radius: Positive,
    material: Name,
    light: Option<Name>,
}

impl Object for Ball {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        builder.ball(Vec3::ZERO, self.radius.into(), finish);
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Can {
    radius: Positive,
    top: Option<Positive>,
    height: Positive,
    #[serde(default)]
    open: bool,
    material: Name,
    light: Option<Name>,
}

impl Object for Can {
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
pub(super) struct Lathe {
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

impl Object for Lathe {
    fn build(&self, builder: &mut Builder<'_>) -> Result<()> {
        let finish = builder.lit(&self.material, self.light.as_ref())?;
        builder.turned(&self.profile, finish);
        Ok(())
    }
}
