// Hits that wait to be blended, nearest first, ties by index. Where more than PENDING wait, the
// farthest are forgotten, and another search finds those: exact for any number of hits. The CPU
// sorts all hits of a ray instead. Opacities are worked out again when hits are blended: that costs
// less than carrying them along.
//
// A hit has a number: with `tile_lists` its place in the lists, otherwise the index of its
// Gaussian.

#import declarations

const INFINITE = 3.4e38;

#ifdef tile_lists
#import tile_lists

fn index_of(place: u32) -> u32 {
    return listed[place].x;
}
#else
fn index_of(index: u32) -> u32 {
    return index;
}
#endif

struct Pending {
    // Waiting are [next, end).
    next: u32,
    end: u32,
    // Hits from here on were forgotten in this search.
    forgotten_t: f32,
    forgotten: u32,
    t: array<f32, PENDING>,
    number: array<u32, PENDING>,
}

fn clear(pending: ptr<function, Pending>) {
    (*pending).next = 0u;
    (*pending).end = 0u;
    (*pending).forgotten_t = INFINITE;
    (*pending).forgotten = 0u;
}

fn is_before(t: f32, number: u32, other_t: f32, other: u32) -> bool {
    return t < other_t || (t == other_t && index_of(number) < index_of(other));
}

fn wait_for(pending: ptr<function, Pending>, t: f32, number: u32) {
    if !is_before(t, number, (*pending).forgotten_t, (*pending).forgotten) {
        return;
    }
    var end = (*pending).end;
    if end == PENDING {
        let first = (*pending).next;
        if first > 0u {
            for (var i = first; i < PENDING; i++) {
                (*pending).t[i - first] = (*pending).t[i];
                (*pending).number[i - first] = (*pending).number[i];
            }
            (*pending).next = 0u;
            end = PENDING - first;
        } else {
            let last_t = (*pending).t[PENDING - 1u];
            let last = (*pending).number[PENDING - 1u];
            if !is_before(t, number, last_t, last) {
                (*pending).forgotten_t = t;
                (*pending).forgotten = number;
                return;
            }
            (*pending).forgotten_t = last_t;
            (*pending).forgotten = last;
            end = PENDING - 1u;
        }
    }
    (*pending).end = end + 1u;
    while end > (*pending).next {
        let before_t = (*pending).t[end - 1u];
        let before = (*pending).number[end - 1u];
        if !is_before(t, number, before_t, before) {
            break;
        }
        (*pending).t[end] = before_t;
        (*pending).number[end] = before;
        end--;
    }
    (*pending).t[end] = t;
    (*pending).number[end] = number;
}
