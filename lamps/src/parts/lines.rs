//! Points along a line: those of one bar among those of several.

use glam::Vec3;

/// Points of which each two may be a line, about.
const MAX_ENDS: usize = 64;
/// Distance from a line up to which points are of it, in the extent of all.
const NEAR: f32 = 0.05;
/// Share of all points that a line has, at least.
const MIN_SHARE: f32 = 0.25;

/// Which of `points`, together about `extent` large, are of the line that most are near; all of
/// them where no line has many.
pub(crate) fn along_line(points: &[Vec3], extent: f32) -> Vec<bool> {
    let ends: Vec<Vec3> = (points.iter().copied())
        .step_by(points.len().div_ceil(MAX_ENDS).max(1))
        .collect();
    let pairs = (0..ends.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let lines = pairs.filter_map(|(i, j)| Some((ends[i], (ends[j] - ends[i]).try_normalize()?)));
    let is_near = |(start, along): (Vec3, Vec3), point: Vec3| {
        (point - start).reject_from_normalized(along).length() <= NEAR * extent
    };
    let num_near = |line| ends.iter().filter(|end| is_near(line, **end)).count();
    match lines.max_by_key(|line| num_near(*line)) {
        Some(line) if num_near(line) as f32 >= MIN_SHARE * ends.len() as f32 => {
            points.iter().map(|point| is_near(line, *point)).collect()
        }
        _ => vec![true; points.len()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bars of a cross, the second with fewer points, and a heap of which no line has many.
    #[test]
    fn the_longer_of_two_bars_is_found_and_none_in_a_heap() {
        let bar = |num: usize, along: Vec3| {
            (0..num).map(move |i| {
                let (t, wobble) = (i as f32 / num as f32 - 0.5, (i as f32 * 2.4).sin());
                Vec3::new(3.0, -1.0, 2.0) + along * t + Vec3::splat(0.01 * wobble)
            })
        };
        let (long, short) = (Vec3::new(0.8, 0.4, 0.2), Vec3::new(-0.3, 0.6, 0.0));
        let cross: Vec<Vec3> = bar(120, long).chain(bar(80, short)).collect();
        let found = along_line(&cross, 1.0);
        assert!(found[..120].iter().all(|is_near| *is_near));
        // Where they cross both are near both.
        let others = found[120..].iter().filter(|is_near| **is_near).count();
        assert!(others < 20, "{others}");

        let cube: Vec<Vec3> = (0..8_u8)
            .flat_map(|i| {
                let corner = |bit: u8| if i & bit == 0 { 0.0 } else { 1.0 };
                std::iter::repeat_n(Vec3::new(corner(1), corner(2), corner(4)), 8)
            })
            .chain((0..200).map(|i| {
                let t = i as f32;
                Vec3::new((t * 0.618).fract(), (t * 0.755).fract(), (t * 0.57).fract())
            }))
            .collect();
        assert!(along_line(&cube, 1.0).iter().all(|is_near| *is_near));
    }
}
