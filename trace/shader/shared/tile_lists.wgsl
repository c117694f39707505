// Lists of Gaussians of tiles.

// First place of each tile in the lists, one more at the end.
@group(0) @binding(2) var<storage, read> list_starts: array<u32>;
// Gaussian and tile of each place.
@group(0) @binding(3) var<storage, read> listed: array<vec2u>;
