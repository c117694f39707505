//! Mirrors of a scene: where photographs show the room reflected, as clean surfaces.
//!
//! Training does not know of mirrors. It makes a second room behind the wall of what a mirror
//! shows, or paints it on the wall, differently for each direction. Neither shows more than the
//! photographs do, and both stay as they are when lamps are switched or things move. What a mirror
//! shows is known, however: the first room. On each plane of the scene (`plane`) photographs are
//! compared with the mirror image of the trained room (`wall`); where it explains them better than
//! any paint does, a mirror hangs (`outline`).
//!
//! - [`Evidence`]: pixels of the views, and where the trained scene has them.
//! - [`find`]: from there to [`Mirror`]s.
//! - [`Room`]: their discs in the scene, in place of what training made of what they show.
//! - [`pixels`]: where a view shows them.

mod evidence;
mod outline;
mod place;
mod plane;
mod wall;

pub use evidence::Evidence;
pub use place::{Room, pixels};

use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::plane::Plane;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussians, Gloss};
use eagpt_trace::{TraceError, Tracer};
use evidence::Seen;
use glam::{Vec2, Vec3};
use outline::Outline;
use serde::{Deserialize, Serialize};
use wall::{Hung, Wall};

/// Perceptual roughness of a mirror: smoother ones look the same in a photograph.
const ROUGHNESS: f32 = 0.05;
/// Discs of a mirror are off its plane by this part of its size, at most.
const FLATNESS: f32 = 1e-3;

/// A flat mirror.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mirror {
    /// Middle, world space.
    pub centre: Vec3,
    /// Whole edges, scene units, at right angles: level, and up; their cross product points into
    /// the room.
    pub edges: [Vec3; 2],
    /// Whether it is an ellipse within these edges.
    pub is_round: bool,
    /// Share of the light that it reflects, linear Rec.709, 0 to 1.
    pub reflectance: Vec3,
    /// Number of views that show it.
    pub num_views: usize,
    /// Share of what photographs show in it that the reflected room explains and paint does not.
    pub explained: f32,
}

impl Mirror {
    fn new(hung: &Hung) -> Self {
        let [u, v] = plane::axes(hung.plane.normal, hung.axes[1]);
        Self {
            centre: hung.centre,
            edges: [u * hung.size.x, v * hung.size.y],
            is_round: hung.is_round,
            reflectance: hung.reflectance,
            num_views: hung.num_views,
            explained: hung.explained,
        }
    }

    /// Unit normal into the room.
    pub fn normal(&self) -> Vec3 {
        let [u, v] = self.edges;
        u.cross(v).normalize()
    }

    fn plane(&self) -> Plane {
        Plane {
            normal: self.normal(),
            offset: self.normal().dot(self.centre),
        }
    }

    /// Distance along a ray that meets its front; `None` for others. The direction is a unit
    /// vector.
    pub fn meet(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let distance = self.plane().meet(origin, direction)?;
        self.covers(origin + direction * distance)
            .then_some(distance)
    }

    /// Whether a point lies before, in or behind it.
    fn covers(&self, point: Vec3) -> bool {
        // In parts of its edges.
        let along = |edge: Vec3| (point - self.centre).dot(edge) / edge.length_squared();
        Outline::centred(Vec2::ONE, self.is_round).has(self.edges.map(along).into())
    }

    /// Its gloss: that of bare metal.
    pub fn gloss(&self) -> Gloss {
        Gloss {
            specular: self.reflectance,
            roughness: ROUGHNESS,
        }
    }

    fn discs(&self) -> Gaussians {
        let (centre, edges) = (self.centre, self.edges);
        let solid = match self.is_round {
            true => Solid::Ellipse {
                centre,
                axes: edges,
            },
            false => Solid::Quad { centre, edges },
        };
        let material = Material {
            albedo: Vec3::ZERO,
            radiance: None,
            gloss: self.gloss(),
        };
        let surface = Surface {
            solid,
            material,
            spacing: None,
        };
        surface.discs()
    }

    /// Whether a disc at `position` is one of its own, among those that do not move.
    fn has_disc(&self, position: Vec3) -> bool {
        let size = self.edges[0].length().max(self.edges[1].length());
        self.plane().height(position).abs() <= FLATNESS * size && self.covers(position)
    }
}

/// Finds the mirrors that views show in the scene that `tracer` traces in their light; `up` is the
/// unit vector upwards. Largest planes first.
///
/// # Errors
/// If the device fails.
pub fn find(
    evidence: &Evidence,
    up: Vec3,
    tracer: &dyn Tracer,
    seed: u64,
) -> Result<Vec<Mirror>, TraceError> {
    let scale = evidence.scale();
    let mut seen = evidence.seen.clone();
    let key = RandomKey::new(seed, Purpose::Align, 1);
    let mut found = Vec::new();
    for plane in plane::planes(&evidence.seen, scale.near, key) {
        while let Some(hung) = Wall::new(&seen, scale, plane, up).mirror(plane, tracer)? {
            let mirror = Mirror::new(&hung);
            // Images in a mirror are no evidence of another one.
            let is_before = |seen: &Seen| mirror.plane().height(seen.position()) > scale.past();
            seen.retain(|seen| {
                mirror.meet(seen.origin, seen.direction).is_none() || is_before(seen)
            });
            found.push(mirror);
        }
    }
    Ok(found)
}

/// Gives the discs of `mirrors` among the last Gaussians, from `first` on, the gloss that they
/// have, which scenes under training do not keep.
pub fn polish(mirrors: &[Mirror], gaussians: &mut Gaussians, first: usize) {
    for i in first..gaussians.len() {
        let position = gaussians.positions[i];
        if let Some(mirror) = mirrors.iter().find(|mirror| mirror.has_disc(position)) {
            if gaussians.gloss.is_empty() {
                gaussians.gloss = vec![Gloss::NONE; gaussians.len()];
            }
            gaussians.gloss[i] = mirror.gloss();
            gaussians.albedos[i] = Vec3::ZERO;
        }
    }
}
