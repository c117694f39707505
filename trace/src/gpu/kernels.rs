//! All kernels: their files, and the buffers that Rust binds to them, in the order of
//! [`super::Device::pass`]. A test holds the table against the modules.

use super::declarations::GROUP_SIZE;
use super::declarations::camera::{Band, Seen, SplitPixels, View};
use super::declarations::light::{Emitter, Gathered, LightParameters, PathState, RayQuery};
use super::declarations::matrix::{
    DirectLight, FoundEntry, LightCluster, LightDisc, ReceiverOnDevice, TransportParameters,
};
use super::declarations::sort::{ScanParameters, SortParameters};
use super::shader::{self, Sources};
use crate::attributes::Attributes;
use crate::blend::{Contribution, LocalGradient};
use crate::features::Features;
use crate::surfel::Surfel;

/// An entry point of a WGSL file, and its bindings.
#[derive(Debug)]
pub struct Kernel {
    pub(super) entry: &'static str,
    pub(super) file: &'static str,
    /// Names that `#ifdef` of the file asks for.
    pub(super) defines: &'static [&'static str],
    sources: Sources,
    pub(super) bindings: &'static [Binding],
}

/// A buffer of a kernel.
#[derive(Debug)]
pub struct Binding {
    /// Its number.
    pub number: u32,
    /// Its variable.
    pub name: &'static str,
    /// Its kind of memory.
    pub access: Access,
    /// Bytes of the structure of a uniform, or of an element of an array.
    pub bytes: usize,
}

/// Kind of memory of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Parameters.
    Uniform,
    /// Storage that is read.
    Read,
    /// Storage that is written, and perhaps read.
    Write,
}

impl Kernel {
    /// See [`kernels!`].
    pub const fn new(
        (file, entry): (&'static str, &'static str),
        defines: &'static [&'static str],
        sources: Sources,
        bindings: &'static [Binding],
    ) -> Self {
        Self {
            entry,
            file,
            defines,
            sources,
            bindings,
        }
    }

    /// The text of its module.
    ///
    /// # Errors
    /// A line that says which directive of a file cannot be followed.
    pub fn source(&self) -> Result<String, String> {
        shader::preprocess(self.sources, self.file, self.defines)
    }

    /// File and entry point.
    pub fn name(&self) -> (&'static str, &'static str) {
        (self.file, self.entry)
    }

    /// Names that `#ifdef` of its file asks for.
    pub fn defines(&self) -> &'static [&'static str] {
        self.defines
    }

    /// Its buffers.
    pub fn bindings(&self) -> &'static [Binding] {
        self.bindings
    }
}

