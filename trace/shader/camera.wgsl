// Composited features of all rays of a camera. A workgroup is a tile of their grid, an invocation a
// place, called a pixel here.
//
// A tile's list is sorted by a bound of the distance, pixels need the order of true distances, ties
// by index. Hits wait until the bound has passed them; where more wait than there is memory for,
// another search finds those that were forgotten. The CPU (cpu/camera.rs) keeps all hits of a block
// of pixels and sorts them instead: the blended hits and their order are the same.
//
// The pixels of a tile go through its list together: each brings one of the next Gaussians for all.

#import declarations
#import workgroup
#import features
#import surfel
#import blend
#import view
#import band
#import ray_grid
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

// The next Gaussians of the list.
var<workgroup> next_seen: array<Seen, TILE_PIXELS>;
// Pixels that are through with the list in this search, and with all of them.
var<workgroup> num_through: atomic<u32>;
var<workgroup> num_complete: atomic<u32>;
var<workgroup> counted: u32;

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
    let is_pixel = column < view.width && row < view.height;
    let offset = ray_offset(tile, thread);
    let direction = pixel_direction(f32(column) + offset, f32(row) + offset);
    let start = list_starts[tile];
    let end = min(list_starts[tile + 1u], arrayLength(&listed));
    var state = Blender(NO_LANES, 1.0);
    var recorder = start_record(row * view.width + column, thread);
    var pending: Pending;
    // Hits before this one are done with.
    var from_t = -1.0;
    var from_place = start;
    var is_complete = !is_pixel || offset == 0.0;
    if thread == 0u {
        atomicStore(&num_complete, 0u);
    }
    workgroupBarrier();
    if is_complete {
        atomicAdd(&num_complete, 1u);
    }
    loop {
        clear(&pending);
        var is_through = is_complete;
        workgroupBarrier();
        if thread == 0u {
            atomicStore(&num_through, atomicLoad(&num_complete));
        }
        for (var first = start; first < end; first += TILE_PIXELS) {
            workgroupBarrier();
            if thread == 0u {
                counted = atomicLoad(&num_through);
            }
            if workgroupUniformLoad(&counted) == TILE_PIXELS {
                break;
            }
            if first + thread < end {
                next_seen[thread] = seen_surfels[listed[first + thread].x];
            }
            workgroupBarrier();
            if is_through {
                continue;
            }
            let num = min(TILE_PIXELS, end - first);
            for (var k = 0u; k < num; k++) {
                let seen = next_seen[k];
                is_complete = blend_before(seen.nearest, &pending, &state, &recorder, direction);
                if is_complete || seen.nearest > pending.forgotten_t {
                    is_through = true;
                    atomicAdd(&num_through, 1u);
                    break;
                }
                let hit = meet(seen, direction);
                let place = first + k;
                if counts(seen, hit) && !is_before(hit.t, place, from_t, from_place) {
                    wait_for(&pending, hit.t, place);
                }
            }
            if is_complete {
                atomicAdd(&num_complete, 1u);
            }
        }
        if !is_complete {
            is_complete = blend_before(INFINITE, &pending, &state, &recorder, direction);
            is_complete = is_complete || pending.forgotten_t == INFINITE;
            if is_complete {
                atomicAdd(&num_complete, 1u);
            }
            from_t = pending.forgotten_t;
            from_place = pending.forgotten;
        }
        workgroupBarrier();
        if thread == 0u {
            counted = atomicLoad(&num_complete);
        }
        if workgroupUniformLoad(&counted) == TILE_PIXELS {
            break;
        }
    }
    if is_pixel {
        finish_record(&recorder);
        features[row * view.width + column - band.first_pixel] = state.features;
    }
}
