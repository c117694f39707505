//! Where on a plane a mirror hangs: the photographs of what is there against what the trained scene
//! would show in a mirror.

mod refine;

use crate::evidence::{Scale, Seen, difference};
use crate::outline::{Outline, Scores};
use crate::plane;
use eagpt_scene::median::median_of;
use eagpt_scene::plane::Plane;
use eagpt_trace::{Ray, TraceError, Tracer};
use glam::{IVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashSet};
use std::ops::RangeInclusive;

/// Surfaces are at a plane up to so many of their thicknesses from it.
const AT_PLANE: f32 = 2.0;
/// Cosine between a line of sight and the normal, at least.
const LEAST_COSINE: f32 = 0.1;
/// Cosine between the normal of a plane and those of surfaces that say how far it reaches.
const SAME_WAY: f32 = 0.95;
/// Distance of what is seen behind a plane, in that of what would be mirrored.
const SAME_DISTANCE: RangeInclusive<f32> = 0.5..=2.0;
/// Pixels of a cell whose median is its colour, at least.
const LEAST_PIXELS: usize = 3;
/// Reflectance of a mirror, to begin with and at least.
const REFLECTANCE: f32 = 0.85;
const LEAST_REFLECTANCE: f32 = 0.4;
/// Rounds in which outline and reflectance are found from each other.
const ROUNDS: usize = 2;
/// Pixels' worth of evidence that a mirror has, at least, and the share of the differences within
/// cells that it explains: the less, the more evidence there is. Where training has misplaced what
/// a mirror shows, even a large one explains .3. In rooms without one, planes that pass through the
/// air before walls come to .7, but show what other views see, too; none on a wall comes to 100 and
/// .35, nor to 700 and .2.
const LEAST_SCORE: f32 = 100.0;
const LEAST_EXPLAINED: f32 = 0.35;
const MUCH_SCORE: f32 = 1000.0;
const LEAST_EXPLAINED_OF_MUCH: f32 = 0.2;
/// Cells that a mirror is wide and high, at least, and views that show it.
const LEAST_CELLS: f32 = 4.0;
const LEAST_VIEWS: usize = 2;
/// Share of what is seen behind a mirror that is also seen past it, at most: that is really there.
const MOST_REAL: f32 = 0.3;

/// A mirror as it is found on a plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hung {
    pub(crate) plane: Plane,
    pub(crate) axes: [Vec3; 2],
    /// Middle, world space.
    pub(crate) centre: Vec3,
    /// Whole width and height, scene units.
    pub(crate) size: Vec2,
    pub(crate) is_round: bool,
    pub(crate) reflectance: Vec3,
    pub(crate) num_views: usize,
    /// Share of the differences within cells that it explains.
    pub(crate) explained: f32,
    /// Pixels' worth of evidence.
    pub(crate) score: f32,
}

/// A part of a plane, divided into cells, with the pixels that may see it.
pub(crate) struct Wall<'a> {
    seen: &'a [Seen],
    scale: Scale,
    axes: [Vec3; 2],
    /// Coordinates of its lower corner along the axes, scene units.
    corner: Vec2,
    /// Cells along each axis.
    num: [usize; 2],
}

/// A pixel that sees the wall, or something behind it.
#[derive(Debug, Clone, Copy)]
struct Sight {
    /// Its index.
    seen: usize,
    cell: usize,
    /// Distance along the ray to the plane.
    distance: f32,
    /// Height of what is seen above the plane.
    height: f32,
}

/// A pixel, and what a mirror would show there: logarithms of light.
struct Compared {
    sight: Sight,
    photographed: Vec3,
    /// `None` where nothing is, or something at another distance is seen.
    mirrored: Option<Vec3>,
}

impl<'a> Wall<'a> {
    /// The part of a plane in which surfaces lie, at least one of `seen`.
    pub(crate) fn new(seen: &'a [Seen], scale: Scale, plane: Plane, up: Vec3) -> Self {
        let axes = plane::axes(plane.normal, up);
        let of_plane = seen.iter().filter(|seen| {
            let height = plane.height(seen.position()).abs();
            seen.normal.dot(plane.normal) > SAME_WAY && height <= scale.near
        });
        let places = of_plane.map(|seen| coordinates(axes, seen.position()));
        let bounds = places.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        let num = ((bounds.1 - bounds.0) / scale.cell).max(Vec2::ZERO).ceil();
        Self {
            seen,
            scale,
            axes,
            corner: bounds.0,
            num: [num.x as usize + 1, num.y as usize + 1],
        }
    }

