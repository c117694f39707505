//! The lit pixels of views that are one lamp's.

mod bearing;
pub(crate) mod bearings;
pub(crate) mod grouping;
pub(crate) mod points;

use crate::evidence::level::Level;
use crate::evidence::{Evidence, Pixel, Sight};
use glam::Vec3;
use std::cmp::Reverse;
use std::collections::{BTreeMap, HashSet};

/// Points are at one place if they are nearer than this many widths of their pixels.
const NEAR_PIXELS: f32 = 2.0;
/// Points of a lamp that others are compared with.
pub(crate) const MAX_POINTS: usize = 600;

/// Pixels of a lamp in the view that shows it largest from which on it is large.
const LARGE: usize = 400;
/// Least number of the lit pixels of a lamp over all views, …
const MIN_PIXELS: usize = 6;
/// … and in each view where one alone shows it, or two have to agree on its place.
pub(crate) const MIN_PIXELS_OF_FEW: usize = 10;

/// The pixels of a lamp.
#[derive(Debug, Clone, Default)]
pub(crate) struct Group {
    /// Numbers of views and of their pixels, ascending in the end.
    pub(crate) members: Vec<(u32, u32)>,
    pub(crate) points: Vec<Point>,
    /// Where they are, and those that were thinned out.
    bounds: Bounds,
    /// Its radiance in each light, as the view with most detail has it of those that know it.
    levels: BTreeMap<usize, Level>,
}

/// A lit pixel in space.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub(crate) position: Vec3,
    /// Width of its pixel there.
    pub(crate) width: f32,
    pub(crate) light: usize,
    /// Radiance of the pixel, …
    pub(crate) radiance: Vec3,
    /// … and whether it is that of a lamp alone.
    pub(crate) is_whole: bool,
}

impl Group {
    /// One group of several.
    pub(crate) fn together(groups: impl Iterator<Item = Self>) -> Self {
        let mut whole = Self::default();
        groups.for_each(|group| whole.join(group));
        whole.members.sort_unstable();
        whole
    }

    /// Its pixels view by view.
    pub(crate) fn by_view(&self) -> impl Iterator<Item = (usize, &[(u32, u32)])> {
        let views = self.members.chunk_by(|a, b| a.0 == b.0);
        views.map(|members| (members[0].0 as usize, members))
    }

    /// Its pixels in each light that it shines in, by the index of the light.
    pub(crate) fn by_light(&self, evidence: &Evidence) -> Vec<(usize, Self)> {
        let mut lights: BTreeMap<usize, Self> = BTreeMap::new();
        for member in &self.members {
            let light = evidence.sights[member.0 as usize].light;
            let group = lights.entry(light).or_insert_with(|| Self {
                levels: self.levels.clone(),
                ..Self::default()
            });
            group.members.push(*member);
        }
        lights.into_iter().collect()
    }

    /// Its pixels divided among `num` lamps, `of` which each pixel is; others are of none.
    pub(crate) fn divided(&self, of: &[usize], num: usize) -> Vec<Self> {
        let part = |part: usize| {
            let own = self.members.iter().zip(of).filter(|(_, of)| **of == part);
            Self {
                members: own.map(|(member, _)| *member).collect(),
                levels: self.levels.clone(),
                ..Self::default()
            }
        };
        (0..num).map(part).collect()
    }

    /// Whether a view shows it large. Training gives such lamps the right power, and what stands
    /// before them its place.
    pub(crate) fn is_large(&self) -> bool {
        self.by_view().any(|(_, pixels)| pixels.len() >= LARGE)
    }

    /// Whether it is enough for a lamp.
    pub(crate) fn is_enough(&self) -> bool {
        let least = if self.is_of_one_view() {
            MIN_PIXELS_OF_FEW
        } else {
            MIN_PIXELS
        };
        self.members.len() >= least
    }

    /// Whether one view shows all of it.
    pub(crate) fn is_of_one_view(&self) -> bool {
        self.by_view().count() == 1
    }

    /// Share of its pixels, at least one, for which `is_so` is true.
    pub(crate) fn share(&self, evidence: &Evidence, is_so: impl Fn(&Sight, &Pixel) -> bool) -> f32 {
        let members = self.members.iter().filter(|member| {
            let (sight, pixel) = evidence.pixel(member);
            is_so(sight, pixel)
        });
        members.count() as f32 / self.members.len() as f32
    }

    /// Its pixels of each view apart.
    pub(crate) fn views_apart(&self) -> impl Iterator<Item = Self> {
        let of_view = |(_, members): (usize, &[(u32, u32)])| Self {
            members: members.to_vec(),
            levels: self.levels.clone(),
            ..Self::default()
        };
        self.by_view().map(of_view)
    }

    /// Its pixels in each region of the view that shows it in most regions of enough pixels, if
    /// these are several; of two such views in that with more pixels.
    pub(crate) fn in_most_regions(&self, evidence: &Evidence) -> Option<Vec<Self>> {
        let of_view = |view: Self| -> Vec<Self> {
            let members = view.members.iter();
            let of = members.map(|member| evidence.pixel(member).1.region as usize);
            let of: Vec<usize> = of.collect();
            let num = of.iter().max().map_or(0, |last| last + 1);
            let mut regions = view.divided(&of, num);
            regions.retain(Self::is_enough);
            regions
        };
        let num_pixels = |regions: &[Self]| regions.iter().map(|r| r.members.len()).sum::<usize>();
        let views = self.views_apart().map(of_view);
        let most = views.max_by_key(|regions| (regions.len(), num_pixels(regions)));
        most.filter(|regions| regions.len() > 1)
    }

