use super::*;

fn mask(rows: &[&str]) -> Mask {
    Mask::from_fn(rows[0].len() as u32, rows.len() as u32, |x, y| {
        rows[y as usize].as_bytes()[x as usize] == b'#'
    })
}

#[test]
fn regions_touch_at_corners_and_come_in_order() {
    let regions = mask(&["#..#", ".#..", "...#"]).regions();
    let pixels: Vec<_> = regions.into_iter().map(|r| r.pixels).collect();
    assert_eq!(pixels, [vec![[0, 0], [1, 1]], vec![[3, 0]], vec![[3, 2]]]);
}

#[test]
fn the_centre_is_among_pixel_centres() {
    let region = Region {
        pixels: vec![[0, 0], [1, 0], [0, 1], [1, 1]],
    };
    assert_eq!(region.centre(), [1.0, 1.0]);
}

#[test]
fn labels_are_added_and_reflections_subtracted() {
    let mut sum = mask(&["##.."]);
    sum.add(&mask(&[".##."]));
    assert_eq!(sum, mask(&["###."]));
    sum.subtract(&mask(&["#..#"]));
    assert_eq!(sum, mask(&[".##."]));
    assert_eq!(sum.count(), 2);
    assert_eq!(sum.coverage(), 0.5);
    assert_eq!(sum.image().values(), [0.0, 1.0, 1.0, 0.0]);
}

#[test]
fn small_regions_go_and_gaps_close_also_at_the_edge() {
    let options = MaskOptions {
        closing_radius: 1,
        min_pixels: 3,
        ..MaskOptions::default()
    };
    let mut tidied = mask(&["##..##....", "##..##...#", "##..##...."]);
    tidied.tidy(&options);
    assert_eq!(tidied, mask(&["######....", "######....", "######...."]));
}

#[test]
fn growing_adds_a_rim() {
    let mut grown = mask(&[".....", ".....", "..#..", ".....", "....."]);
    grown.tidy(&MaskOptions {
        min_pixels: 0,
        grow_radius: 1,
        ..MaskOptions::default()
    });
    assert_eq!(grown, mask(&[".....", "..#..", ".###.", "..#..", "....."]));
}

/// A lamp of 10 that covers half and more of some pixels of its border, less of others, on a
/// wall of 0.5.
#[test]
fn border_pixels_belong_to_what_covers_most_of_them() {
    // Shares of 0.16, 1, 1, 0.58.
    let row = [0.5, 2.0, 10.0, 10.0, 6.0, 0.5];
    let values =
        Image::from_pixels(6, 3, [row; 3].as_flattened().iter().map(|&v| [v]).collect()).unwrap();
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