    /// The mirror in the plane that most speaks for, if one does.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn mirror(
        &self,
        plane: Plane,
        tracer: &dyn Tracer,
    ) -> Result<Option<Hung>, TraceError> {
        let compared = self.compare(plane, self.sights(plane), tracer)?;
        let Some(first) = self.best(plane, &compared) else {
            return Ok(None);
        };
        if first.score < LEAST_SCORE {
            return Ok(None);
        }
        let plane = self.refined(plane, &first, &compared, tracer)?;
        let compared = self.compare(plane, self.sights(plane), tracer)?;
        let found = self.best(plane, &compared).filter(|hung| {
            hung.score >= LEAST_SCORE
                && hung.explained >= hung.least_explained()
                && hung.num_views >= LEAST_VIEWS
                && hung.size.min_element() >= LEAST_CELLS * self.scale.cell
                && self.share_real(hung) <= MOST_REAL
        });
        Ok(found)
    }

    /// Pixels that see the plane within the wall, or something behind it.
    fn sights(&self, plane: Plane) -> Vec<Sight> {
        let all = 0..self.seen.len();
        all.filter_map(|index| self.sight(plane, index)).collect()
    }

    /// A pixel by its index, if it is one of [`Self::sights`].
    fn sight(&self, plane: Plane, index: usize) -> Option<Sight> {
        let seen = &self.seen[index];
        let distance = plane.meet(seen.origin, seen.direction)?;
        let height = match seen.distance.is_finite() {
            true => plane.height(seen.position()),
            false => f32::NEG_INFINITY,
        };
        let is_flat = -plane.normal.dot(seen.direction) < LEAST_COSINE;
        if is_flat || height > self.scale.past() {
            return None;
        }
        Some(Sight {
            seen: index,
            cell: self.cell(seen.origin + seen.direction * distance)?,
            distance,
            height,
        })
    }

    /// The cell of a point of the plane.
    fn cell(&self, point: Vec3) -> Option<usize> {
        let at = self.place(point);
        let [width, height] = self.num;
        let is_within = at.min_element() >= 0.0 && at.x < width as f32 && at.y < height as f32;
        is_within.then(|| at.y as usize * width + at.x as usize)
    }

    /// Place of a point, in cells.
    fn place(&self, point: Vec3) -> Vec2 {
        (coordinates(self.axes, point) - self.corner) / self.scale.cell
    }

    fn compare(
        &self,
        plane: Plane,
        sights: Vec<Sight>,
        tracer: &dyn Tracer,
    ) -> Result<Vec<Compared>, TraceError> {
        let behind = -AT_PLANE * self.scale.near;
        let ray = |sight: &Sight| {
            let seen = &self.seen[sight.seen];
            plane::reflected(
                plane,
                (seen.origin, seen.direction),
                sight.distance,
                self.scale.past(),
            )
        };
        let rays: Vec<Ray> = sights.par_iter().map(ray).collect();
        let met = tracer.trace_rays(&rays)?;
        let compared = sights.into_iter().zip(met).map(|(sight, met)| {
            let seen = &self.seen[sight.seen];
            let beyond = (seen.distance - sight.distance) / met.mean_distance();
            let is_there = sight.height > behind || SAME_DISTANCE.contains(&beyond);
            Compared {
                sight,
                photographed: self.scale.log(seen.radiance),
                mirrored: (met.alpha() > 0.5 && is_there).then(|| self.scale.log(met.radiance())),
            }
        });
        Ok(compared.collect())
    }

    /// The outline that most speaks for: pixels in it differ less from what a mirror would show
    /// than from the colour of their cell.
    fn best(&self, plane: Plane, compared: &[Compared]) -> Option<Hung> {
        let colors = self.colors(compared);
        let mut tint = Vec3::splat(REFLECTANCE.ln());
        let mut found = None;
        for _ in 0..ROUNDS {
            let mut scores = Scores {
                width: self.num[0],
                cells: vec![0.0; colors.len()],
            };
            let mut apart = vec![(0.0, 0.0); colors.len()];
            for pixel in compared {
                let cell = pixel.sight.cell;
                if let Some(color) = colors[cell] {
                    let (painted, mirrored) =
                        (difference(pixel.photographed - color), pixel.off(tint));
                    scores.cells[cell] += painted - mirrored;
                    apart[cell].0 += painted;
                    apart[cell].1 += mirrored;
                }
            }
            let (score, outline) = scores.best()?;
            let is_in: Vec<bool> = scores.middles().map(|at| outline.has(at)).collect();
            let within = || compared.iter().filter(|pixel| is_in[pixel.sight.cell]);
            let ratio = |channel: usize| {
                let ratios = within().filter_map(|pixel| {
                    Some(pixel.photographed[channel] - pixel.mirrored?[channel])
                });
                median_of(ratios).clamp(LEAST_REFLECTANCE.ln(), 0.0)
            };
            tint = Vec3::from_array([0, 1, 2].map(ratio));
            let of_cells = || apart.iter().zip(&is_in).filter(|(_, is_in)| **is_in);
            let painted: f32 = of_cells().map(|(apart, _)| apart.0).sum();
            let mirrored: f32 = of_cells().map(|(apart, _)| apart.1).sum();
            let views: BTreeSet<u32> = within().map(|p| self.seen[p.sight.seen].view).collect();
            found = Some(Hung {
                plane,
                axes: self.axes,
                centre: self.point(plane, outline.centre()),
                size: outline.size() * self.scale.cell,
                is_round: outline.is_round,
                reflectance: tint.map(f32::exp),
                num_views: views.len(),
                explained: 1.0 - mirrored / painted,
                score,
            });
        }
        found
    }

    /// A point of a plane by its place in cells.
    fn point(&self, plane: Plane, at: Vec2) -> Vec3 {
        let [u, v] = self.axes;
        let at = self.corner + at * self.scale.cell;
        let point = u * at.x + v * at.y;
        // The axes are those of the plane before it was turned.
        point - plane.normal * plane.height(point)
    }

    /// Median logarithm of the light of the pixels of each cell; `None` where they are few.
    fn colors(&self, compared: &[Compared]) -> Vec<Option<Vec3>> {
        let mut of_cells = vec![Vec::new(); self.num[0] * self.num[1]];
        for pixel in compared {
            of_cells[pixel.sight.cell].push(pixel.photographed);
        }
        let color = |pixels: Vec<Vec3>| {
            let median = |channel: usize| median_of(pixels.iter().map(|light| light[channel]));
            (pixels.len() >= LEAST_PIXELS).then(|| Vec3::from_array([0, 1, 2].map(median)))
        };
        of_cells.into_par_iter().map(color).collect()
    }

    /// Whether a pixel's line of sight goes through a mirror.
    fn is_on(&self, hung: &Hung, sight: &Sight) -> bool {
        let seen = &self.seen[sight.seen];
        hung.has(seen.origin + seen.direction * sight.distance)
    }

    /// Of what is seen behind a mirror, the share of places that pixels show, too, whose lines of
    /// sight do not go through it.
    fn share_real(&self, hung: &Hung) -> f32 {
        let behind = -AT_PLANE * self.scale.near;
        let place = |seen: &Seen| -> IVec3 {
            (seen.position() / (AT_PLANE * self.scale.near))
                .floor()
                .as_ivec3()
        };
        let is_through = |seen: &Seen| {
            let distance = hung.plane.meet(seen.origin, seen.direction);
            distance
                .is_some_and(|t| t < seen.distance && hung.has(seen.origin + seen.direction * t))
        };
        let is_behind =
            |seen: &&Seen| seen.distance.is_finite() && hung.plane.height(seen.position()) < behind;
        let (through, past): (Vec<&Seen>, Vec<&Seen>) = self
            .seen
            .iter()
            .filter(is_behind)
            .partition(|seen| is_through(seen));
        let past: HashSet<IVec3> = past.into_iter().map(place).collect();
        let real = through.iter().filter(|seen| past.contains(&place(seen)));
        real.count() as f32 / through.len().max(1) as f32
    }
}

impl Hung {
    /// Share of the differences within cells that it has to explain.
    fn least_explained(&self) -> f32 {
        match self.score >= MUCH_SCORE {
            true => LEAST_EXPLAINED_OF_MUCH,
            false => LEAST_EXPLAINED,
        }
    }

    /// Whether a point of its plane lies in it.
    pub(crate) fn has(&self, point: Vec3) -> bool {
        let outline = Outline::centred(self.size, self.is_round);
        outline.has(coordinates(self.axes, point - self.centre))
    }
}

impl Compared {
    /// How far it is from what a mirror shows whose reflectance has this logarithm, 0 to 1.
    fn off(&self, tint: Vec3) -> f32 {
        self.mirrored.map_or(1.0, |mirrored| {
            difference(self.photographed - mirrored - tint)
        })
    }
}

fn coordinates(axes: [Vec3; 2], point: Vec3) -> Vec2 {
    Vec2::new(axes[0].dot(point), axes[1].dot(point))
}
