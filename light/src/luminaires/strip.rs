//! Strips of light in coves: bulbs in a level row of hidden places, of which one explains little.

use super::bulb::Found;
use super::gain::Gain;
use super::places::{HALF, NEAR, Places};
use eagpt_trace::{Features, Ray, TraceError, Tracer};
use glam::{Vec2, Vec3};

/// Gain of a place of a strip, in that of its best place, at least.
const LEAST_GAIN: f64 = 0.2;
/// Half the width of a strip, at most, in the spacing of places.
const HALF_WIDTH: f32 = 1.5;
/// Share of a strip that lies on something, at least.
const LEAST_ON: f32 = 0.75;
/// Length of a strip, at least, and gaps in it, at most, in the reach of what hides a bulb: shorter
/// ones are bulbs.
const LEAST_LENGTH: f32 = 3.0;
const MOST_GAP: f32 = 6.0;

/// The strip on which the place of `best` is, if hidden places of some gain are in a row and most
/// of that lies on something; `up` is the unit vector upwards. Its positions are spaced as places.
///
/// # Errors
/// If the device fails.
pub(super) fn through(
    (tracer, places, gains): (&dyn Tracer, &Places, &[Gain]),
    best: &Gain,
    up: Vec3,
) -> Result<Option<Found>, TraceError> {
    let Some(positions) = row((places, gains), best, up) else {
        return Ok(None);
    };
    let (cones, behind) = match best.cones {
        [above, below] if above >= below => ([HALF, 0], -up),
        _ => ([0, HALF], up),
    };
    let ray = |at: &Vec3| Ray::free(at.to_array(), behind.to_array());
    let rays: Vec<Ray> = positions.iter().map(ray).collect();
    let lies = |met: &&Features| met.alpha() >= 0.5 && met.mean_distance() <= NEAR * places.reach;
    let num_on = tracer.trace_rays(&rays)?.iter().filter(lies).count();
    let is_strip = num_on as f32 >= LEAST_ON * positions.len() as f32;
    Ok(is_strip.then_some(Found {
        positions,
        is_strip,
        cones,
    }))
}

/// The row of hidden places of some gain that the place of `best` is in.
fn row((places, gains): (&Places, &[Gain]), best: &Gain, up: Vec3) -> Option<Vec<Vec3>> {
    let spacing = places.spacing();
    let [centre] = places.all[best.number].positions[..] else {
        return None;
    };
    let level = |of: &Vec3| (*of - centre).dot(up).abs() < 0.5 * spacing;
    let is_good = |of: &&Gain| of.gain >= LEAST_GAIN * best.gain;
    let good = gains.iter().filter(is_good);
    let good = good.map(|of| places.all[of.number].positions.as_slice());
    let single = good.filter_map(|of| if let [at] = of { Some(*at) } else { None });
    let (across, along) = up.any_orthonormal_pair();
    let flat = |of: Vec3| Vec2::new((of - centre).dot(across), (of - centre).dot(along));
    let row: Vec<Vec2> = single.filter(level).map(flat).collect();
    let is_on = |axis: Vec2| move |of: &&Vec2| of.perp_dot(axis).abs() <= HALF_WIDTH * spacing;
    let axes = row.iter().filter_map(|of| of.try_normalize());
    let axis = axes.max_by_key(|axis| row.iter().filter(is_on(*axis)).count())?;
    let mut row: Vec<f32> = row
        .iter()
        .filter(is_on(axis))
        .map(|of| of.dot(axis))
        .collect();
    row.sort_unstable_by(f32::total_cmp);
    let most = MOST_GAP * places.reach;
    let end = |row: &mut dyn Iterator<Item = f32>| {
        row.fold(
            0.0,
            |end: f32, at| if (at - end).abs() <= most { at } else { end },
        )
    };
    let first = end(&mut row.iter().copied().filter(|at| *at <= 0.0).rev());
    let last = end(&mut row.iter().copied().filter(|at| *at >= 0.0));
    if last - first < LEAST_LENGTH * places.reach {
        return None;
    }
    let num = ((last - first) / spacing).round() as usize;
    let place = |k: usize| {
        let at = axis * (first + (last - first) * k as f32 / num as f32);
        centre + at.x * across + at.y * along
    };
    Some((0..=num).map(place).collect())
}

#[cfg(test)]
mod tests {
    use super::super::bulb::black;
    use super::super::places::Place;
    use super::*;
    use eagpt_scene::Gaussians;
    use eagpt_scene::discs::Solid;
    use eagpt_trace::Device;

    /// The row through the first of places at `positions`, on a shelf of this length at z = 0.
    fn found(positions: &[Vec3], length: f32) -> Option<Vec<Vec3>> {
        let shelf = Solid::Quad {
            centre: Vec3::ZERO,
            edges: [length * Vec3::X, 0.2 * Vec3::Y],
        };
        let shelf: Gaussians = black(shelf, None, Some(0.02)).discs();
        let place = |position: &Vec3| Place {
            positions: vec![*position],
            is_behind_lamp: false,
            open: [HALF; 2],
        };
        let places = Places {
            all: positions.iter().map(place).collect(),
            reach: 0.25,
        };
        let gain = |number: usize| Gain {
            number,
            gain: if number == 0 { 1.0 } else { 0.5 },
            cones: [HALF, 0],
        };
        let gains: Vec<Gain> = (0..positions.len()).map(gain).collect();
        let tracer = Device::Cpu.scene(&shelf).unwrap();
        let found = through((&*tracer, &places, &gains), &gains[0], Vec3::Z).unwrap();
        found.map(|found| {
            assert_eq!(found.cones, [HALF, 0]);
            found.positions
        })
    }

    #[test]
    fn hidden_places_in_a_row_on_a_ledge_are_a_strip() {
        let at = |x: f32| Vec3::new(x, 0.02, 0.05);
        let row: Vec<Vec3> = [0.3, 0.4, 0.5, -0.6, -0.7, -0.8].map(at).to_vec();
        let strip = found(&row, 3.0).unwrap();
        assert!(strip[0].distance(at(-0.8)).min(strip[0].distance(at(0.5))) < 1e-3);
        assert!((strip[0].distance(strip[strip.len() - 1]) - 1.3).abs() < 1e-3);
        // Two luminaires with air between them, and one alone.
        assert_eq!(found(&row, 0.4), None);
        assert_eq!(found(&row[..3], 3.0), None);
    }
}
