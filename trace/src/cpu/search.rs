//! Search for the hits of the rays of a tile.
//!
//! Each Gaussian of a tile's list is tested against all blocks of the tile at once, and then, block
//! by block, against the rays of those it may cover. The hits of a block, and everything that is
//! done with them, stay in the processor's first cache.

use super::bins::BinnedSurfel;
use super::hits::BlockHits;
use super::lanes::for_each_lane;
use super::tile::{BLOCKS, BlockMet, LANES, RayBlock, TileRays};
use crate::attributes::{Attributes, Face};
use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::surfel::{SeenSet, SeenSurfel, Surfel, exp_of_negative};

/// A Gaussian that rays of a tile may meet: a slot of the tile.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct TileSurfel {
    pub(super) seen: SeenSurfel,
    /// Index in the scene.
    pub(super) index: u32,
    /// No hit is closer than this, nor one on the slots that come later by distance.
    nearest: f32,
}

/// The Gaussians of a tile, copied from the scene, and which of them each block may see. Memory is
/// reused from tile to tile.
///
/// Copies are made in loops that do nothing else: the scene is larger than the caches, and loads
/// that wait for nothing wait together.
#[derive(Default)]
pub(super) struct TileList {
    surfels: Vec<Surfel>,
    /// In order of index.
    pub(super) slots: Vec<TileSurfel>,
    /// Of each slot, with the normal turned towards the rays' origin.
    pub(super) attributes: Vec<Attributes>,
    /// Blocks that may see each slot, one byte for each block.
    seen_by: Vec<u128>,
    distances: Distances,
    /// Slots of each block, nearest first.
    blocks: [Vec<u32>; BLOCKS],
}

impl TileList {
    /// Takes the Gaussians of a list that some block may see.
    #[inline(always)]
    pub(super) fn fill(&mut self, set: SeenSet<'_>, binned: &[BinnedSurfel], rays: &TileRays) {
        let surfels = binned.iter().map(|entry| set.surfels[entry.index as usize]);
        self.surfels.clear();
        self.surfels.extend(surfels);
        self.slots.clear();
        self.seen_by.clear();
        for (entry, surfel) in binned.iter().zip(&self.surfels) {
            let seen = surfel.seen_from(rays.origin);
            let seen_by = rays.grid.may_hit(&seen);
            if seen_by != 0 {
                self.seen_by.push(seen_by);
                self.slots.push(TileSurfel {
                    seen,
                    index: entry.index,
                    nearest: entry.nearest,
                });
            }
        }
        self.copy_attributes(set);
        self.blocks.iter_mut().for_each(Vec::clear);
        for &slot in self.distances.sort(&mut self.slots) {
            for_each_lane(self.seen_by[slot as usize], |block| {
                self.blocks[block].push(slot);
            });
        }
    }

    #[inline(always)]
    fn copy_attributes(&mut self, set: SeenSet<'_>) {
        let attributes = self
            .slots
            .iter()
            .map(|slot| set.attributes[slot.index as usize]);
        self.attributes.clear();
        self.attributes.extend(attributes);
        for (attributes, slot) in self.attributes.iter_mut().zip(&self.slots) {
            *attributes = attributes.turned(Face::of_plane(slot.seen.plane));
        }
    }

    /// Gives slots to the Gaussians of `indices`, in order of index.
    pub(super) fn name_slots(
        &mut self,
        set: SeenSet<'_>,
        origin: [f32; 3],
        indices: impl Iterator<Item = u32>,
    ) {
        let mut sorted: Vec<u32> = indices.collect();
        sorted.sort_unstable();
        sorted.dedup();
        let slots = sorted.into_iter().map(|index| TileSurfel {
            seen: set.surfels[index as usize].seen_from(origin),
            index,
            nearest: 0.0,
        });
        self.slots.clear();
        self.slots.extend(slots);
        self.copy_attributes(set);
    }

    /// The slot of a Gaussian that [`Self::name_slots`] has named.
    pub(super) fn slot_of(&self, index: u32) -> u32 {
        self.slots.partition_point(|surfel| surfel.index < index) as u32
    }

    /// Tests the Gaussians that `block` may see against its rays.
    #[inline(always)]
    pub(super) fn find_hits(&self, block: usize, rays: &RayBlock, hits: &mut BlockHits) {
        let mut closing = BlockClosing::new(rays.rays());
        for (at, &slot) in self.blocks[block].iter().enumerate() {
            let surfel = &self.slots[slot as usize];
            if at % CLOSING_INTERVAL == 0 {
                // The list is sorted by this bound: once every ray has ended before it, nothing
                // further can be seen.
                if closing.closed_before(surfel.nearest) {
                    break;
                }
                hits.reserve(CLOSING_INTERVAL);
            }
            let met = rays.meet(&surfel.seen);
            if met.hits == 0 {
                continue;
            }
            // The exponential only where some pixel is hit.
            let mut alpha = [0.0_f32; LANES];
            for k in 0..LANES {
                let r2 = met.u[k] * met.u[k] + met.v[k] * met.v[k];
                alpha[k] = surfel.seen.opacity * exp_of_negative(-0.5 * r2);
            }
            for_each_lane(closing.add(&met, &alpha), |k| {
                hits.push(k, met.t[k], [alpha[k], met.u[k], met.v[k]], slot);
            });
        }
    }
}

