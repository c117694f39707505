//! Regions in a script.

use crate::select::Selector;
use crate::shape::Shape;
use eagpt_scene::script::value::{Array, Direction, Number, Positive, Rotation, checked};
use glam::{Quat, Vec3};
use serde::{Deserialize, Deserializer};

pub(super) fn sphere<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Selector>, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        centre: Array<Number, 3>,
        radius: Positive,
    }

    let Keys { centre, radius } = Keys::deserialize(deserializer)?;
    Ok(Some(Selector::Shape(Shape::Sphere {
        centre: centre.into(),
        radius: radius.into(),
    })))
}

pub(super) fn half_space<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Selector>, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        point: Array<Number, 3>,
        normal: Direction,
    }

    let Keys { point, normal } = Keys::deserialize(deserializer)?;
    Ok(Some(Selector::Shape(Shape::HalfSpace {
        point: point.into(),
        normal: normal.0,
    })))
}

pub(super) fn cylinder<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Selector>, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        from: Array<Number, 3>,
        to: Array<Number, 3>,
        radius: Positive,
    }

    checked(deserializer, |keys: Keys| {
        let [from, to] = [keys.from, keys.to].map(Vec3::from);
        if from == to {
            return Err(format!("from and to are the same point {from}"));
        }
        Ok(Some(Selector::Shape(Shape::Cylinder {
            from,
            to,
            radius: keys.radius.into(),
        })))
    })
}

pub(super) fn cuboid<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Selector>, D::Error> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Keys {
        min: Option<Array<Number, 3>>,
        max: Option<Array<Number, 3>>,
        centre: Option<Array<Number, 3>>,
        size: Option<Array<Positive, 3>>,
        rotate: Option<Rotation>,
    }

    checked(deserializer, |keys: Keys| {
        let (centre, half) = match (keys.min, keys.max, keys.centre, keys.size) {
            (Some(min), Some(max), None, None) if keys.rotate.is_none() => {
                let [low, high] = [min, max].map(Vec3::from);
                if low.cmpge(high).any() {
                    return Err(format!("min {low} is not below max {high}"));
                }
                (0.5 * (low + high), 0.5 * (high - low))
            }
            (None, None, Some(centre), Some(size)) => (centre.into(), 0.5 * Vec3::from(size)),
            _ => return Err("has either min and max, or centre, size and rotate".to_owned()),
        };
        Ok(Some(Selector::Shape(Shape::Box {
            centre,
            half,
            rotation: keys.rotate.map_or(Quat::IDENTITY, Quat::from),
        })))
    })
}
