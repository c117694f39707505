//! Masks by thresholding: what is at least as bright as a level, and where its borders are.

use crate::halo;
use crate::mask::Mask;
use crate::options::Border;
use eagpt_scene::Image;

/// Reach of the search for a lamp from its border, pixels: as far as demosaicing and optics spread
/// an edge.
const BORDER_REACH: u32 = 2;
/// Least share of lamp in a border pixel.
const BORDER_SHARE: f32 = 0.5;

/// Pixels whose value is at least `level`, but those that lamps light ([`halo`]); with
/// [`Border::Half`], the border of each lamp is where pixels are half lamp and half surroundings.
pub(crate) fn at_least(values: &Image<1>, level: f32, border: Border) -> Mask {
    let (width, height) = values.size();
    let value = |x: u32, y: u32| values.get(x, y)[0];
    let mut mask = Mask::from_fn(width, height, |x, y| value(x, y) >= level);
    halo::remove(&mut mask, values);
    if border == Border::Full {
        return mask;
    }
    Mask::from_fn(width, height, |x, y| {
        let is_bright = mask.has(x, y);
        // A pixel that is half a dim lamp may be below the level.
        if !is_bright && !mask.around([x, y], 1).any(|[x, y]| mask.has(x, y)) {
            return false;
        }
        if mask
            .around([x, y], BORDER_REACH)
            .all(|[x, y]| mask.has(x, y))
        {
            return true;
        }
        let (mut lamp, mut beside) = (0.0_f32, f32::INFINITY);
        for [x, y] in mask.around([x, y], BORDER_REACH) {
            lamp = lamp.max(value(x, y));
            if !mask.has(x, y) {
                beside = beside.min(value(x, y));
            }
        }
        value(x, y) >= beside + BORDER_SHARE * (lamp - beside)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::tests::mask;

    /// A lamp of 10 that covers half and more of some pixels of its border, less of others, on a
    /// wall of 0.5.
    #[test]
    fn border_pixels_belong_to_what_covers_most_of_them() {
        // Shares of 0.16, 1, 1, 0.58.
        let row = [0.5, 2.0, 10.0, 10.0, 6.0, 0.5];
        let values =
            Image::from_pixels(6, 3, [row; 3].as_flattened().iter().map(|&v| [v]).collect())
                .unwrap();
        let half = at_least(&values, 1.0, Border::Half);
        assert_eq!(half, mask(&["..###.", "..###.", "..###."]));
        let full = at_least(&values, 1.0, Border::Full);
        assert_eq!(full, mask(&[".####.", ".####.", ".####."]));
    }

    /// Half of a lamp of 10 beside a wall of 3 is 6.5; of a lamp of 4 beside black it is 2, below
    /// the level.
    #[test]
    fn a_border_lies_halfway_between_lamp_and_wall() {
        let image = |row: [f32; 6]| {
            let pixels = [row; 3].as_flattened().iter().map(|&v| [v]).collect();
            Image::from_pixels(6, 3, pixels).unwrap()
        };
        let beside_wall = at_least(&image([3.0, 3.0, 6.0, 10.0, 10.0, 10.0]), 5.0, Border::Half);
        assert_eq!(beside_wall, mask(&["...###", "...###", "...###"]));
        let beside_black = at_least(&image([0.0, 0.0, 2.1, 4.0, 4.0, 4.0]), 3.0, Border::Half);
        assert_eq!(beside_black, mask(&["..####", "..####", "..####"]));
    }

    /// Shading inside of a lamp is not a border.
    #[test]
    fn the_inside_of_a_lamp_stays() {
        let values = Image::from_pixels(
            9,
            9,
            (0..81)
                .map(|i| [if i == 40 { 100.0 } else { 10.0 }])
                .collect(),
        )
        .unwrap();
        assert_eq!(at_least(&values, 1.0, Border::Half).count(), 81);
    }
}