/// Classes of distance.
const NUM_DISTANCES: usize = 256;

/// Order of slots by distance, in equal steps of it: lists need no finer one. Memory is reused.
#[derive(Default)]
struct Distances {
    class_of: Vec<u8>,
    order: Vec<u32>,
}

impl Distances {
    /// Slots, those of a class in order; their distances become the least of their class.
    #[inline(always)]
    fn sort(&mut self, slots: &mut [TileSurfel]) -> &[u32] {
        let all = || slots.iter().map(|slot| slot.nearest);
        let (low, high) = (
            all().fold(f32::INFINITY, f32::min),
            all().fold(0.0, f32::max),
        );
        let steps = (NUM_DISTANCES - 1) as f32 / (high - low).max(f32::MIN_POSITIVE);
        // Rounding does not change the order of the results.
        let class = |nearest: f32| ((nearest - low) * steps) as u8;
        self.class_of.clear();
        self.class_of.extend(all().map(class));
        let mut next = [0_u32; NUM_DISTANCES + 1];
        let mut least = [f32::INFINITY; NUM_DISTANCES];
        for (slot, &class) in slots.iter().zip(&self.class_of) {
            next[class as usize + 1] += 1;
            least[class as usize] = least[class as usize].min(slot.nearest);
        }
        for class in 0..NUM_DISTANCES {
            next[class + 1] += next[class];
        }
        self.order.resize(slots.len(), 0);
        for (i, (slot, &class)) in (0..).zip(slots.iter_mut().zip(&self.class_of)) {
            slot.nearest = least[class as usize];
            let place = &mut next[class as usize];
            self.order[*place as usize] = i;
            *place += 1;
        }
        &self.order
    }
}

/// Gaussians between two checks for whether a block is closed.
const CLOSING_INTERVAL: usize = 8;

/// Whether and where the rays of a block have become opaque, from hits in any order. Hits so light
/// that a ray that continues might skip them are left out ([`Self::SURE_ALPHA`]); once the product
/// of `1 − α` over the others is under the limit, the ray has ended at or before the farthest of
/// them, whatever else it met.
struct BlockClosing {
    transmittance: [f32; LANES],
    farthest: [f32; LANES],
}

impl BlockClosing {
    /// As long as a ray continues, the weight of such a hit is above [`MIN_WEIGHT`]. The factor
    /// covers rounding.
    const SURE_ALPHA: f32 = 1.01 * MIN_WEIGHT / MIN_TRANSMITTANCE;
    /// Under the limit of a ray by enough to cover the rounding of products in another order.
    const LIMIT: f32 = 0.99 * MIN_TRANSMITTANCE;

    /// Open where there is a ray, one byte for each lane.
    #[inline(always)]
    fn new(rays: u128) -> Self {
        Self {
            transmittance: rays.to_le_bytes().map(f32::from),
            farthest: [0.0; LANES],
        }
    }

    /// Takes note of hits and returns, one byte for each ray, those that are not behind the end of
    /// their ray.
    #[inline(always)]
    fn add(&mut self, met: &BlockMet, alpha: &[f32; LANES]) -> u128 {
        let hits = met.hits.to_le_bytes();
        let mut counted = [0_u8; LANES];
        for k in 0..LANES {
            let hit = (hits[k] == 1) & (alpha[k] >= Self::SURE_ALPHA);
            let open = self.transmittance[k] >= Self::LIMIT;
            let behind = met.t[k] > self.farthest[k];
            counted[k] = u8::from((hits[k] == 1) & (open | !behind));
            let passes = if hit { 1.0 - alpha[k] } else { 1.0 };
            let farther = hit & open & behind;
            self.farthest[k] = if farther { met.t[k] } else { self.farthest[k] };
            self.transmittance[k] *= if open { passes } else { 1.0 };
        }
        u128::from_le_bytes(counted)
    }

    #[inline(always)]
    fn closed_before(&self, distance: f32) -> bool {
        let mut open = 0_u32;
        for k in 0..LANES {
            let closed = (self.transmittance[k] < Self::LIMIT) & (self.farthest[k] < distance);
            open += u32::from(!closed);
        }
        open == 0
    }
}
