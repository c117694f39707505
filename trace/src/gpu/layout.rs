//! Structures and constants that kernels and Rust share: written down once, in Rust, and declared
//! in WGSL from there.

use super::bins::{self, Seen, View};
use super::kernels::GROUP_SIZE;
use super::{adjoint, bvh, camera, capacity, light, light_list, matrix, rays, scan, sort};
use crate::blend::Contribution;
use crate::cpu::bins::MARGIN_PIXELS;
use crate::features::lane;
use crate::model::{MIN_COSINE, MIN_TRANSMITTANCE, MIN_WEIGHT, OWN_COSINE};
use crate::surfel::Surfel;
use crate::transport::light_list::MAX_CLUSTERS;
use crate::transport::matrix::{EMITTER, NOTHING, NUM_REALIZATIONS};
use crate::transport::{bsdf, start, vertex};
use eagpt_scene::harmonics::{FUNCTION_CONSTANTS, MAX_EXPONENT, NUM_FUNCTIONS};
use std::fmt::Write as _;

/// A structure of kernels, as Rust lays it out.
#[derive(Debug)]
pub struct Layout {
    name: &'static str,
    size: usize,
    members: &'static [Member],
}

/// A member of a [`Layout`].
#[derive(Debug)]
pub struct Member {
    /// Its name, the same in WGSL.
    pub name: &'static str,
    /// Its type in WGSL.
    pub wgsl: &'static str,
    /// Bytes from the start of the structure.
    pub offset: usize,
}

/// The [`Layout`] of a `#[repr(C)]` structure, members with their types in WGSL. Does not compile
/// where WGSL would lay it out in another way.
#[macro_export]
macro_rules! layout {
    ($rust:ty { $($member:ident: $wgsl:literal),* $(,)? }) => {{
        const LAYOUT: $crate::gpu::kernel::Layout = $crate::gpu::kernel::Layout::new(
            stringify!($rust),
            size_of::<$rust>(),
            &[$($crate::gpu::kernel::Member {
                name: stringify!($member),
                wgsl: $wgsl,
                offset: std::mem::offset_of!($rust, $member),
            }),*],
        );
        const { assert!(LAYOUT.is_that_of_wgsl(), "WGSL lays this structure out in another way") };
        LAYOUT
    }};
}
pub use layout;

impl Layout {
    /// A structure of `size` bytes; see [`layout!`].
    pub const fn new(name: &'static str, size: usize, members: &'static [Member]) -> Self {
        Self {
            name,
            size,
            members,
        }
    }

    /// Whether WGSL puts all members where Rust does.
    pub const fn is_that_of_wgsl(&self) -> bool {
        let (mut end, mut largest, mut i) = (0_usize, 4_usize, 0);
        while i < self.members.len() {
            let (size, align) = size_and_align(self.members[i].wgsl);
            if end.next_multiple_of(align) != self.members[i].offset {
                return false;
            }
            end = self.members[i].offset + size;
            largest = if align > largest { align } else { largest };
            i += 1;
        }
        end.next_multiple_of(largest) == self.size
    }

    /// Its declaration in WGSL.
    pub fn declaration(&self) -> String {
        let mut text = format!("struct {} {{\n", self.name);
        for member in self.members {
            write_line(
                &mut text,
                format_args!("    {}: {},", member.name, member.wgsl),
            );
        }
        text.push_str("}\n");
        text
    }
}

/// Size and alignment of a WGSL type (WGSL specification, section "Alignment and Size").
const fn size_and_align(wgsl: &str) -> (usize, usize) {
    match wgsl.as_bytes() {
        b"f32" | b"u32" => (4, 4),
        b"vec2u" | b"vec2f" => (8, 8),
        b"vec3f" => (12, 16),
        b"vec4f" | b"vec4u" => (16, 16),
        b"array<vec4f, 2>" => (32, 16),
        b"array<vec4f, 4>" => (64, 16),
        b"array<vec4f, 5>" => (80, 16),
        b"array<u32, 3>" => (12, 4),
        b"Surfel" => (size_of::<Surfel>(), 16),
        _ => (0, 0),
    }
}

