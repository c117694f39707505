// The blended hits of every pixel are kept for the adjoint, in chunks that are linked back to
// front. The first is the pixel's own; where another lies depends on which pixel asked first, what
// is in it does not.
//
// The record begins with PIXEL_WORDS words for each pixel of the band, its last chunk, its number
// of hits and its first chunk. A chunk is the place of the one before it, then for each hit its
// place in the lists, its opacity and the transmittance before it.

#import declarations
#import band

@group(0) @binding(7) var<storage, read_write> record: array<u32>;
// Pixels of a tile that blended the Gaussian at each place in the lists, one bit each in two words.
@group(0) @binding(8) var<storage, read_write> masks: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> counters: array<atomic<u32>>;

struct Recorder {
    pixel: u32,
    thread: u32,
    last_chunk: u32,
    num_hits: u32,
    is_full: bool,
}

fn start_record(pixel: u32, thread: u32) -> Recorder {
    return Recorder(pixel - band.first_pixel, thread, 0u, 0u, false);
}

fn record_hit(recorder: ptr<function, Recorder>, place: u32, alpha: f32, before: f32) {
    if (*recorder).is_full {
        return;
    }
    let within = (*recorder).num_hits % CHUNK_HITS;
    if within == 0u {
        var chunk = PIXEL_WORDS * (*recorder).pixel + 2u;
        if (*recorder).num_hits > 0u {
            chunk = band.first_chunk + atomicAdd(&counters[COUNTER_CHUNKS], 1u) * CHUNK_WORDS;
        }
        if chunk + CHUNK_WORDS > arrayLength(&record) {
            (*recorder).is_full = true;
            atomicStore(&counters[COUNTER_FAILED], 1u);
            return;
        }
        record[chunk] = (*recorder).last_chunk;
        (*recorder).last_chunk = chunk;
    }
    let at = (*recorder).last_chunk + 1u + 3u * within;
    record[at] = place;
    record[at + 1u] = bitcast<u32>(alpha);
    record[at + 2u] = bitcast<u32>(before);
    (*recorder).num_hits += 1u;
    let thread = (*recorder).thread;
    atomicOr(&masks[2u * place + (thread >> 5u)], 1u << (thread & 31u));
}

fn finish_record(recorder: ptr<function, Recorder>) {
    let pixel = (*recorder).pixel;
    record[PIXEL_WORDS * pixel] = (*recorder).last_chunk;
    record[PIXEL_WORDS * pixel + 1u] = (*recorder).num_hits;
}
