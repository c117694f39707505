//! Which lit pixels of which views are one lamp's.
//!
//! A lit pixel is a point where the trained scene has it. Regions of lit pixels are taken view by
//! view, those that show most detail first: a region whose points are where those of a lamp are
//! belongs to it if it may have its radiance; one that covers several lamps, which run into each
//! other from afar, is divided among them; any other is a new lamp.

use crate::evidence::level::Level;
use crate::evidence::{Evidence, Lit, Sight};
use crate::group::{Group, MAX_POINTS, Point};
use eagpt_scene::median::median_of;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Share of a region's pixels that have to be near lamps for it to show these.
const SHARE_KNOWN: f32 = 0.4;
/// Share of the pixels of the smaller of two lamps that have to be near the other for both to be
/// one, divided by something in front of it.
const SHARE_ADJACENT: f32 = 0.3;

/// A 2-D region of lit pixels.
struct LitRegion {
    view: usize,
    level: Level,
    /// Numbers of its pixels, and where they are.
    points: Vec<(usize, Point)>,
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
        // A dim region is of no bulb, though pixels that it shares with others may be.
        let may_be = |lamp: &usize| !groups[*lamp].level(light).is_unlike(&level);
        let nearest = |point: &Point, of: &[usize]| -> Option<usize> {
            let of = of.iter().filter(|&&lamp| groups[lamp].may_have(point));
            let distances = of.map(|&lamp| (lamp, groups[lamp].distance(point)));
            let (lamp, distance) = distances.min_by(|a, b| a.1.total_cmp(&b.1))?;
            (distance <= 1.0).then_some(lamp)
        };
        // Some points say which lamps a region shows.
        let possible: Vec<usize> = (0..groups.len()).filter(may_be).collect();
        let some = points.iter().step_by(points.len().div_ceil(MAX_POINTS));
        let known: Vec<Option<usize>> = some
            .collect::<Vec<_>>()
            .par_iter()
            .map(|(_, point)| nearest(point, &possible))
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
    let mut shown: Vec<Details> = groups.iter().map(|of| details(evidence, of)).collect();
    let mut first = 0;
    while first < groups.len() {
        let other = (first + 1..groups.len()).find(|&other| {
            let (a, b) = (&groups[first], &groups[other]);
            let are_connected = || are_connected(&shown[first], &shown[other]);
            let (small, large) = if a.points.len() <= b.points.len() {
                (a, b)
            } else {
                (b, a)
            };
            let are_one = || small.share_near(large) >= SHARE_ADJACENT || are_connected();
            !a.is_unlike(b) && are_one()
        });
        match other {
            Some(other) => {
                let more = groups.remove(other);
                groups[first].join(more);
                shown.remove(other);
                shown[first] = details(evidence, &groups[first]);
            }
            None => first += 1,
        }
    }
    for group in &mut groups {
        group.members.sort_unstable();
    }
    groups
}

/// By view, the regions that show a lamp, and the width of the narrowest pixel there.
type Details = BTreeMap<u32, (BTreeSet<u32>, f32)>;

fn details(evidence: &Evidence, group: &Group) -> Details {
    let mut views = Details::new();
    for member in &group.members {
        let (sight, pixel) = evidence.pixel(member);
        let (regions, width) = views
            .entry(member.0)
            .or_insert((BTreeSet::new(), f32::INFINITY));
        regions.insert(pixel.region);
        *width = width.min(sight.width(pixel));
    }
    views
}

/// Whether the view that shows most detail of both shows them in one region.
fn are_connected(a: &Details, b: &Details) -> bool {
    let (mut together, mut apart) = (f32::INFINITY, f32::INFINITY);
    for (view, (regions, width)) in a {
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
