//! Lamps that one view shows. What tells how far away they are is the surface around them, as one
//! that does not light it lies in it, or their size, if they are of the make of others.

use crate::evidence::Evidence;
use crate::fit::halo::Beside;
use crate::fit::shape_search::{Fit, ShapeSearch};
use crate::fit::starts::{first_flat, level_normal, mount};
use crate::group::Group;
use crate::group::points::{extent, pixel_width, points};
use crate::pixels::measure;
use crate::pixels::patches::patches;
use crate::pixels::silhouette::Gaps;
use crate::shape::Shape;
use crate::shape::search::{best_place, best_place_in_plane};
use eagpt_scene::median::median_of;
use eagpt_scene::plane::Plane;
use glam::Vec3;

/// Residual beyond which it may be something else.
const MAX_RESIDUAL: f32 = 0.06;
/// Where searches for the place of a lamp by its size begin, in the mean distance of what looks as
/// large: a flat one looks smaller from the side, and edges of pictures cut a part off.
const FARTHER: [f32; 5] = [0.6, 0.8, 1.0, 1.2, 1.4];
/// Distance of a lamp in that of the scene in its pixels, at most: it is not behind a wall.
const BEHIND: f32 = 1.1;

/// The lamp of `group`, flat in the surface around it, if it may be that.
pub(crate) fn fit(evidence: &Evidence, group: &Group) -> Option<Fit> {
    let points = points(evidence, group);
    let (centre, extent) = extent(&points)?;
    let pixel = pixel_width(&points);
    let mount = mount(evidence, group, centre, extent)?;
    let beside = Beside::new(evidence, group, mount);
    if beside.is_lit {
        return None;
    }
    let patches = patches(evidence, group, centre, extent);
    let views = measure::Views::new(evidence, group);
    let search = ShapeSearch::new(&patches, views, group, pixel, Some(beside));
    let flat = first_flat(&points, centre, mount.normal, pixel);
    let starts = [Shape::Rectangle(flat), Shape::Ellipse(flat)].map(|shape| (shape, true));
    let fits = search.best(&starts, starts.len());
    let best = fits.first()?.fit;
    let (view, _) = group.by_view().next()?;
    let shape = in_plane(&best.shape, evidence.sights[view].origin(), mount)?;
    (best.residual <= MAX_RESIDUAL).then_some(Fit { shape, ..best })
}

/// A flat shape as seen from `eye`, in the plane of `mount`: its silhouette is the same at any
/// distance. `None` where it is not flat, or the plane is behind the eye.
fn in_plane(shape: &Shape, eye: Vec3, mount: Plane) -> Option<Shape> {
    let flat = shape.flat()?;
    let factor = mount.height(eye) / (mount.height(eye) - mount.height(flat.centre));
    (factor > 0.0).then(|| shape.farther(eye, factor))
}

/// The lamp of `group` as one of the shape, the size and the pose of one of `models`: in the plane
/// of those on the same mount, or as far away as it looks small; `up` is the unit vector upwards.
pub(crate) fn of_make(
    evidence: &Evidence,
    group: &Group,
    models: &[Shape],
    up: Vec3,
) -> Option<Fit> {
    let (view, members) = group.by_view().next()?;
    let sight = &evidence.sights[view];
    let pixels = || members.iter().map(|m| &sight.pixels[m.1 as usize]);
    let solid_angle: f32 = pixels().map(|p| p.solid_angle).sum();
    let towards: Vec3 = pixels().map(|p| p.direction * p.solid_angle).sum();
    let (eye, direction) = (sight.origin(), towards.try_normalize()?);
    let begun = |model: &Shape, distance: f32| {
        let centre = eye + direction * distance;
        let patches = patches(evidence, group, centre, model.size().max_element());
        (model.placed(centre, model.rotation(), Vec3::ONE), patches)
    };
    let (centre, extent) = extent(&points(evidence, group))?;
    let mount = mount(evidence, group, centre, extent);
    let plane = mount.and_then(|mount| plane_of(models, centre, level_normal(mount, up)));
    let mounted = plane.and_then(|plane| {
        let distance = -plane.height(eye) / direction.dot(plane.normal);
        let fits = models.iter().map(|model| {
            let (start, patches) = begun(model, distance);
            let fit = |shape: &Shape| Fit::new(*shape, &patches, Gaps::Seen);
            fit(&best_place_in_plane(&start, plane.normal, |shape| {
                fit(shape).residual
            }))
        });
        best_of(fits)
    });
    let free = models.iter().flat_map(|model| {
        let distance = (model.mean_projection() / solid_angle).sqrt();
        FARTHER.map(|farther| (model, farther * distance))
    });
    let free = free.map(|(model, distance)| {
        let (start, patches) = begun(model, distance);
        let fit = |shape: &Shape| Fit::new(*shape, &patches, Gaps::Seen);
        fit(&best_place(&start, |shape| fit(shape).residual).0)
    });
    let farthest = BEHIND * median_of(pixels().map(|p| p.distance));
    let is_before = |fit: &Fit| fit.shape.centre().distance(eye) <= farthest;
    mounted.or_else(|| best_of(free.filter(is_before)))
}

/// The best fit, if it is good enough.
fn best_of(fits: impl Iterator<Item = Fit>) -> Option<Fit> {
    let fits = fits.filter(|fit| fit.residual <= MAX_RESIDUAL);
    fits.min_by(|a, b| a.residual.total_cmp(&b.residual))
}

/// The plane of this unit `normal` that most shapes are in of those that may be mounted on what is
/// about `place`; `None` without any.
fn plane_of(shapes: &[Shape], place: Vec3, normal: Vec3) -> Option<Plane> {
    let near = shapes.iter().filter(|shape| {
        let height = (shape.centre() - place).dot(normal);
        height.abs() <= shape.size().max_element()
    });
    let along: Vec<f32> = near.map(|shape| shape.centre().dot(normal)).collect();
    (!along.is_empty()).then(|| Plane {
        normal,
        offset: median_of(along.into_iter()),
    })
}
