//! How Rust and WGSL lay out the structures that they share.

use crate::surfel::Surfel;
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
        b"array<vec4u, 512>" => (8192, 16),
        b"Surfel" => (size_of::<Surfel>(), 16),
        _ => (0, 0),
    }
}

/// Appends a line.
pub(super) fn write_line(text: &mut String, line: std::fmt::Arguments<'_>) {
    text.write_fmt(line)
        .and_then(|()| text.write_char('\n'))
        .expect("a String takes all that is written");
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
