//! Which lit pixels of which views are one lamp's.
//!
//! A lit pixel is a point where the trained scene has it. Regions of lit pixels are taken view by
//! view, those that show most detail first: a region whose points are where those of a lamp are
//! belongs to it if it may have its radiance; one that covers several lamps, which run into each
//! other from afar, is divided among them; any other is a new lamp.

use crate::evidence::{Evidence, Level, Lit, Sight, are_unlike, is_other_hue};
use crate::shape::Shape;
use eagpt_scene::median::median_of;
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// Points are at one place if they are nearer than this many widths of their pixels.
const NEAR_PIXELS: f32 = 2.0;
/// Share of a region's pixels that have to be near lamps for it to show these.
const SHARE_KNOWN: f32 = 0.4;
/// Share of the pixels of the smaller of two lamps that have to be near the other for both to be
/// one, divided by something in front of it.
const SHARE_ADJACENT: f32 = 0.3;
/// Points of a lamp that others are compared with.
const MAX_POINTS: usize = 600;

/// The pixels of a lamp.
#[derive(Debug, Clone, Default)]
pub(crate) struct Group {
    /// Numbers of views and of their pixels, ascending in the end.
    pub(crate) members: Vec<(u32, u32)>,
    points: Vec<Point>,
    /// Its radiance in each light, as the view with most detail has it of those that know it.
    levels: BTreeMap<usize, Level>,
}

/// A lit pixel in space.
#[derive(Debug, Clone, Copy)]
struct Point {
    position: Vec3,
    /// Width of its pixel there.
    width: f32,
    light: usize,
    /// Radiance of the pixel, …
    radiance: Vec3,
    /// … and whether it is that of a lamp alone.
    is_whole: bool,
}

/// A 2-D region of lit pixels.
struct LitRegion {
    view: usize,
    level: Level,
    /// Numbers of its pixels, and where they are.
    points: Vec<(usize, Point)>,
}

impl Group {
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
                points: Vec::new(),
                levels: self.levels.clone(),
            }
        };
        (0..num).map(part).collect()
    }

    /// Share of its pixels whose rays meet any of `shapes`.
    pub(crate) fn share_on(&self, evidence: &Evidence, shapes: &[Shape]) -> f32 {
        let meets = |member: &&(u32, u32)| {
            let (sight, pixel) = evidence.pixel(member);
            let mut shapes = shapes.iter();
            shapes.any(|shape| shape.meet(sight.origin(), pixel.direction).is_some())
        };
        self.members.iter().filter(meets).count() as f32 / self.members.len() as f32
    }

    /// Its pixels of each view apart.
    pub(crate) fn views_apart(&self) -> impl Iterator<Item = Self> {
        let of_view = |(_, members): (usize, &[(u32, u32)])| Self {
            members: members.to_vec(),
            points: Vec::new(),
            levels: self.levels.clone(),
        };
        self.by_view().map(of_view)
    }

    /// Takes in the pixels of another part of the lamp.
    pub(crate) fn join(&mut self, other: Self) {
        self.members.extend(other.members);
        self.points.extend(other.points);
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

    /// Whether a point may be the lamp's by its radiance: a pixel that something dark has a part of
    /// is darker in all channels alike.
    fn may_have(&self, point: &Point) -> bool {
        let level = self.levels.get(&point.light).filter(|level| level.is_known);
        level.is_none_or(|Level { radiance: own, .. }| {
            if point.is_whole {
                !are_unlike(point.radiance, *own)
            } else {
                !is_other_hue(point.radiance, *own)
            }
        })
    }

    /// Has the radiance of a region in a light where that says more than its own.
    fn learn(&mut self, light: usize, level: Level) {
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

    fn distance(&self, point: &Point) -> f32 {
        let relative = |own: &Point| {
            own.position.distance(point.position) / (NEAR_PIXELS * (own.width + point.width))
        };
        self.points
            .iter()
            .map(relative)
            .fold(f32::INFINITY, f32::min)
    }

    fn add(&mut self, view: usize, pixel: usize, point: Point) {
        self.members.push((view as u32, pixel as u32));
        self.points.push(point);
    }

    /// Keeps evenly chosen points of many.
    fn thin(&mut self) {
        let step = self.points.len().div_ceil(MAX_POINTS).max(1);
        self.points = self.points.iter().copied().step_by(step).collect();
    }

    /// Share of its points that are near those of `other`.
    fn share_near(&self, other: &Self) -> f32 {
        let near = (self.points.iter()).filter(|point| other.distance(point) <= 1.0);
        near.count() as f32 / self.points.len() as f32
    }
}

/// The lamps that the views show.
pub(crate) fn group(evidence: &Evidence) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for region in by_detail(evidence) {
        let LitRegion {
            view,
            level,
            points,
        } = region;
        let light = evidence.sights[view].light;
        let nearest = |point: &Point, of: &[usize]| -> Option<usize> {
            let of = of.iter().filter(|&&lamp| groups[lamp].may_have(point));
            let distances = of.map(|&lamp| (lamp, groups[lamp].distance(point)));
            let (lamp, distance) = distances.min_by(|a, b| a.1.total_cmp(&b.1))?;
            (distance <= 1.0).then_some(lamp)
        };
        // Some points say which lamps a region shows.
        let all: Vec<usize> = (0..groups.len()).collect();
        let some = points.iter().step_by(points.len().div_ceil(MAX_POINTS));
        let known: Vec<Option<usize>> = some
            .collect::<Vec<_>>()
            .par_iter()
            .map(|(_, point)| nearest(point, &all))
            .collect();
        let num_known = known.iter().flatten().count();
        if (num_known as f32) < SHARE_KNOWN * known.len() as f32 {
            let mut new = Group::default();
            new.learn(light, level);
            for (pixel, point) in &points {
                new.add(view, *pixel, *point);
            }
            new.thin();
            groups.push(new);
            continue;
        }
        let most = most_frequent(known.iter().flatten().copied());
        let shown: Vec<usize> = known
            .into_iter()
            .flatten()
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        let lamps: Vec<usize> = if shown.len() == 1 {
            vec![most; points.len()]
        } else {
            let of_point = |(_, point): &(usize, Point)| nearest(point, &shown).unwrap_or(most);
            points.par_iter().map(of_point).collect()
        };
        for ((pixel, point), lamp) in points.iter().zip(lamps) {
            groups[lamp].add(view, *pixel, *point);
        }
        if let [lamp] = shown.as_slice() {
            groups[*lamp].learn(light, level);
        }
        groups.iter_mut().for_each(Group::thin);
    }
    merged(evidence, groups)
}

