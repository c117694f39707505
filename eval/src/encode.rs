//! Images in the display encodings in which metrics are defined.

use eagpt_scene::{Image, color};
use rayon::prelude::*;

/// sRGB encoding of linear light, clipped to [0, 1]: what a display shows.
pub fn srgb_clipped(linear: &Image<3>) -> Image<3> {
    encoded(linear, |value| {
        color::srgb_from_linear(value.clamp(0.0, 1.0)).min(1.0)
    })
}

/// PQ encoding of linear light where 1.0 is 100 nit; not clipped above.
pub fn pq_encoded(linear: &Image<3>) -> Image<3> {
    encoded(linear, color::pq_from_linear)
}

fn encoded(linear: &Image<3>, encode: impl Fn(f32) -> f32 + Sync) -> Image<3> {
    let mut image = linear.clone();
    image
        .pixels_mut()
        .par_iter_mut()
        .for_each(|pixel| *pixel = pixel.map(&encode));
    image
}

/// Checks that two images are comparable.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub(crate) fn assert_comparable<const A: usize, const B: usize>(
    reference: &Image<A>,
    test: &Image<B>,
) {
    assert_eq!(
        reference.size(),
        test.size(),
        "images of different sizes cannot be compared"
    );
    assert!(
        reference.width() > 0 && reference.height() > 0,
        "images without pixels cannot be compared"
    );
}
