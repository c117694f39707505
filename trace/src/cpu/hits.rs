//! The hits of a block of rays, and their order.

use super::tile::LANES;

/// Longest list whose order is found by counting; the work grows with the square of the length.
const COUNTING_LIMIT: usize = 256;

/// Values of a hit beside its distance.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct HitValues {
    pub(super) slot: u32,
    pub(super) alpha: f32,
    pub(super) u: f32,
    pub(super) v: f32,
}

/// A list of hits for each ray of a block. Memory is reused from block to block.
#[derive(Default)]
pub(super) struct BlockHits {
    /// Capacity of each list: a multiple of [`LANES`].
    stride: usize,
    /// End of each list, counted from the first's start.
    ends: [u32; LANES],
    /// Distances, `[LANES, stride]`.
    t: Vec<f32>,
    values: Vec<HitValues>,
    /// Slots of the hits of a list with equal distances, in floats.
    slots: Vec<f32>,
    /// Places of the hits of the list that was ordered last, front to back.
    order: Vec<u32>,
}

impl BlockHits {
    /// Empties all lists.
    pub(super) fn clear(&mut self) {
        self.ends = std::array::from_fn(|lane| (lane * self.stride) as u32);
        self.reserve(LANES);
    }

    /// Makes capacity for `num` more hits in every list.
    #[inline(always)]
    pub(super) fn reserve(&mut self, num: usize) {
        let stride = self.stride as u32;
        let lens = (0..).zip(&self.ends).map(|(lane, end)| end - lane * stride);
        let longest = lens.fold(0, u32::max) as usize;
        if longest + num > self.stride {
            self.grow(longest + num);
        }
    }

    #[cold]
    fn grow(&mut self, needed: usize) {
        let stride = needed.max(2 * self.stride).next_multiple_of(LANES);
        let mut t = vec![0.0; LANES * stride];
        let mut values = vec![HitValues::default(); LANES * stride];
        for lane in 0..LANES {
            let old = lane * self.stride..self.ends[lane] as usize;
            let new = lane * stride..lane * stride + old.len();
            self.ends[lane] = new.end as u32;
            t[new.clone()].copy_from_slice(&self.t[old.clone()]);
            values[new].copy_from_slice(&self.values[old]);
        }
        (self.stride, self.t, self.values) = (stride, t, values);
        self.order.resize(stride, 0);
    }

    /// Appends a hit to the list of ray `lane`, for which [`Self::reserve`] has made capacity.
    /// `[alpha, u, v]`.
    #[inline(always)]
    pub(super) fn push(&mut self, lane: usize, t: f32, [alpha, u, v]: [f32; 3], slot: u32) {
        let at = self.ends[lane] as usize;
        self.t[at] = t;
        self.values[at] = HitValues { slot, alpha, u, v };
        self.ends[lane] += 1;
    }

    /// The hits of ray `lane`, front to back, ties by slot.
    #[inline(always)]
    pub(super) fn ordered(&mut self, lane: usize) -> impl Iterator<Item = (f32, &HitValues)> {
        let start = lane * self.stride;
        let len = self.ends[lane] as usize - start;
        let padded = len.next_multiple_of(LANES);
        self.t[start + len..start + padded].fill(f32::INFINITY);
        let t = &self.t[start..start + padded];
        let values = &self.values[start..start + len];
        let order = &mut self.order[..padded];
        let is_ordered = len <= COUNTING_LIMIT
            && (order_by_counting::<false>(t, t, len, order) || {
                // Exact in floats below 2²⁴; where two larger slots become one, this fails.
                self.slots.clear();
                self.slots.extend(values.iter().map(|hit| hit.slot as f32));
                self.slots.resize(padded, f32::INFINITY);
                order_by_counting::<true>(t, &self.slots, len, order)
            });
        if !is_ordered {
            order_by_sorting(&t[..len], &mut order[..len], |i| values[i as usize].slot);
        }
        order[..len]
            .iter()
            .map(move |&i| (t[i as usize], &values[i as usize]))
    }
}

