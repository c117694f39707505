//! WGSL modules, checked without a device.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Module};

/// Storage buffers that a kernel may bind (WebGPU, `maxStorageBuffersPerShaderStage`).
const MAX_STORAGE_BUFFERS: usize = 8;
/// Invocations of a workgroup (`maxComputeInvocationsPerWorkgroup`).
const MAX_INVOCATIONS: u32 = 256;
/// Bytes of a workgroup's memory (`maxComputeWorkgroupStorageSize`).
const MAX_WORKGROUP_BYTES: u32 = 16 << 10;

/// Checks that `source` is a valid module whose kernels keep to what every device of WebGPU has: no
/// extensions, at most eight storage buffers, 256 invocations and 16 KiB for a workgroup.
///
/// # Errors
/// All that is wrong with it, each with `name` before it.
pub fn check(name: &str, source: &str) -> Result<(), String> {
    let parsed = naga::front::wgsl::parse_str(source)
        .map_err(|error| format!("{name}: {}", error.emit_to_string(source)))?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let info = validator
        .validate(&parsed)
        .map_err(|error| format!("{name}: {}", error.emit_to_string(source)))?;
    if parsed.entry_points.is_empty() {
        return Err(format!("{name}: no kernel"));
    }
    let mut problems = Vec::new();
    for (number, kernel) in parsed.entry_points.iter().enumerate() {
        let info = info.get_entry_point(number);
        let used = |is_meant: fn(AddressSpace) -> bool| {
            let all = parsed.global_variables.iter();
            all.filter(move |(handle, variable)| {
                !info[*handle].is_empty() && is_meant(variable.space)
            })
        };
        let num_buffers = used(|space| matches!(space, AddressSpace::Storage { .. })).count();
        let bytes: u32 = used(|space| space == AddressSpace::WorkGroup)
            .map(|(_, variable)| size_of_type(&parsed, variable.ty))
            .sum();
        let invocations: u32 = kernel.workgroup_size.iter().product();
        for (what, is, most) in [
            (
                "storage buffers",
                num_buffers as u32,
                MAX_STORAGE_BUFFERS as u32,
            ),
            ("invocations of a workgroup", invocations, MAX_INVOCATIONS),
            ("bytes of a workgroup", bytes, MAX_WORKGROUP_BYTES),
        ] {
            if is > most {
                problems.push(format!(
                    "{name}: {}: {is} {what}, at most {most}",
                    kernel.name
                ));
            }
        }
    }
    if problems.is_empty() {
        Ok(())
    } else {
        Err(problems.join("\n"))
    }
}

fn size_of_type(module: &Module, of: naga::Handle<naga::Type>) -> u32 {
    module.types[of].inner.size(module.to_ctx())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernel(num_buffers: u32, num_words: u32, num_threads: u32) -> String {
        let buffers: String = (0..num_buffers)
            .map(|i| {
                format!("@group(0) @binding({i}) var<storage, read_write> b{i}: array<u32>;\n")
            })
            .collect();
        let uses: String = (0..num_buffers)
            .map(|i| format!("b{i}[0] = words[thread];\n"))
            .collect();
        format!(
            "{buffers}var<workgroup> words: array<u32, {num_words}>;
            @compute @workgroup_size({num_threads})
            fn fill(@builtin(local_invocation_index) thread: u32) {{ {uses} }}"
        )
    }

    #[test]
    fn what_every_device_has_is_enough() {
        assert_eq!(check("full", &kernel(8, 4096, 256)), Ok(()));
    }

    #[test]
    fn everything_beyond_is_told() {
        assert_eq!(
            check("greedy", &kernel(9, 4097, 257)),
            Err("greedy: fill: 9 storage buffers, at most 8\n\
                 greedy: fill: 257 invocations of a workgroup, at most 256\n\
                 greedy: fill: 16388 bytes of a workgroup, at most 16384"
                .to_owned())
        );
    }

    #[test]
    fn what_is_no_module_of_kernels_is_told() {
        assert_eq!(check("empty", ""), Err("empty: no kernel".to_owned()));
        for wrong in ["fn", "fn f() -> u32 { return 1.5; }"] {
            let problem = check("wrong", wrong).unwrap_err();
            assert!(problem.starts_with("wrong: "), "{problem}");
        }
    }
}
