//! The room: a box seen from inside, and boxes in it. Metres, z up, floor at z = 0.

use glam::{Vec2, Vec3};

/// Half the extents of the room along x and y.
pub(super) const HALF_FLOOR: Vec2 = Vec2::new(2.4, 1.9);
/// Height of the ceiling.
pub(super) const HEIGHT: f32 = 2.6;
/// Half the extents of the light, a rectangle in the middle of the ceiling.
pub(super) const HALF_LIGHT: Vec2 = Vec2::new(0.6, 0.45);
/// Radiance of the light, linear Rec.709.
pub(super) const LIGHT_RADIANCE: Vec3 = Vec3::new(12.0, 11.0, 9.0);

/// A box that stands on the floor, turned about the vertical axis.
struct StandingBox {
    centre: Vec2,
    half: Vec2,
    height: f32,
    /// Cosine and sine of the turn.
    turn: Vec2,
    albedo: Vec3,
}

const BOXES: [StandingBox; 2] = [
    StandingBox {
        centre: Vec2::new(1.3, 0.9),
        half: Vec2::new(0.35, 0.35),
        height: 1.1,
        turn: Vec2::new(0.96, 0.28),
        albedo: Vec3::new(0.72, 0.65, 0.45),
    },
    StandingBox {
        centre: Vec2::new(-1.1, -0.7),
        half: Vec2::new(0.45, 0.3),
        height: 0.5,
        turn: Vec2::new(0.8, -0.6),
        albedo: Vec3::new(0.25, 0.4, 0.65),
    },
];

/// Where a ray met a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    /// Distance along the ray, metres.
    pub(super) distance: f32,
    /// World position.
    pub(super) position: Vec3,
    /// Unit normal, turned to where the ray came from.
    pub(super) normal: Vec3,
    /// Diffuse albedo; black on the light.
    pub(super) albedo: Vec3,
    /// Radiance emitted towards the ray's origin; black on all but the light.
    pub(super) emitted: Vec3,
}

impl Hit {
    /// True where the ray met the light.
    pub(super) fn is_light(&self) -> bool {
        self.emitted != Vec3::ZERO
    }
}

/// The first surface that a ray from inside the room meets. `direction` is of unit length.
pub(super) fn intersect(origin: Vec3, direction: Vec3) -> Hit {
    let mut nearest = wall(origin, direction);
    for standing in &BOXES {
        if let Some(hit) = standing.intersect(origin, direction)
            && hit.distance < nearest.distance
        {
            nearest = hit;
        }
    }
    nearest
}

/// True for a ray that reaches `distance` unhindered.
pub(super) fn is_free(origin: Vec3, direction: Vec3, distance: f32) -> bool {
    BOXES.iter().all(|standing| {
        standing
            .intersect(origin, direction)
            .is_none_or(|hit| hit.distance > distance)
    })
}

fn wall(origin: Vec3, direction: Vec3) -> Hit {
    let low = Vec3::new(-HALF_FLOOR.x, -HALF_FLOOR.y, 0.0);
    let high = Vec3::new(HALF_FLOOR.x, HALF_FLOOR.y, HEIGHT);
    // The wall ahead on each axis; an axis the ray does not move along gives infinity.
    let ahead = Vec3::select(direction.cmpgt(Vec3::ZERO), high, low);
    let distances = Vec3::select(
        direction.cmpeq(Vec3::ZERO),
        Vec3::INFINITY,
        (ahead - origin) / direction,
    );
    let distance = distances.min_element().max(0.0);
    let axis = distances.min_position();
    let position = origin + direction * distance;
    let mut normal = Vec3::ZERO;
    normal[axis] = -direction[axis].signum();
    let on_light = normal.z < 0.0 && position.truncate().abs().cmple(HALF_LIGHT).all();
    Hit {
        distance,
        position,
        normal,
        albedo: if on_light {
            Vec3::ZERO
        } else {
            wall_albedo(position, normal)
        },
        emitted: if on_light { LIGHT_RADIANCE } else { Vec3::ZERO },
    }
}