/// Writes the places of `t[..len]` in ascending order, with `TIES` equal ones by `slots`, which do
/// not count otherwise. `t` and `slots` are padded with infinities to a multiple of [`LANES`],
/// `order` is as long. The place of each number is the number of smaller ones: no branch depends on
/// the data. False, and no order, if two are equal.
#[inline(always)]
fn order_by_counting<const TIES: bool>(
    t: &[f32],
    slots: &[f32],
    len: usize,
    order: &mut [u32],
) -> bool {
    let (mut sum, mut first) = (0_u32, 0);
    // Several registers at once share the numbers they are compared with.
    while first < len {
        let left = len - first;
        sum += if left > TWO {
            place_block::<FOUR, TIES>(t, slots, len, first, order)
        } else if left > LANES {
            place_block::<TWO, TIES>(t, slots, len, first, order)
        } else {
            place_block::<LANES, TIES>(t, slots, len, first, order)
        };
        first += FOUR;
    }
    let num = len as u32;
    sum == num * num.saturating_sub(1) / 2
}

/// Numbers in two registers, and in four.
const TWO: usize = 2 * LANES;
const FOUR: usize = 4 * LANES;

/// Places `N` numbers from `first` on; returns the sum of the places.
///
/// They are counted in floats: compilers may not change the order of such sums, and so make vectors
/// of the block, not of the numbers that each is compared with.
#[inline(always)]
fn place_block<const N: usize, const TIES: bool>(
    t: &[f32],
    slots: &[f32],
    len: usize,
    first: usize,
    order: &mut [u32],
) -> u32 {
    // From here on floats have the bits of integers.
    const ZERO: f32 = 8_388_608.0;
    let held = N.min(t.len() - first);
    let block_of = |values: &[f32]| {
        let mut block = [f32::INFINITY; N];
        block[..held].copy_from_slice(&values[first..first + held]);
        block
    };
    let (block, slots_of_block) = (block_of(t), block_of(slots));
    let mut smaller = [ZERO; N];
    for (&other, &slot) in t[..len].iter().zip(&slots[..len]) {
        for k in 0..N {
            let is_before_tie = TIES & (other == block[k]) & (slot < slots_of_block[k]);
            smaller[k] = if (other < block[k]) | is_before_tie {
                smaller[k] + 1.0
            } else {
                smaller[k]
            };
        }
    }
    let mut sum = 0;
    for (k, count) in smaller.iter().enumerate().take(len - first) {
        let place = count.to_bits() - ZERO.to_bits();
        sum += place;
        order[place as usize] = (first + k) as u32;
    }
    sum
}

/// Writes the places of `t` in ascending order, equal ones by their slot.
#[cold]
fn order_by_sorting(t: &[f32], order: &mut [u32], slot_of: impl Fn(u32) -> u32) {
    for (i, place) in order.iter_mut().enumerate() {
        *place = i as u32;
    }
    // Distances are positive: their bits order like they do.
    order.sort_unstable_by_key(|&i| {
        u64::from(t[i as usize].to_bits()) << 32 | u64::from(slot_of(i))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};

    fn order_of(distances: &[f32]) -> Vec<u32> {
        let mut hits = BlockHits::default();
        hits.clear();
        // Slots count down from the last: a tie goes to the later hit.
        let num = distances.len() as u32;
        for (i, &t) in distances.iter().enumerate() {
            hits.reserve(1);
            hits.push(3, t, [0.5, 0.0, 0.0], num - i as u32);
        }
        let ordered = hits.ordered(3);
        ordered.map(|(_, values)| num - values.slot).collect()
    }

    #[test]
    fn hits_come_front_to_back() {
        assert_eq!(order_of(&[]), [0_u32; 0]);
        assert_eq!(order_of(&[2.0, 1.0, 3.0]), [1, 0, 2]);
        assert_eq!(order_of(&[2.0, 1.0, 2.0, 0.5]), [3, 1, 2, 0]);
    }

    #[test]
    fn lists_of_any_length_are_ordered() {
        for len in [1, 15, 16, 17, 100, COUNTING_LIMIT, COUNTING_LIMIT + 1, 1000] {
            // Every hundredth distance comes twice.
            let key = RandomKey::new(7, Purpose::Render, 0);
            let distances: Vec<f32> = (0..len as u32)
                .map(|i| key.stream(i - u32::from(i % 100 == 99), 0).next_uniforms()[0] + 1.0)
                .collect();
            let order = order_of(&distances);
            assert_eq!(order.len(), len);
            for pair in order.windows(2) {
                let [a, b] = [pair[0], pair[1]];
                let (near, far) = (distances[a as usize], distances[b as usize]);
                assert!(near < far || near == far && a > b);
            }
        }
    }
}
