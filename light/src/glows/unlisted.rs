//! Emitters that are of no lamp of a list: what training made of lit pixels that no shape explains.

use super::connected;
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::emits;
use eagpt_scene::{Gaussians, Lamps};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Light of such emitters in that of all, at least: less is what noise of masks leaves.
const LEAST: f32 = 1e-3;
/// Distance up to which an emitter is of the same lamp as another one, in sizes of this.
const NEAR: f32 = 4.0;

/// The Gaussians that emit and that no lamp of a list has, in sets of what is near each other,
/// each ascending.
pub fn unlisted(gaussians: &Gaussians, lamps: &Lamps) -> Vec<Vec<usize>> {
    let light = |i: usize| {
        let shown = gaussians.opacities[i] * gaussians.scales[i].element_product();
        shown * luminance(gaussians.radiances[i].to_array())
    };
    let emitting = || (0..gaussians.len()).filter(|&i| emits(gaussians.emissions[i]));
    let left: Vec<usize> = emitting()
        .filter(|&i| lamps.of(gaussians.positions[i]).is_none())
        .collect();
    let places: Vec<[f32; 3]> = (left.iter())
        .map(|&i| gaussians.positions[i].to_array())
        .collect();
    if places.is_empty() {
        return Vec::new();
    }
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&places);
    let near = |k: usize| {
        let reach = NEAR * gaussians.scales[left[k]].max_element();
        let found = tree.within::<SquaredEuclidean>(&places[k], reach * reach);
        found.into_iter().map(|one| one.item as usize)
    };
    let least = LEAST * emitting().map(light).sum::<f32>();
    let mut all = connected(&vec![true; left.len()], near);
    for members in &mut all {
        members
            .iter_mut()
            .for_each(|member| *member = left[*member]);
        members.sort_unstable();
    }
    all.retain(|members| members.iter().copied().map(light).sum::<f32>() >= least);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_testkit::gaussians::{material, sphere};
    use eagpt_testkit::lamps::boxed;
    use glam::Vec3;

    /// A room with lit patches above, to one side, and, dim, to the other; a list has the first.
    #[test]
    fn what_no_lamp_has_is_found_patch_by_patch() {
        let places = [Vec3::Z, Vec3::X, Vec3::NEG_X, Vec3::Y];
        let radiances = [10.0, 5.0, 2.0, 1e-3];
        let of = |towards: Vec3| places.iter().position(|place| towards.dot(*place) > 0.95);
        let scene = sphere(4000, 1.0, |towards| {
            let radiance = of(towards).map_or(1.0, |place| radiances[place]);
            let emission = f32::from(u8::from(of(towards).is_some()));
            material(Vec3::splat(radiance), emission, Vec3::splat(0.5))
        });
        let lamps = Lamps {
            lamps: vec![boxed("ceiling-1", [0.0, 0.0, 1.0], [0.8, 0.8, 0.2])],
        };
        let found = unlisted(&scene, &lamps);
        let patches: Vec<Option<usize>> = (found.iter())
            .map(|members| of(scene.positions[members[0]].normalize()))
            .collect();
        assert_eq!(found.len(), 2);
        assert!(patches.contains(&Some(1)) && patches.contains(&Some(2)));
        for (members, place) in found.iter().zip(&patches) {
            let is_there = |i: &usize| of(scene.positions[*i].normalize()) == *place;
            assert!(members.is_sorted() && members.iter().all(is_there));
        }
        assert_eq!(unlisted(&scene, &Lamps::default()).len(), 3);
        let whole = boxed("room-1", [0.0; 3], [3.0; 3]);
        assert!(unlisted(&scene, &Lamps { lamps: vec![whole] }).is_empty());
    }
}