/// All regions that the scene has anything of, those with the narrowest pixels first.
fn by_detail(evidence: &Evidence) -> Vec<LitRegion> {
    let regions = evidence.sights.iter().enumerate().flat_map(regions_of);
    let mut order: Vec<(f32, LitRegion)> = regions
        .filter(|region| !region.points.is_empty())
        .map(|region| {
            let width = median_of(region.points.iter().map(|(_, point)| point.width));
            (width, region)
        })
        .collect();
    // Of equally narrow ones in the order of views, and of each in its own.
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.into_iter().map(|(_, region)| region).collect()
}

fn regions_of((view, sight): (usize, &Sight)) -> Vec<LitRegion> {
    let mut regions: Vec<LitRegion> = (sight.levels.iter())
        .map(|level| LitRegion {
            view,
            level: *level,
            points: Vec::new(),
        })
        .collect();
    for (i, pixel) in sight.pixels.iter().enumerate() {
        if pixel.lit.is_lit() && pixel.distance.is_finite() {
            let point = Point {
                position: sight.position(pixel),
                width: sight.width(pixel),
                light: sight.light,
                radiance: pixel.radiance,
                is_whole: pixel.lit == Lit::Inside && sight.level(pixel).is_known,
            };
            regions[pixel.region as usize].points.push((i, point));
        }
    }
    regions
}

fn most_frequent(values: impl Iterator<Item = usize>) -> usize {
    let mut counts = BTreeMap::new();
    for value in values {
        *counts.entry(value).or_insert(0_usize) += 1;
    }
    (counts.into_iter())
        .max_by_key(|&(value, count)| (count, std::cmp::Reverse(value)))
        .map_or(0, |(value, _)| value)
}

/// Makes one of lamps that views show to be: that are near each other along an edge, or that a view
/// shows in one region unless another one shows them apart with more detail.
fn merged(evidence: &Evidence, mut groups: Vec<Group>) -> Vec<Group> {
    let mut first = 0;
    while first < groups.len() {
        let other = (first + 1..groups.len()).find(|&other| {
            let (a, b) = (&groups[first], &groups[other]);
            let (small, large) = if a.points.len() <= b.points.len() {
                (a, b)
            } else {
                (b, a)
            };
            let are_one =
                || small.share_near(large) >= SHARE_ADJACENT || are_connected(evidence, a, b);
            !a.is_unlike(b) && are_one()
        });
        match other {
            Some(other) => {
                let more = groups.remove(other);
                groups[first].join(more);
            }
            None => first += 1,
        }
    }
    for group in &mut groups {
        group.members.sort_unstable();
    }
    groups
}

/// Whether the view that shows most detail of both shows them in one region.
fn are_connected(evidence: &Evidence, a: &Group, b: &Group) -> bool {
    let (mut together, mut apart) = (f32::INFINITY, f32::INFINITY);
    let of_views = |group: &Group| {
        let mut views: BTreeMap<u32, (BTreeSet<u32>, f32)> = BTreeMap::new();
        for member in &group.members {
            let (sight, pixel) = evidence.pixel(member);
            let (regions, width) = views
                .entry(member.0)
                .or_insert((BTreeSet::new(), f32::INFINITY));
            regions.insert(pixel.region);
            *width = width.min(sight.width(pixel));
        }
        views
    };
    let (a, b) = (of_views(a), of_views(b));
    for (view, (regions, width)) in &a {
        if let Some((others, other_width)) = b.get(view) {
            let width = width.min(*other_width);
            let value = if regions.is_disjoint(others) {
                &mut apart
            } else {
                &mut together
            };
            *value = value.min(width);
        }
    }
    together.is_finite() && together <= apart
}
