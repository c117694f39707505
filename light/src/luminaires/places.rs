//! Places that cameras look towards and do not see, as something hides them that is near.

use crate::makes::of_one_make;
use crate::unseen::hull::Hull;
use eagpt_scene::{Camera, Lamp, LampShape};
use eagpt_trace::{Ray, TraceError, Tracer};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Distance up to which something hides a bulb, in edges of a cube of the room's volume: a shade
/// of 25 cm in a room of 70 m³.
const REACH: f32 = 0.06;
/// Distance of neighbouring places, in that.
const SPACING: f32 = 0.4;
/// Surfaces nearer to a place than this, in the reach, are of what hides it.
pub(super) const NEAR: f32 = 0.5;
/// Depths behind flat lamps, which may be openings of fixtures too narrow for these, in widths.
const DEPTHS: [f32; 4] = [0.3, 0.6, 1.0, 1.5];
/// Cameras that something near hides a place from, at least.
const LEAST_HIDDEN: usize = 3;
/// Rays that are traced together.
const RAYS_AT_ONCE: usize = 1 << 18;
/// Rings of directions about the upward one, from above to below, of 7.5° each.
pub(super) const NUM_RINGS: usize = 24;
/// Those of one half.
pub(super) const HALF: usize = NUM_RINGS / 2;

/// A place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Place {
    /// Where a bulb is; one of the same light behind each of several lamps of one make.
    pub(super) positions: Vec<Vec3>,
    /// Whether it is behind a flat lamp, which may be the opening of its fixture.
    pub(super) is_behind_lamp: bool,
    /// Rings from the uppermost one on, and from the lowest one on, in which no camera is that
    /// something near hides the place from: light may leave there. At most [`HALF`].
    pub(super) open: [usize; 2],
}

/// All places.
pub(super) struct Places {
    pub(super) all: Vec<Place>,
    /// Distance up to which something hides them, scene units.
    pub(super) reach: f32,
}

impl Places {
    /// Distance of neighbouring places, scene units.
    pub(super) fn spacing(&self) -> f32 {
        SPACING * self.reach
    }
}

/// The ring of a direction of this cosine to the upward one.
pub(super) fn ring(cosine: f32) -> usize {
    let angle = cosine.clamp(-1.0, 1.0).acos();
    ((angle / PI * NUM_RINGS as f32) as usize).min(NUM_RINGS - 1)
}

/// Cosine of the middle of a ring to the upward direction.
pub(super) fn cosine(ring: usize) -> f32 {
    (PI * (ring as f32 + 0.5) / NUM_RINGS as f32).cos()
}

/// The half in which a ring is, 0 above, and its number from the end of that.
pub(super) fn side(ring: usize) -> (usize, usize) {
    if ring < HALF {
        (0, ring)
    } else {
        (1, NUM_RINGS - 1 - ring)
    }
}

/// Whether a direction of this cosine to the upward one is in one of two cones, of so many rings
/// from above and from below.
pub(super) fn is_open(cosine: f32, cones: [usize; 2]) -> bool {
    let (half, number) = side(ring(cosine));
    number < cones[half]
}

/// Solid angle of two cones, of so many rings from above and from below, steradians.
pub(super) fn solid_angle(cones: [usize; 2]) -> f32 {
    let cap = |num: usize| TAU * (1.0 - (PI * num as f32 / NUM_RINGS as f32).cos());
    cones.map(cap).iter().sum()
}

/// Views of a place.
#[derive(Debug, Clone, Copy, Default)]
struct Looks {
    is_seen: bool,
    /// Cameras in each ring that something near hides it from.
    hidden: [u16; NUM_RINGS],
}

impl Looks {
    /// Whether something near hides the place from all cameras that look towards it.
    fn hide(&self) -> bool {
        let num: u16 = self.hidden.iter().sum();
        !self.is_seen && usize::from(num) >= LEAST_HIDDEN
    }

    /// [`Place::open`].
    fn open(&self) -> [usize; 2] {
        let (above, below) = self.hidden.split_at(HALF);
        let from_above = above.iter().take_while(|num| **num == 0);
        let from_below = below.iter().rev().take_while(|num| **num == 0);
        [from_above.count(), from_below.count()]
    }
}

