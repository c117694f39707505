// Composited features of all pixels of a camera. A workgroup is a tile, an invocation a pixel.
//
// A tile's list is sorted by a bound of the distance, pixels need the order of true distances, ties
// by index. Hits wait until the bound has passed them; where more wait than there is memory for,
// another search finds those that were forgotten. The CPU (cpu/camera.rs) keeps all hits of a block
// of pixels and sorts them instead: the blended hits and their order are the same.

#import declarations
#import workgroup
#import features
#import surfel
#import blend
#import view
#import band
#import pending
#import tile_lists

#ifdef record
#import camera_record
#else
#import camera_no_record
#endif

@group(0) @binding(4) var<storage, read> seen_surfels: array<Seen>;
@group(0) @binding(5) var<storage, read> attributes: array<Lanes>;
@group(0) @binding(6) var<storage, read_write> features: array<Lanes>;

// Blends the hits nearer than `bound`; returns whether the ray has ended.
fn blend_before(
    bound: f32,
    pending: ptr<function, Pending>,
    state: ptr<function, Blender>,
    recorder: ptr<function, Recorder>,
    direction: vec3f,
) -> bool {
    while (*pending).next < (*pending).end {
        let t = (*pending).t[(*pending).next];
        if t >= bound {
            break;
        }
        let place = (*pending).number[(*pending).next];
        (*pending).next += 1u;
        let index = index_of(place);
        let alpha = alpha_of(seen_surfels[index], meet(seen_surfels[index], direction));
        let before = (*state).transmittance;
        let status = accumulate(state, t, alpha, attributes[index], direction);
        if status != SKIPPED {
            record_hit(recorder, place, alpha, before);
        }
        if status == LAST {
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
    var from_place = start;
    loop {
        clear(&pending);
        var ended = false;
        for (var place = start; place < end; place++) {
            let index = listed[place].x;
            let seen = seen_surfels[index];
            ended = blend_before(seen.nearest, &pending, &state, &recorder, direction);
            if ended || seen.nearest > pending.forgotten_t {
                break;
            }
            let hit = meet(seen, direction);
            if counts(seen, hit) && !is_before(hit.t, place, from_t, from_place) {
                wait_for(&pending, hit.t, place);
            }
        }
        if !ended {
            ended = blend_before(INFINITE, &pending, &state, &recorder, direction);
        }
        if ended || pending.forgotten_t == INFINITE {
            break;
        }
        from_t = pending.forgotten_t;
        from_place = pending.forgotten;
    }
    finish_record(&recorder);
    features[row * view.width + column - band.first_pixel] = state.features;
}