fn write_line(text: &mut String, line: std::fmt::Arguments<'_>) {
    text.write_fmt(line)
        .and_then(|()| text.write_char('\n'))
        .expect("a String takes all that is written");
}

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
        camera::Band::layout(),
        scan::ScanParameters::layout(),
        sort::SortParameters::layout(),
        light::LightParameters::layout(),
        rays::RayQuery::layout(),
        light::Emitter::layout(),
        light::Gathered::layout(),
        light::PathState::layout(),
        light_list::LightCluster::layout(),
        light_list::LightDisc::layout(),
        matrix::TransportParameters::layout(),
        matrix::ReceiverOnDevice::layout(),
        matrix::FoundEntry::layout(),
        matrix::DirectLight::layout(),
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
        ("OWN_COSINE", OWN_COSINE),
        ("BIN_MARGIN_PIXELS", MARGIN_PIXELS),
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
        ("MAX_GROUP_SIZE", scan::THREADS),
        ("TILE", bins::TILE),
        ("TILE_PIXELS", bins::TILE_PIXELS),
        ("PENDING", camera::PENDING),
        ("KEY_SHIFT", bins::KEY_SHIFT),
        ("FARTHEST_KEY", bins::FARTHEST_KEY),
        ("CHUNK_HITS", adjoint::CHUNK_HITS),
        ("CHUNK_WORDS", adjoint::CHUNK_WORDS),
        ("PIXEL_WORDS", adjoint::PIXEL_WORDS),
        ("FIRST_RAY", light::FIRST_RAY),
        ("TOWARDS_LIGHT", light::TOWARDS_LIGHT),
        ("ROULETTE", light::ROULETTE),
        ("LAST_BOUNCE", light::LAST_BOUNCE),
        ("GATHER", light::GATHER),
        ("LOBE_TABLE", bsdf::TABLE as u32),
        ("LOBE_ALBEDOS", bsdf::NUM_LOBE_ALBEDOS as u32),
        ("NUM_REALIZATIONS", NUM_REALIZATIONS),
        ("MAX_CLUSTERS", MAX_CLUSTERS as u32),
        ("NUM_FUNCTIONS", NUM_FUNCTIONS as u32),
        ("NOTHING", NOTHING),
        ("EMITTER", EMITTER),
        ("STACK", bvh::STACK),
        ("NO_NODE", bvh::NO_NODE),
        ("SCAN_THREADS", scan::THREADS),
        ("SCAN_PER_THREAD", scan::PER_THREAD),
        ("SCAN_BLOCK", scan::BLOCK),
        ("SORT_THREADS", sort::THREADS),
        ("SORT_PER_THREAD", sort::PER_THREAD),
        ("SORT_BLOCK", sort::BLOCK),
        ("SORT_DIGITS", sort::DIGITS),
        ("SORT_ROW", sort::ROW),
        ("SORT_COUNTERS", sort::COUNTERS),
    ]
    .into_iter()
    .chain(capacity::PLACES)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_that_wgsl_would_not_have_is_found_out() {
        const fn member(name: &'static str, wgsl: &'static str, offset: usize) -> Member {
            Member { name, wgsl, offset }
        }
        // A vector of three after a scalar begins at 16, not at 4; a structure ends at a multiple
        // of its alignment.
        const GOOD: Layout =
            Layout::new("A", 32, &[member("a", "f32", 0), member("b", "vec3f", 16)]);
        const PACKED: Layout =
            Layout::new("B", 16, &[member("a", "f32", 0), member("b", "vec3f", 4)]);
        const SHORT: Layout =
            Layout::new("C", 28, &[member("a", "f32", 0), member("b", "vec3f", 16)]);
        assert!(GOOD.is_that_of_wgsl());
        assert!(!PACKED.is_that_of_wgsl());
        assert!(!SHORT.is_that_of_wgsl());
    }
}
