//! Rooms of tests of hidden light.

use eagpt_scene::Gaussian;
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::start::Surface;

/// The inner surface, in a cube about the origin, of a disc of number `i` on it.
pub(crate) fn in_cube(disc: &Gaussian, i: u32) -> Receiver {
    let place = disc.position;
    let outwards = (place / place.abs().max_element()).trunc();
    let surface = Surface {
        position: place,
        normal: -outwards.normalize(),
        offset: 0.03,
    };
    (i, surface)
}
