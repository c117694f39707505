//! Bulbs in shades: views from the side show the lower part of a ball, and those from below most of
//! it. What they show is a cap, a cone or a disc, which sends a fraction of the light of the bulb;
//! where the scene has a shade before the rest, silhouettes say nothing of it, and the edge of the
//! part that is not hidden tells how large the ball is.

use crate::fit::shape_search::{BETTER, Fit, refined_again};
use crate::pixels::patches::Patch;
use crate::pixels::silhouette::Gaps;
use crate::shape::Shape;
use glam::Vec3;

/// Residual up to which a shape explains what views show, and needs no shade.
pub(super) const EXPLAINED: f32 = 0.06;
/// Share of the ball that one view shows, at least. Of any lamp a ball of which less is seen
/// explains the silhouettes, if it is large enough: of bulbs in shades a view shows .67 or more, of
/// the ball that has a bent neon tube at its edge .03.
const MIN_SHOWN: f32 = 0.3;

/// The ball in a shade that explains what `patches` show far better than a shape of this
/// `residual`, if there is one about `centre`.
pub(crate) fn fit(centre: Vec3, radius: f32, patches: &[Patch], residual: f32) -> Option<Fit> {
    if residual <= EXPLAINED {
        return None;
    }
    let ball = partly_hidden(centre, radius, patches, MIN_SHOWN)?;
    (ball.residual <= BETTER * residual).then_some(ball)
}

/// The ball about `centre` that explains what `patches` show where the scene does not hide it, if
/// one of them shows this share of it.
pub(super) fn partly_hidden(
    centre: Vec3,
    radius: f32,
    patches: &[Patch],
    min_shown: f32,
) -> Option<Fit> {
    let start = Shape::Ball { centre, radius };
    let ball = refined_again(&start, true, patches, Gaps::Shade);
    let shown = patches.iter().map(|patch| patch.share_shown(&ball.shape));
    (shown.reduce(f32::max) >= Some(min_shown)).then_some(ball)
}