/// A table of kernels, in the order of their files: `KERNEL = "file" entry [defines] { buffers }`,
/// a buffer being `number name: access element`. `ALL` are all of them.
#[macro_export]
macro_rules! kernels {
    ($sources:path; $(
        $(#[$doc:meta])*
        $kernel:ident = $file:literal $entry:ident [$($define:literal),*] {
            $($number:literal $name:ident: $access:ident $element:ty),* $(,)?
        }
    )*) => {
        $(
            $(#[$doc])*
            pub(super) static $kernel: $crate::gpu::kernel::Kernel =
                $crate::gpu::kernel::Kernel::new(
                    ($file, stringify!($entry)),
                    &[$($define),*],
                    $sources,
                    &[$($crate::gpu::kernel::Binding {
                        number: $number,
                        name: stringify!($name),
                        access: $crate::gpu::kernel::Access::$access,
                        bytes: size_of::<$element>(),
                    }),*],
                );
        )*
        #[cfg(test)]
        pub(super) static ALL: &[&$crate::gpu::kernel::Kernel] = &[$(&$kernel),*];
    };
}
pub use kernels;

/// A node of a tree is two of them.
type HalfNode = [f32; 4];

kernels! { shader::sources;
    SCAN_BLOCKS = "scan" scan_blocks [] {
        0 scan: Uniform ScanParameters, 1 values: Write u32, 2 block_sums: Write u32,
    }
    SCAN_ADD = "scan" scan_add [] {
        0 scan: Uniform ScanParameters, 1 values: Write u32, 2 block_sums: Write u32,
    }
    SORT_COUNT = "sort" sort_count [] {
        0 sort: Uniform SortParameters, 1 counts: Read u32, 2 keys: Read u32, 4 places: Write u32,
    }
    SORT_SCATTER = "sort" sort_scatter [] {
        0 sort: Uniform SortParameters, 1 counts: Read u32, 2 keys: Read u32, 3 values: Read u32,
        4 places: Write u32, 5 sorted_keys: Write u32, 6 sorted_values: Write u32,
    }

    PROJECT = "bins_project" project [] {
        0 view: Uniform View, 1 surfels: Read Surfel, 2 seen_surfels: Write Seen,
        3 rects: Write [u32; 2], 4 keys: Write u32, 5 values: Write u32,
    }
    EVALUATE_HARMONICS = "harmonics_view" evaluate_harmonics [] {
        0 view: Uniform View, 1 surfels: Read Surfel, 2 attributes: Read Attributes,
        3 harmonics: Read f32, 4 seen_attributes: Write Attributes,
    }
    COUNT_ENTRIES = "bins_expand" count_entries [] {
        0 view: Uniform View, 1 order: Read u32, 2 rects: Read [u32; 2], 3 starts: Write u32,
    }
    EXPAND = "bins_expand" expand [] {
        0 view: Uniform View, 1 order: Read u32, 2 rects: Read [u32; 2], 3 starts: Write u32,
        4 counters: Write u32, 5 keys: Write u32, 6 values: Write u32, 7 entry_surfels: Write u32,
    }
    LIST = "bins_lists" list [] {
        0 view: Uniform View, 1 counters: Read u32, 2 sorted_tiles: Read u32,
        3 sorted_entries: Read u32, 4 entry_surfels: Read u32, 5 listed: Write [u32; 2],
        6 places: Write u32, 7 list_starts: Write u32,
    }

    TRACE_TILES = "camera" trace_tiles ["tile_lists"] {
        0 view: Uniform View, 1 band: Uniform Band, 2 list_starts: Read u32,
        3 listed: Read [u32; 2], 4 seen_surfels: Read Seen, 5 attributes: Read Attributes,
        6 features: Write Features, 10 split: Uniform SplitPixels,
    }
    TRACE_AND_RECORD_TILES = "camera" trace_tiles ["tile_lists", "record"] {
        0 view: Uniform View, 1 band: Uniform Band, 2 list_starts: Read u32,
        3 listed: Read [u32; 2], 4 seen_surfels: Read Seen, 5 attributes: Read Attributes,
        6 features: Write Features, 7 record: Write u32, 8 masks: Write u32, 9 counters: Write u32,
        10 split: Uniform SplitPixels,
    }

    COUNT_HITS = "adjoint_count" count_hits [] {
        2 masks: Read [u32; 2], 3 hit_starts: Write u32,
    }
    WEIGH_HITS = "adjoint_weights" weigh_hits [] {
        0 view: Uniform View, 1 band: Uniform Band, 2 record: Read u32, 3 listed: Read [u32; 2],
        4 seen_surfels: Read Seen, 5 attributes: Read Attributes, 6 d_features: Read Features,
        7 masks: Read [u32; 2], 8 hit_starts: Read u32, 9 hits: Write [f32; 2],
        10 split: Uniform SplitPixels,
    }
    ADD_GRADIENT_ROWS = "adjoint_rows" add_rows [] {
        0 view: Uniform View, 1 band: Uniform Band, 2 listed: Read [u32; 2],
        3 masks: Read [u32; 2], 4 hit_starts: Read u32, 5 hits: Read [f32; 2],
        6 rows: Write LocalGradient, 10 seen_surfels: Read Seen, 11 d_features: Read Features,
    }
    GATHER_GRADIENT_ROWS = "adjoint_gather" gather_rows [] {
        0 view: Uniform View, 1 band: Uniform Band, 2 order: Read u32, 3 entry_starts: Read u32,
        4 places: Read u32, 5 masks: Read [u32; 2], 6 rows: Read LocalGradient,
        7 gathered: Write LocalGradient,
    }
    ADD_CONTRIBUTION_ROWS = "adjoint_rows" add_rows ["contributions"] {
        0 view: Uniform View, 1 band: Uniform Band, 2 listed: Read [u32; 2],
        3 masks: Read [u32; 2], 4 hit_starts: Read u32, 5 hits: Read [f32; 2],
        6 rows: Write Contribution, 10 values: Read f32,
    }
    GATHER_CONTRIBUTION_ROWS = "adjoint_gather" gather_rows ["contributions"] {
        0 view: Uniform View, 1 band: Uniform Band, 2 order: Read u32, 3 entry_starts: Read u32,
        4 places: Read u32, 5 masks: Read [u32; 2], 6 rows: Read Contribution,
        7 gathered: Write Contribution,
    }

    BLEND_RAYS = "rays" blend_rays [] {
        1 light: Uniform LightParameters, 2 surfels: Read Surfel, 3 attributes: Read Attributes,
        4 nodes: Read HalfNode, 5 leaf_indices: Read u32, 6 rays: Read RayQuery,
        7 ray_features: Write Features,
    }
    SAMPLE_RAYS = "rays" sample_rays [] {
        1 light: Uniform LightParameters, 2 surfels: Read Surfel, 3 attributes: Read Attributes,
        4 nodes: Read HalfNode, 5 leaf_indices: Read u32, 6 rays: Read RayQuery,
        7 ray_features: Write Features,
    }
    BLEND_GLOSSY_RAYS = "rays" blend_rays ["ray_gloss"] {
        1 light: Uniform LightParameters, 2 surfels: Read Surfel, 3 attributes: Read Attributes,
        4 nodes: Read HalfNode, 5 leaf_indices: Read u32, 6 rays: Read RayQuery,
        7 ray_features: Write Features, 8 glosses: Read [f32; 4], 9 ray_glosses: Write [f32; 4],
    }
    SAMPLE_GLOSSY_RAYS = "rays" sample_rays ["ray_gloss"] {
        1 light: Uniform LightParameters, 2 surfels: Read Surfel, 3 attributes: Read Attributes,
        4 nodes: Read HalfNode, 5 leaf_indices: Read u32, 6 rays: Read RayQuery,
        7 ray_features: Write Features, 8 glosses: Read [f32; 4], 9 ray_glosses: Write [f32; 4],
    }
    FREE_RAYS = "free_rays" find_free_rays [] {
        1 light: Uniform LightParameters, 2 surfels: Read Surfel, 4 nodes: Read HalfNode,
        5 leaf_indices: Read u32, 6 rays: Read RayQuery, 7 distances: Read f32,
        8 is_free: Write u32,
    }
    GATHER_BOUNCES = "bounce" gather_bounces [] {
        0 view: Uniform View, 1 light: Uniform LightParameters, 2 surfels: Read Surfel,
        3 attributes: Read Attributes, 4 nodes: Read HalfNode, 5 leaf_indices: Read u32,
        6 emitters: Read Emitter, 7 features: Read Features, 8 gathered: Write Gathered,
    }
    AIM_RAYS = "path" aim_rays [] {
        0 view: Uniform View, 1 light: Uniform LightParameters, 6 emitters: Read Emitter,
        7 features: Read Features, 8 gathered: Write Gathered, 9 paths: Write PathState,
        10 rays: Write RayQuery,
    }
    GATHER_GLOSSY_BOUNCES = "bounce" gather_bounces ["gloss"] {
        0 view: Uniform View, 1 light: Uniform LightParameters, 2 surfels: Read Surfel,
        3 attributes: Read Attributes, 4 nodes: Read HalfNode, 5 leaf_indices: Read u32,
        6 emitters: Read Emitter, 7 features: Read Features, 8 gathered: Write Gathered,
        12 pixel_glosses: Read [f32; 4], 13 lobe_albedos: Uniform [f32; 4],
    }
    AIM_GLOSSY_RAYS = "path" aim_rays ["gloss"] {
        0 view: Uniform View, 1 light: Uniform LightParameters, 6 emitters: Read Emitter,
        7 features: Read Features, 8 gathered: Write Gathered, 9 paths: Write PathState,
        10 rays: Write RayQuery, 12 pixel_glosses: Read [f32; 4],
        13 lobe_albedos: Uniform [f32; 4],
    }
    SHADE_GLOSSY_RAYS = "path" shade_rays ["gloss"] {
        1 light: Uniform LightParameters, 4 nodes: Read HalfNode, 5 leaf_indices: Read u32,
        6 emitters: Read Emitter, 8 gathered: Write Gathered, 9 paths: Write PathState,
        10 rays: Write RayQuery, 11 ray_features: Read Features,
        13 lobe_albedos: Uniform [f32; 4], 14 ray_glosses: Read [f32; 4],
    }
    SHADE_RAYS = "path" shade_rays [] {
        1 light: Uniform LightParameters, 4 nodes: Read HalfNode, 5 leaf_indices: Read u32,
        6 emitters: Read Emitter, 8 gathered: Write Gathered, 9 paths: Write PathState,
        10 rays: Write RayQuery, 11 ray_features: Read Features,
    }

    FOLLOW_DIRECTIONS = "matrix" follow_directions [] {
        1 light: Uniform TransportParameters, 2 surfels: Read Surfel,
        3 attributes: Read Attributes, 4 nodes: Read HalfNode, 5 leaf_indices: Read u32,
        6 light_discs: Read LightDisc, 7 radii: Read f32, 8 receivers: Read ReceiverOnDevice,
        9 found: Write FoundEntry, 12 light_clusters: Uniform LightCluster,
    }
    ADD_UP = "matrix" add_up [] {
        1 light: Uniform TransportParameters, 9 found: Write FoundEntry, 10 targets: Write u32,
        11 direct: Write DirectLight,
    }
}

/// Workgroups in which each of `num_invocations` has a place.
pub const fn groups(num_invocations: u32) -> u32 {
    num_invocations.div_ceil(GROUP_SIZE)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use eagpt_testkit::kernels;

    /// Without an adapter: every kernel is valid, asks for no more than WebGPU has, and has the
    /// bindings of the table.
    #[test]
    fn kernels_are_those_of_the_table() {
        for kernel in ALL {
            let bindings: Vec<kernels::Binding> = kernel.bindings.iter().map(binding).collect();
            let (name, source) = (format!("{:?}", kernel.name()), kernel.source().unwrap());
            assert_eq!(
                kernels::check(&name, &source, kernel.entry, &bindings),
                Ok(())
            );
        }
    }

    /// Every file of the folder is in the table, is valid by itself and so imports all it needs;
    /// every entry point has a kernel.
    #[test]
    fn files_import_what_they_use() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/shader");
        let all = ALL.iter().map(|kernel| {
            let (file, entry) = kernel.name();
            (file, entry, kernel.defines())
        });
        let all: Vec<_> = all.collect();
        let files: Vec<&str> = shader::FILES.iter().map(|(path, _)| *path).collect();
        let source =
            |name: &str, defines: &[&str]| shader::preprocess(shader::sources, name, defines);
        kernels::check_folder(folder, &files, &all, source).unwrap();
    }

    fn binding(of: &Binding) -> kernels::Binding {
        kernels::Binding {
            number: of.number,
            name: of.name.to_owned(),
            is_uniform: of.access == Access::Uniform,
            is_written: of.access == Access::Write,
            bytes: of.bytes as u32,
        }
    }
}
