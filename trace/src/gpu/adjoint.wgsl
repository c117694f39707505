// Shared by the stages of the adjoint.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;

// Number of the tile's pixels before `thread` that blended a Gaussian.
fn rank_of(mask: vec2u, thread: u32) -> u32 {
    let below = (1u << (thread & 31u)) - 1u;
    if thread < 32u {
        return countOneBits(mask.x & below);
    }
    return countOneBits(mask.x) + countOneBits(mask.y & below);
}