/// The places within the box around `surfaces`, `up` being the unit vector upwards.
///
/// # Errors
/// If the device fails.
pub(super) fn hidden(
    tracer: &dyn Tracer,
    (surfaces, lamps): (&[Vec3], &[Lamp]),
    (cameras, up): (&[Camera], Vec3),
) -> Result<Places, TraceError> {
    let Some(hull) = Hull::around(surfaces, up) else {
        return Ok(Places {
            all: Vec::new(),
            reach: 0.0,
        });
    };
    let size = hull.high - hull.low;
    let reach = REACH * size.element_product().cbrt();
    let spacing = SPACING * reach;
    let [across, along, upwards] = (size / spacing).ceil().to_array().map(|num| num as u32);
    let num_grid = (across * along * upwards) as usize;
    let grid = (0..across * along * upwards).map(|i| {
        let at = [i % across, i / across % along, i / across / along];
        let at = Vec3::from_array(at.map(|k| k as f32 + 0.5));
        hull.rotation * (hull.low + spacing * at)
    });
    let openings = lamps
        .iter()
        .filter(|lamp| lamp.shape == LampShape::Panel && lamp.one_sided);
    let openings: Vec<&Lamp> = openings.collect();
    let behind = (openings.iter()).flat_map(|lamp| DEPTHS.map(|depth| behind(lamp, depth)));
    let positions: Vec<Vec3> = grid.chain(behind).collect();
    let looks = looks(tracer, &positions, (cameras, up), [0.0, reach])?;
    let place = |numbers: Vec<usize>| {
        // A gap in one of several lamps of one make is training's.
        let hidden = numbers.iter().filter(|number| looks[**number].hide());
        let is_hidden = 2 * hidden.clone().count() >= numbers.len();
        let open = hidden.map(|number| looks[*number].open());
        is_hidden.then(|| Place {
            positions: numbers.iter().map(|number| positions[*number]).collect(),
            is_behind_lamp: numbers[0] >= num_grid,
            open: open.fold([HALF; 2], |[a, b], [c, d]| [a.min(c), b.min(d)]),
        })
    };
    let singles = (0..positions.len()).map(|number| vec![number]);
    let mut makes = of_one_make(&openings, up);
    makes.retain(|make| make.len() > 1);
    let sets = makes.into_iter().flat_map(|set| {
        let number = |depth, opening| num_grid + opening * DEPTHS.len() + depth;
        (0..DEPTHS.len()).map(move |depth| set.iter().map(|i| number(depth, *i)).collect())
    });
    Ok(Places {
        all: singles.chain(sets).filter_map(place).collect(),
        reach,
    })
}

/// The place so many widths behind a flat lamp.
fn behind(lamp: &Lamp, depth: f32) -> Vec3 {
    let back = lamp.world_from_lamp() * -Vec3::Z;
    lamp.centre() + depth * 0.5 * (lamp.size[0] + lamp.size[1]) * back
}

/// Views that `cameras` have of `places`, `[places]`, which are seen where they are up to a
/// distance behind a surface, and hidden by something near up to another; `up` is the unit vector
/// upwards.
///
/// # Errors
/// If the device fails.
fn looks(
    tracer: &dyn Tracer,
    places: &[Vec3],
    (cameras, up): (&[Camera], Vec3),
    [shallow, near]: [f32; 2],
) -> Result<Vec<Looks>, TraceError> {
    let mut looks = vec![Looks::default(); places.len()];
    for camera in cameras {
        let eye = camera.origin();
        let is_open =
            |i: &usize| !looks[*i].is_seen && camera.is_in_picture(camera.project(places[*i]));
        let open: Vec<usize> = (0..places.len()).filter(is_open).collect();
        for some in open.chunks(RAYS_AT_ONCE) {
            let sees = |depth: f32, some: &[usize]| {
                let ray = |i: &usize| {
                    let towards = (places[*i] - eye).normalize_or_zero();
                    Ray::free(eye.to_array(), towards.to_array())
                };
                let rays: Vec<Ray> = some.iter().map(ray).collect();
                let distance = |i: &usize| places[*i].distance(eye) - depth;
                tracer.are_free(&rays, &some.iter().map(distance).collect::<Vec<_>>())
            };
            let mut hidden = Vec::new();
            for (&i, is_seen) in some.iter().zip(sees(shallow, some)?) {
                looks[i].is_seen = is_seen;
                if !is_seen {
                    hidden.push(i);
                }
            }
            for (&i, is_near) in hidden.iter().zip(sees(near, &hidden)?) {
                if is_near {
                    let cosine = (eye - places[i]).normalize_or_zero().dot(up);
                    looks[i].hidden[ring(cosine)] += 1;
                }
            }
        }
    }
    Ok(looks)
}

/// Whether some of the `cameras` see `places`, or would if they were not up to a `depth` behind a
/// surface, `[places]`.
///
/// # Errors
/// If the device fails.
pub(super) fn seen(
    tracer: &dyn Tracer,
    places: &[Vec3],
    cameras: &[Camera],
    depth: f32,
) -> Result<Vec<bool>, TraceError> {
    let looks = looks(tracer, places, (cameras, Vec3::Z), [depth, depth])?;
    Ok(looks.iter().map(|of| of.is_seen).collect())
}
