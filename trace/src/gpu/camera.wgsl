// Blended sums of all pixels of a camera: the twin of cpu/camera.rs and cpu/tile.rs. A workgroup is a tile, an invocation a pixel.
//
// A tile's list is sorted by a bound of the distance, pixels need the order of true distances, ties by index. Hits wait in a short sorted
// list of the pixel until the bound has passed them. Where that list overflows the farthest hits are forgotten, and the search begins again
// for those: exact for any number of hits, with memory for PENDING of them.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> list_starts: array<u32>;
@group(0) @binding(3) var<storage, read> listed: array<vec2u>;
@group(0) @binding(4) var<storage, read> seen_surfels: array<Seen>;
@group(0) @binding(5) var<storage, read> payloads: array<Lanes>;
@group(0) @binding(6) var<storage, read_write> sums: array<Lanes>;

const INFINITE = 3.4e38;

// Hits of a pixel that are not blended yet: [next, end), nearest first.
struct Pending {
    next: u32,
    end: u32,
    // Hits from here on were forgotten in this search.
    forgotten_t: f32,
    forgotten_index: u32,
    t: array<f32, PENDING>,
    index: array<u32, PENDING>,
    place: array<u32, PENDING>,
    alpha: array<f32, PENDING>,
}

fn is_before(t: f32, index: u32, other_t: f32, other_index: u32) -> bool {
    return t < other_t || (t == other_t && index < other_index);
}

fn wait_for(pending: ptr<function, Pending>, t: f32, index: u32, place: u32, alpha: f32) {
    if !is_before(t, index, (*pending).forgotten_t, (*pending).forgotten_index) {
        return;
    }
    if (*pending).end == PENDING {
        let first = (*pending).next;
        if first > 0u {
            for (var i = first; i < PENDING; i++) {
                (*pending).t[i - first] = (*pending).t[i];
                (*pending).index[i - first] = (*pending).index[i];
                (*pending).place[i - first] = (*pending).place[i];
                (*pending).alpha[i - first] = (*pending).alpha[i];
            }
            (*pending).next = 0u;
            (*pending).end = PENDING - first;
        } else {
            let last_t = (*pending).t[PENDING - 1u];
            let last_index = (*pending).index[PENDING - 1u];
            if !is_before(t, index, last_t, last_index) {
                (*pending).forgotten_t = t;
                (*pending).forgotten_index = index;
                return;
            }
            (*pending).forgotten_t = last_t;
            (*pending).forgotten_index = last_index;
            (*pending).end = PENDING - 1u;
        }
    }
    var at = (*pending).end;
    while at > (*pending).next && is_before(t, index, (*pending).t[at - 1u], (*pending).index[at - 1u]) {
        (*pending).t[at] = (*pending).t[at - 1u];
        (*pending).index[at] = (*pending).index[at - 1u];
        (*pending).place[at] = (*pending).place[at - 1u];
        (*pending).alpha[at] = (*pending).alpha[at - 1u];
        at--;
    }
    (*pending).t[at] = t;
    (*pending).index[at] = index;
    (*pending).place[at] = place;
    (*pending).alpha[at] = alpha;
    (*pending).end++;
}

// Blends the hits nearer than `bound`; returns whether the ray has ended.
fn blend_before(bound: f32, pending: ptr<function, Pending>, state: ptr<function, Blender>, recorder: ptr<function, Recorder>, direction: vec3f) -> bool {
    while (*pending).next < (*pending).end && (*pending).t[(*pending).next] < bound {
        let at = (*pending).next;
        (*pending).next = at + 1u;
        let alpha = (*pending).alpha[at];
        let before = (*state).transmittance;
        let offered = offer(state, (*pending).t[at], alpha, payloads[(*pending).index[at]], direction);
        if offered != SKIPPED {
            record_hit(recorder, (*pending).place[at], alpha, before);
        }
        if offered == LAST {
            return true;
        }
    }
    return false;
}

@compute @workgroup_size(TILE_PIXELS)
fn trace_tiles(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = band.first_tile + group_number(workgroup, workgroups);
    if tile >= band.end_tile {
        return;
    }
    let column = (tile % view.tiles_x) * TILE + thread % TILE;
    let row = (tile / view.tiles_x) * TILE + thread / TILE;
    if column >= view.width || row >= view.height {
        return;
    }
    let direction = pixel_direction(f32(column) + 0.5, f32(row) + 0.5);
    let start = list_starts[tile];
    let end = min(list_starts[tile + 1u], arrayLength(&listed));
    var state = Blender(NO_LANES, 1.0);
    var recorder = start_record(row * view.width + column, thread);
    var pending: Pending;
    // Hits before this one are done with.
    var from_t = -1.0;
    var from_index = 0u;
    loop {
        pending.next = 0u;
        pending.end = 0u;
        pending.forgotten_t = INFINITE;
        pending.forgotten_index = 0u;
        var ended = false;
        for (var place = start; place < end; place++) {
            let index = listed[place].x;
            let seen = seen_surfels[index];
            ended = blend_before(seen.nearest, &pending, &state, &recorder, direction);
            if ended || seen.nearest > pending.forgotten_t {
                break;
            }
            let hit = meet(seen, direction);
            if counts(seen, hit) && !is_before(hit.t, index, from_t, from_index) {
                wait_for(&pending, hit.t, index, place, alpha_of(seen, hit));
            }
        }
        if !ended {
            ended = blend_before(INFINITE, &pending, &state, &recorder, direction);
        }
        if ended || pending.forgotten_t == INFINITE {
            break;
        }
        from_t = pending.forgotten_t;
        from_index = pending.forgotten_index;
    }
    finish_record(&recorder);
    sums[row * view.width + column - band.first_pixel] = state.sums;
}
