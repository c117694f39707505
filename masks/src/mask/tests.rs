use super::*;

pub(crate) fn mask(rows: &[&str]) -> Mask {
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
    let [mut with_sure, none, sure] = [
        tidied.clone(),
        Mask::empty(10, 3),
        mask(&["..........", ".........#", ".........."]),
    ];
    tidied.tidy(&options, &none);
    assert_eq!(tidied, mask(&["######....", "######....", "######...."]));
    with_sure.tidy(&options, &sure);
    assert_eq!(with_sure, mask(&["######....", "######...#", "######...."]));
}

#[test]
fn growing_adds_a_rim() {
    let mut grown = mask(&[".....", ".....", "..#..", ".....", "....."]);
    let options = MaskOptions {
        min_pixels: 0,
        grow_radius: 1,
        ..MaskOptions::default()
    };
    grown.tidy(&options, &Mask::empty(5, 5));
    assert_eq!(grown, mask(&[".....", "..#..", ".###.", "..#..", "....."]));
}