/// Each wall has its own colour; floor and long walls carry a pattern, without which flat colours
/// would leave depth to guess.
fn wall_albedo(position: Vec3, normal: Vec3) -> Vec3 {
    let tile = |a: f32, b: f32| ((a.floor() + b.floor()) as i32).rem_euclid(2) == 0;
    if normal.z > 0.0 {
        let bright = tile(position.x / 0.6, position.y / 0.6);
        return if bright {
            Vec3::new(0.55, 0.4, 0.28)
        } else {
            Vec3::new(0.3, 0.2, 0.13)
        };
    }
    if normal.z < 0.0 {
        return Vec3::splat(0.8);
    }
    if normal.x != 0.0 {
        return if normal.x > 0.0 {
            Vec3::new(0.62, 0.12, 0.08)
        } else {
            Vec3::new(0.12, 0.42, 0.14)
        };
    }
    if tile(position.x / 0.4, 0.0) {
        Vec3::new(0.7, 0.68, 0.62)
    } else {
        Vec3::new(0.5, 0.52, 0.58)
    }
}

impl StandingBox {
    /// The first point where a ray enters the box, or `None`, also for rays from inside.
    fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        // `rotate` by the conjugate turns into the box's axes.
        let into = |v: Vec2| Vec2::new(self.turn.x, -self.turn.y).rotate(v);
        let o = into(origin.truncate() - self.centre).extend(origin.z - 0.5 * self.height);
        let d = into(direction.truncate()).extend(direction.z);
        let half = self.half.extend(0.5 * self.height);
        // Box intersection by axes; a component of 0 gives infinities of the right sign, or no
        // overlap.
        let inverse = d.recip();
        let (a, b) = ((-half - o) * inverse, (half - o) * inverse);
        let (enter, leave) = (a.min(b), a.max(b));
        let (distance, end) = (enter.max_element(), leave.min_element());
        if distance.is_nan() || end.is_nan() || distance > end || distance <= 0.0 {
            return None;
        }
        let axis = enter.max_position();
        let mut local = Vec3::ZERO;
        local[axis] = -d[axis].signum();
        let normal = self.turn.rotate(local.truncate()).extend(local.z);
        Some(Hit {
            distance,
            position: origin + direction * distance,
            normal,
            albedo: self.albedo,
            emitted: Vec3::ZERO,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_rays() {
        let eye = Vec3::new(0.0, 0.0, 1.0);
        let up = intersect(eye, Vec3::Z);
        assert!(up.is_light() && up.normal == Vec3::NEG_Z && (up.distance - 1.6).abs() < 1e-6);
        let right = intersect(eye, Vec3::X);
        assert!((right.distance - 2.4).abs() < 1e-6 && right.albedo.y > right.albedo.x);
        let down = intersect(Vec3::new(1.3, 0.9, 2.0), Vec3::NEG_Z);
        assert!((down.distance - 0.9).abs() < 1e-6 && down.normal == Vec3::Z);
        assert!(!is_free(Vec3::new(1.3, 0.9, 2.0), Vec3::NEG_Z, 1.9));
        assert!(is_free(eye, Vec3::Z, 1.6));
    }

    #[test]
    fn normals_face_the_ray() {
        let eye = Vec3::new(-0.3, 0.4, 1.3);
        for i in 0..500_u32 {
            let (a, b) = (i as f32 * 2.399, 1.0 - 2.0 * (i as f32 + 0.5) / 500.0);
            let flat = (1.0 - b * b).sqrt();
            let direction = Vec3::new(flat * a.cos(), flat * a.sin(), b);
            let hit = intersect(eye, direction);
            assert!(
                hit.normal.dot(direction) < 0.0 && hit.normal.is_normalized(),
                "{hit:?}"
            );
            assert!((hit.position - eye).length() - hit.distance < 1e-5);
        }
    }
}
