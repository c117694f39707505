//! Structures and constants that kernels and Rust share: written down once, in Rust, and declared
//! in WGSL from there.

pub(super) mod camera;
pub(super) mod light;
pub(super) mod matrix;
pub(super) mod sort;

use super::bvh;
use super::layout::{Layout, layout, write_line};
use crate::blend::Contribution;
use crate::camera_rays::CameraRays;
use crate::cpu::realizations::NUM_REALIZATIONS;
use crate::features::lane;
use crate::model::{FREE, MIN_COSINE, MIN_TRANSMITTANCE, MIN_WEIGHT, OWN_COSINE};
use crate::surfel::Surfel;
use crate::transport::light_list::MAX_CLUSTERS;
use crate::transport::matrix::{EMITTER, NOTHING};
use crate::transport::{bsdf, start, vertex};
use camera::{
    Band, CHUNK_HITS, CHUNK_WORDS, FARTHEST_KEY, KEY_SHIFT, PENDING, PIXEL_WORDS, PLACES,
    SPLIT_EDGE, Seen, SplitPixels, TILE, TILE_PIXELS, TILES_PER_DISPATCH, View,
};
use eagpt_scene::harmonics::{FUNCTION_CONSTANTS, MAX_EXPONENT, NUM_FUNCTIONS};
use light::{
    Emitter, FIRST_RAY, GATHER, Gathered, LAST_BOUNCE, LightParameters, PathState, ROULETTE,
    RayQuery, TOWARDS_LIGHT,
};
use matrix::{
    DirectLight, FoundEntry, LightCluster, LightDisc, ReceiverOnDevice, TransportParameters,
};
use sort::{
    SCAN_BLOCK, SCAN_PER_THREAD, SCAN_THREADS, SORT_BLOCK, SORT_COUNTERS, SORT_DIGITS,
    SORT_PER_THREAD, SORT_ROW, SORT_THREADS, ScanParameters, SortParameters,
};

/// Invocations of a workgroup of kernels in which each works on its own.
pub(super) const GROUP_SIZE: u32 = 64;

// `Lanes` of blend.wgsl takes the lanes apart into vectors.
const _: () = assert!(
    lane::RADIANCE == 0
        && lane::EMISSION == 3
        && lane::ALBEDO == 4
        && lane::NORMAL == 7
        && lane::ALPHA == 10
        && lane::DISTANCE == 11
        && lane::SPREAD == 12
        && lane::SIZE == 13
        && lane::FIRST == 14
);

/// All structures.
pub(super) fn layouts() -> Vec<Layout> {
    vec![
        layout!(Surfel {
            position: "vec3f",
            opacity: "f32",
            axis_u: "vec3f",
            cut2: "f32",
            axis_v: "vec3f",
            size: "f32",
            normal: "vec3f",
            padding: "f32",
        }),
        layout!(Contribution {
            gaussian: "u32",
            weight: "f32",
            weighted_value: "f32",
            largest_weight: "f32",
            pixel: "u32",
        }),
        Seen::layout(),
        View::layout(),
        SplitPixels::layout(),
        Band::layout(),
        ScanParameters::layout(),
        SortParameters::layout(),
        LightParameters::layout(),
        RayQuery::layout(),
        Emitter::layout(),
        Gathered::layout(),
        PathState::layout(),
        LightCluster::layout(),
        LightDisc::layout(),
        TransportParameters::layout(),
        ReceiverOnDevice::layout(),
        FoundEntry::layout(),
        DirectLight::layout(),
    ]
}

