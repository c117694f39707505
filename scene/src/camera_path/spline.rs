//! Cubic curves through points at given parameters, with one tangent rule for positions and for
//! rotations.

use glam::DVec3;

/// Exponent of the distance between neighbours that makes a parameter interval: 1/2 is the
/// centripetal parametrisation of Yuksel et al. 2011, which has neither cusps nor loops within a
/// segment.
const CENTRIPETAL: f64 = 0.5;
/// Shortest distance that counts, relative to the longest: neighbours at one place still are a
/// parameter apart.
const MIN_DISTANCE: f64 = 1e-6;

/// Parameter intervals of the segments between neighbours that are so far from each other.
pub(super) fn centripetal_intervals(distances: &[f64]) -> Vec<f64> {
    let longest = distances.iter().copied().fold(0.0, f64::max);
    let least = if longest > 0.0 {
        MIN_DISTANCE * longest
    } else {
        1.0
    };
    let intervals = distances.iter().map(|d| d.max(least).powf(CENTRIPETAL));
    intervals.collect()
}

/// Velocities at the points of a curve, given the steps from each point to the next and the
/// parameters they take: those of Catmull-Rom for uneven parameters (the slope of the parabola
/// through a point and its neighbours). An open curve, which has a point more than it has segments,
/// leaves its ends straight on.
pub(super) fn velocities(steps: &[DVec3], intervals: &[f64], closed: bool) -> Vec<DVec3> {
    let num = steps.len();
    let slope = |i: usize| steps[i] / intervals[i];
    let inner = |before: usize, after: usize| {
        let (h, k) = (intervals[before], intervals[after]);
        (slope(before) * k + slope(after) * h) / (h + k)
    };
    if closed {
        return (0..num).map(|i| inner((i + num - 1) % num, i)).collect();
    }
    let mut all = vec![slope(0)];
    all.extend((1..num).map(|i| inner(i - 1, i)));
    all.push(slope(num - 1));
    all
}

/// A cubic segment in Hermite form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Segment {
    pub(super) ends: [DVec3; 2],
    /// Change for the whole segment, if the velocity of each end lasted.
    pub(super) tangents: [DVec3; 2],
}

impl Segment {
    /// The point at `s` from 0 to 1.
    pub(super) fn at(&self, s: f64) -> DVec3 {
        let (r, [a, b], [u, v]) = (1.0 - s, self.ends, self.tangents);
        // Written so that both ends are met to the bit.
        a * (r * r * (1.0 + 2.0 * s)) + b * (s * s * (3.0 - 2.0 * s)) + u * (s * r * r)
            - v * (s * s * r)
    }
}

/// Lengths along a chain of segments, for walking it at a constant speed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lengths {
    /// Length up to each of the points at which the segments were sampled, ascending from 0.
    up_to: Vec<f64>,
}

/// Chords that a segment is measured by; the tests hold the speed of whole flights to 2e-3.
const NUM_CHORDS: usize = 1024;

impl Lengths {
    pub(super) fn of(segments: &[Segment]) -> Self {
        let mut up_to = vec![0.0];
        let mut length = 0.0;
        for segment in segments {
            let mut last = segment.at(0.0);
            for chord in 1..=NUM_CHORDS {
                let next = segment.at(chord as f64 / NUM_CHORDS as f64);
                length += last.distance(next);
                up_to.push(length);
                last = next;
            }
        }
        Self { up_to }
    }

    /// The place at a share of the whole length: segments that are done, plus the parameter in the
    /// next one.
    pub(super) fn place_at(&self, share: f64) -> f64 {
        let num_chords = self.up_to.len() - 1;
        let wanted = share * self.up_to[num_chords];
        let after = self.up_to.partition_point(|&length| length <= wanted);
        let chord = after.clamp(1, num_chords) - 1;
        let (start, end) = (self.up_to[chord], self.up_to[chord + 1]);
        let within = if end > start {
            ((wanted - start) / (end - start)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        (chord as f64 + within) / NUM_CHORDS as f64
    }
}

/// Parameter as a function of time where every segment takes a time of 1: monotone and with a
/// continuous slope (Fritsch and Butland 1984). Returns the place as [`Lengths::place_at`] does.
pub(super) fn place_at_even_times(intervals: &[f64], closed: bool, time: f64) -> f64 {
    let num = intervals.len();
    let index = (time.floor().max(0.0) as usize).min(num - 1);
    let s = time - index as f64;
    // Rates in units of the segment's own interval: the harmonic mean with the neighbour's.
    let own = intervals[index];
    let rate = |neighbour: Option<usize>| match neighbour {
        Some(i) => 2.0 * intervals[i] / (intervals[i] + own),
        None => 1.0,
    };
    let before = match index {
        0 => closed.then_some(num - 1),
        _ => Some(index - 1),
    };
    let after = match index + 1 == num {
        true => closed.then_some(0),
        false => Some(index + 1),
    };
    let (r, a, b) = (1.0 - s, rate(before), rate(after));
    index as f64 + s * s * (3.0 - 2.0 * s) + a * s * r * r - b * s * s * r
}
