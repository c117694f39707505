//! Clusters of emitters that lie close together, and what a receiver may get from one.

use super::disc::{Disc, REALIZATIONS};
use crate::surfel::Surfel;
use crate::transport::start::Surface;
use glam::Vec3;
use std::ops::Range;

/// Most clusters of a list.
pub(crate) const MAX_CLUSTERS: usize = 64;

/// Emitters that follow each other in the list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cluster {
    /// Mean place by power.
    pub(crate) centre: Vec3,
    /// Of a sphere about the centre that holds all discs, scene units.
    pub(crate) radius: f32,
    /// Mean squared distance of points of the discs from the centre.
    pub(crate) spread: f32,
    /// Mean by power of the products `n nᵀ` of normals: xx, yy, zz.
    pub(crate) squares: Vec3,
    /// Of the same: yz, zx, xy.
    pub(crate) products: Vec3,
    /// Luminance times area of all discs, in each realization.
    pub(crate) powers: [f32; REALIZATIONS],
    /// Luminance times the integral of the opacity of all footprints.
    pub(super) footprint_power: f32,
    /// Its discs, from and to.
    pub(crate) first: u32,
    pub(crate) end: u32,
}

impl Cluster {
    pub(super) fn range(&self) -> Range<usize> {
        self.first as usize..self.end as usize
    }

    fn new(emitters: &[(Disc, Surfel)], range: Range<usize>) -> Self {
        let discs = &emitters[range.clone()];
        let mut powers = [0.0; REALIZATIONS];
        let (mut sum, mut centre) = (0.0, Vec3::ZERO);
        let (mut squares, mut products) = (Vec3::ZERO, Vec3::ZERO);
        for (disc, surfel) in discs {
            for (realization, power) in powers.iter_mut().enumerate() {
                *power += disc.power(surfel, realization);
            }
            let power = mean_power(disc, surfel);
            let normal = Vec3::from(surfel.normal);
            sum += power;
            centre += power * Vec3::from(surfel.position);
            squares += power * normal * normal;
            products += power
                * Vec3::new(normal.y, normal.z, normal.x)
                * Vec3::new(normal.z, normal.x, normal.y);
        }
        let centre = centre / sum;
        let (mut radius, mut spread) = (0.0_f32, 0.0);
        for (disc, surfel) in discs {
            let far = Vec3::from(surfel.position).distance_squared(centre);
            let [u, v] = surfel.extents();
            radius = radius.max(far.sqrt() + u.length().max(v.length()));
            let own = disc.axis_u.length_squared() + disc.axis_v.length_squared();
            spread += mean_power(disc, surfel) * (far + own);
        }
        Self {
            centre,
            radius,
            spread: spread / sum,
            squares: squares / sum,
            products: products / sum,
            powers,
            // Set when the emitters are in order.
            footprint_power: 0.0,
            first: range.start as u32,
            end: range.end as u32,
        }
    }

    /// Cosines over the squared distance, about: the mean height above the receiver's plane of
    /// points of a sphere, and the mean square of the emitters' cosine, with distances that the
    /// extent of the cluster keeps from zero. Zero if all of it is below the plane.
    pub(super) fn importance(&self, receiver: &Surface) -> f32 {
        let offset = self.centre - receiver.position;
        let height = receiver.normal.dot(offset);
        let above = if height >= self.radius {
            height
        } else {
            let part = (height + self.radius).max(0.0);
            part * part / (4.0 * self.radius)
        };
        let distance2 = offset.length_squared() + self.spread;
        let crossed = Vec3::new(
            offset.y * offset.z,
            offset.z * offset.x,
            offset.x * offset.y,
        );
        let facing = self.squares.dot(offset * offset) + 2.0 * self.products.dot(crossed);
        above * (facing.max(0.0) + self.spread / 3.0).sqrt() / (distance2 * distance2)
    }
}

fn mean_power(disc: &Disc, surfel: &Surfel) -> f32 {
    let of = |realization| disc.power(surfel, realization);
    (0..REALIZATIONS).map(of).sum::<f32>() / REALIZATIONS as f32
}

/// Puts the emitters of a cluster beside each other, and neighbours in space near each other:
/// whichever cluster has most power times extent is divided in the middle, as long as there are
/// few.
pub(super) fn divide(emitters: &mut [(Disc, Surfel)]) -> Vec<Cluster> {
    let mut clusters = vec![Cluster::new(emitters, 0..emitters.len())];
    while clusters.len() < MAX_CLUSTERS {
        let size = |cluster: &Cluster| cluster.powers.iter().sum::<f32>() * cluster.spread;
        let divisible = (0..clusters.len()).filter(|&i| clusters[i].range().len() > 1);
        let Some(largest) =
            divisible.max_by(|&a, &b| size(&clusters[a]).total_cmp(&size(&clusters[b])))
        else {
            break;
        };
        let range = clusters[largest].range();
        let middle = range.start + halve(&mut emitters[range.clone()]);
        clusters[largest] = Cluster::new(emitters, range.start..middle);
        clusters.insert(largest + 1, Cluster::new(emitters, middle..range.end));
    }
    for cluster in &clusters {
        order(&mut emitters[cluster.range()]);
    }
    clusters
}

fn place(emitter: &(Disc, Surfel), axis: usize) -> f32 {
    emitter.1.position[axis]
}

/// Sorts emitters along the axis of largest extent; returns it with the middle of the extent.
fn sort(emitters: &mut [(Disc, Surfel)]) -> (usize, f32) {
    let positions = emitters.iter().map(|(_, surfel)| surfel.position.into());
    let (low, high) = positions.fold(
        (Vec3::INFINITY, Vec3::NEG_INFINITY),
        |(low, high), p: Vec3| (low.min(p), high.max(p)),
    );
    let axis = (high - low).max_position();
    emitters.sort_by(|a, b| place(a, axis).total_cmp(&place(b, axis)));
    (axis, 0.5 * (low[axis] + high[axis]))
}

/// Divides emitters, two at least, at the middle of their extent; returns the number of the first
/// half.
fn halve(emitters: &mut [(Disc, Surfel)]) -> usize {
    let (axis, middle) = sort(emitters);
    let num = emitters.partition_point(|emitter| place(emitter, axis) <= middle);
    num.clamp(1, emitters.len() - 1)
}

/// Brings neighbours in space near each other.
fn order(emitters: &mut [(Disc, Surfel)]) {
    if emitters.len() > 2 {
        sort(emitters);
        let (first, second) = emitters.split_at_mut(emitters.len() / 2);
        order(first);
        order(second);
    }
}