    /// Takes in the pixels of another part of the lamp.
    pub(crate) fn join(&mut self, other: Self) {
        self.members.extend(other.members);
        self.points.extend(other.points);
        self.bounds.join(&other.bounds);
        for (light, level) in other.levels {
            self.learn(light, level);
        }
        self.thin();
    }

    /// The numbers of its pixels in the `num` views that show most of them.
    pub(crate) fn best_views(&self, num: usize) -> Vec<(usize, HashSet<u32>)> {
        let mut views: Vec<(usize, &[(u32, u32)])> = self.by_view().collect();
        views.sort_by_key(|(view, members)| (Reverse(members.len()), *view));
        let numbers = |members: &[(u32, u32)]| members.iter().map(|member| member.1).collect();
        (views.into_iter().take(num))
            .map(|(view, members)| (view, numbers(members)))
            .collect()
    }

    /// Whether a point may be the lamp's by its radiance.
    pub(crate) fn may_have(&self, point: &Point) -> bool {
        let level = self.levels.get(&point.light);
        level.is_none_or(|level| level.may_have(point.radiance, point.is_whole))
    }

    /// Has the radiance of a region in a light where that says more than its own.
    pub(crate) fn learn(&mut self, light: usize, level: Level) {
        let own = self.levels.entry(light).or_default();
        let brighter = level.radiance.max_element() > own.radiance.max_element();
        if !own.is_known && (level.is_known || brighter) {
            *own = level;
        }
    }

    /// Whether a light shows two lamps to be other ones by their radiance.
    pub(crate) fn is_unlike(&self, other: &Self) -> bool {
        let unlike = |(light, level): (&usize, &Level)| {
            let other = other.levels.get(light);
            other.is_some_and(|other| level.is_unlike(other))
        };
        self.levels.iter().any(unlike)
    }

    /// Its radiance in a light that it shines in.
    pub(crate) fn level(&self, light: usize) -> Level {
        self.levels.get(&light).copied().unwrap_or_default()
    }

    /// Distance of a point to its nearest one, in that up to which they are at one place; infinite
    /// where it is more and the bounds tell.
    pub(crate) fn distance(&self, point: &Point) -> f32 {
        let relative = |distance: f32, width: f32| distance / (NEAR_PIXELS * (width + point.width));
        if relative(self.bounds.distance(point.position), self.bounds.width) > 1.0 {
            return f32::INFINITY;
        }
        (self.points.iter())
            .map(|own| relative(own.position.distance(point.position), own.width))
            .fold(f32::INFINITY, f32::min)
    }

    pub(crate) fn add(&mut self, view: usize, pixel: usize, point: Point) {
        self.members.push((view as u32, pixel as u32));
        self.bounds.add(&point);
        self.points.push(point);
    }

    /// Keeps evenly chosen points of many.
    pub(crate) fn thin(&mut self) {
        let step = self.points.len().div_ceil(MAX_POINTS).max(1);
        self.points = self.points.iter().copied().step_by(step).collect();
    }

    /// Share of its points that are near those of `other`.
    pub(crate) fn share_near(&self, other: &Self) -> f32 {
        let near = (self.points.iter()).filter(|point| other.distance(point) <= 1.0);
        near.count() as f32 / self.points.len() as f32
    }
}

/// A box around points, and the largest width of their pixels.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
    width: f32,
}

impl Default for Bounds {
    /// Those of no points.
    fn default() -> Self {
        Self {
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            width: 0.0,
        }
    }
}

impl Bounds {
    fn add(&mut self, point: &Point) {
        self.join(&Self {
            low: point.position,
            high: point.position,
            width: point.width,
        });
    }

    fn join(&mut self, other: &Self) {
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
        self.width = self.width.max(other.width);
    }

    /// Distance of a place to the box, at most that to each point, to the bit; infinite where there
    /// are none.
    fn distance(&self, place: Vec3) -> f32 {
        let outside = (self.low - place).max(place - self.high).max(Vec3::ZERO);
        outside.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};

    /// Points of pixels in a cloud of a size, and whether they are near one of others is told by all
    /// of these in turn.
    #[test]
    fn bounds_do_not_change_what_is_near() {
        let key = RandomKey::new(5, Purpose::Initialise, 0);
        let point = |i: u32, size: f32| {
            let [x, y, z, width] = key.stream(i, 0).next_uniforms();
            Point {
                position: size * (Vec3::new(x, y, z) - 0.5),
                width: 0.02 * width,
                light: 0,
                radiance: Vec3::ONE,
                is_whole: true,
            }
        };
        let mut group = Group::default();
        (0..40).for_each(|i| group.add(0, i as usize, point(i, 0.5)));
        let mut num_near = 0;
        for other in (100..3100).map(|i| point(i, 0.8)) {
            let of = |own: &Point| {
                own.position.distance(other.position) / (NEAR_PIXELS * (own.width + other.width))
            };
            let nearest = group.points.iter().map(of).fold(f32::INFINITY, f32::min);
            let told = group.distance(&other);
            assert!(told == nearest || (told.is_infinite() && nearest > 1.0));
            num_near += usize::from(nearest <= 1.0);
        }
        assert!((50..2900).contains(&num_near), "{num_near}");
        assert!(Group::default().distance(&point(0, 1.0)).is_infinite());
    }
}