/// Declarations of all structures and constants.
pub(super) fn declarations() -> String {
    let mut text = String::new();
    for layout in layouts() {
        text.push_str(&layout.declaration());
    }
    for (name, value) in [
        ("MIN_WEIGHT", MIN_WEIGHT),
        ("MIN_TRANSMITTANCE", MIN_TRANSMITTANCE),
        ("MIN_COSINE", MIN_COSINE),
        ("FREE", FREE),
        ("OWN_COSINE", OWN_COSINE),
        ("START_MIN_ALPHA", start::MIN_ALPHA),
        ("OFFSET_DEVIATIONS", start::OFFSET_DEVIATIONS),
        ("MIN_OFFSET_SIZES", start::MIN_OFFSET_SIZES),
        ("MAX_OFFSET_SIZES", start::MAX_OFFSET_SIZES),
        ("MAX_SLANT", start::MAX_SLANT),
        ("MAX_EXPONENT", MAX_EXPONENT),
        ("MIN_LOBE_ALPHA", bsdf::MIN_ALPHA),
        ("FULL_GRAZING_SPECULAR", bsdf::FULL_GRAZING_SPECULAR),
        ("BSDF_MIN_COSINE", bsdf::MIN_COSINE),
        ("MIN_REFLECTANCE", vertex::MIN_REFLECTANCE),
        ("ROUGH_BEHIND", vertex::ROUGH_BEHIND),
    ]
    .into_iter()
    .chain(FUNCTION_CONSTANTS)
    {
        write_line(&mut text, format_args!("const {name}: f32 = {value:?};"));
    }
    for (name, value) in [
        ("GROUP_SIZE", GROUP_SIZE),
        ("MAX_GROUP_SIZE", SCAN_THREADS),
        ("TILE", TILE),
        ("TILE_PIXELS", TILE_PIXELS),
        ("TILES_PER_DISPATCH", TILES_PER_DISPATCH),
        ("SPLIT_EDGE", SPLIT_EDGE),
        ("RAYS_PER_AXIS", CameraRays::RAYS_PER_AXIS),
        ("PENDING", PENDING),
        ("KEY_SHIFT", KEY_SHIFT),
        ("FARTHEST_KEY", FARTHEST_KEY),
        ("CHUNK_HITS", CHUNK_HITS),
        ("CHUNK_WORDS", CHUNK_WORDS),
        ("PIXEL_WORDS", PIXEL_WORDS),
        ("FIRST_RAY", FIRST_RAY),
        ("TOWARDS_LIGHT", TOWARDS_LIGHT),
        ("ROULETTE", ROULETTE),
        ("LAST_BOUNCE", LAST_BOUNCE),
        ("GATHER", GATHER),
        ("LOBE_TABLE", bsdf::TABLE as u32),
        ("LOBE_ALBEDOS", bsdf::NUM_LOBE_ALBEDOS as u32),
        ("NUM_REALIZATIONS", NUM_REALIZATIONS),
        ("MAX_CLUSTERS", MAX_CLUSTERS as u32),
        ("NUM_FUNCTIONS", NUM_FUNCTIONS as u32),
        ("NOTHING", NOTHING),
        ("EMITTER", EMITTER),
        ("STACK", bvh::STACK),
        ("NO_NODE", bvh::NO_NODE),
        ("SCAN_THREADS", SCAN_THREADS),
        ("SCAN_PER_THREAD", SCAN_PER_THREAD),
        ("SCAN_BLOCK", SCAN_BLOCK),
        ("SORT_THREADS", SORT_THREADS),
        ("SORT_PER_THREAD", SORT_PER_THREAD),
        ("SORT_BLOCK", SORT_BLOCK),
        ("SORT_DIGITS", SORT_DIGITS),
        ("SORT_ROW", SORT_ROW),
        ("SORT_COUNTERS", SORT_COUNTERS),
    ]
    .into_iter()
    .chain(PLACES)
    {
        write_line(&mut text, format_args!("const {name}: u32 = {value}u;"));
    }
    text
}

/// The first 16 bits of a four-dimensional Sobol point by the reversed bits of its number, as the
/// library of [`crate::transport::points`] has them: one line for each bit.
pub(super) fn sobol_function() -> String {
    let mut text = String::from("fn sobol_rev(index: u32) -> vec4u {\n    var point = vec4u();\n");
    for bit in (16..u32::BITS).rev() {
        let [x, y, z, w] = [0, 1, 2, 3].map(|axis| sobol_burley::parts::sobol_rev(1 << bit, axis));
        write_line(
            &mut text,
            format_args!("    point ^= vec4u({x}u, {y}u, {z}u, {w}u) * ((index >> {bit}u) & 1u);"),
        );
    }
    text.push_str("    return point;\n}\n");
    text
}
