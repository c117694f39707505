//! WGSL modules, checked by reflection without a device.

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, GlobalVariable, Module, StorageAccess};
use std::path::Path;

/// Storage buffers that a kernel may bind (WebGPU, `maxStorageBuffersPerShaderStage`).
const MAX_STORAGE_BUFFERS: u32 = 8;
/// Invocations of a workgroup (`maxComputeInvocationsPerWorkgroup`).
const MAX_INVOCATIONS: u32 = 256;
/// Bytes of a workgroup's memory (`maxComputeWorkgroupStorageSize`).
const MAX_WORKGROUP_BYTES: u32 = 16 << 10;

/// A buffer that Rust binds to a kernel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Binding {
    /// Its number, in group 0.
    pub number: u32,
    /// Its variable.
    pub name: String,
    /// Whether it is no storage buffer.
    pub is_uniform: bool,
    /// Whether storage may be written.
    pub is_written: bool,
    /// Bytes of the structure of a uniform, or of an element of an array.
    pub bytes: u32,
}

/// Checks that `source` is a valid module with a kernel `entry` that has exactly these `bindings`,
/// and that keeps to what every device of WebGPU has: no extensions, at most eight storage buffers,
/// 256 invocations and 16 KiB for a workgroup.
///
/// # Errors
/// All that is wrong with it, each with `name` before it.
pub fn check(name: &str, source: &str, entry: &str, bindings: &[Binding]) -> Result<(), String> {
    let (module, info) = parse(name, source)?;
    let kernels = &module.entry_points;
    let Some(number) = kernels.iter().position(|kernel| kernel.name == entry) else {
        return Err(format!("{name}: no kernel {entry}"));
    };
    let info = info.get_entry_point(number);
    let used: Vec<_> = (module.global_variables.iter())
        .filter(|(handle, _)| !info[*handle].is_empty())
        .map(|(_, variable)| variable)
        .collect();
    let is_storage = |space| matches!(space, AddressSpace::Storage { .. });
    let num_buffers = used.iter().filter(|one| is_storage(one.space)).count();
    let bytes: u32 = (used
        .iter()
        .filter(|one| one.space == AddressSpace::WorkGroup))
    .map(|variable| size_of_type(&module, variable.ty))
    .sum();
    let invocations: u32 = kernels[number].workgroup_size.iter().product();
    let mut problems = Vec::new();
    for (what, is, most) in [
        ("storage buffers", num_buffers as u32, MAX_STORAGE_BUFFERS),
        ("invocations of a workgroup", invocations, MAX_INVOCATIONS),
        ("bytes of a workgroup", bytes, MAX_WORKGROUP_BYTES),
    ] {
        if is > most {
            problems.push(format!("{name}: {entry}: {is} {what}, at most {most}"));
        }
    }
    let mut unbound: Vec<&Binding> = bindings.iter().collect();
    for variable in used {
        let Some(found) = reflect(&module, variable) else {
            continue;
        };
        match unbound.iter().position(|one| **one == found) {
            Some(at) => {
                unbound.swap_remove(at);
            }
            None => problems.push(format!("{name}: {entry}: not bound from Rust: {found:?}")),
        }
    }
    for one in unbound {
        problems.push(format!("{name}: {entry}: not in the module: {one:?}"));
    }
    if problems.is_empty() {
        Ok(())
    } else {
        Err(problems.join("\n"))
    }
}

/// A kernel: its file, its entry point, and the names that `#ifdef` of the file asks for.
pub(crate) type KernelName<'a> = (&'a str, &'a str, &'a [&'a str]);

/// Checks that `files` are all WGSL files below `folder`, paths without `.wgsl`; that each is valid
/// by itself with all it imports, as `source` puts it together for its name and names that `#ifdef`
/// asks for; and that `kernels` are all kernels.
///
/// # Errors
/// The first that is wrong.
pub fn check_folder(
    folder: &str,
    files: &[&str],
    kernels: &[KernelName<'_>],
    source: impl Fn(&str, &[&str]) -> Result<String, String>,
) -> Result<(), String> {
    let mut on_disk =
        wgsl_files(folder.as_ref(), "").map_err(|error| format!("{folder}: {error}"))?;
    let mut listed: Vec<String> = files.iter().map(|&file| file.to_owned()).collect();
    on_disk.sort();
    listed.sort();
    if on_disk.is_empty() || on_disk != listed {
        return Err(format!(
            "{folder}: has {on_disk:?}, embedded are {listed:?}"
        ));
    }
    for file in files {
        let name = file.strip_prefix("shared/").unwrap_or(file);
        // Files without kernels are imported by any.
        let own: Vec<_> = kernels.iter().filter(|(of, ..)| of == file).collect();
        let all: Vec<_> = kernels.iter().collect();
        let used = if own.is_empty() { all } else { own };
        let mut permutations: Vec<&[&str]> = used.iter().map(|(.., defines)| *defines).collect();
        permutations.push(&[]);
        permutations.sort_unstable();
        permutations.dedup();
        for defines in permutations {
            let (module, _) = parse(file, &source(name, defines)?)?;
            for kernel in &module.entry_points {
                let is_it = |(of, entry, _): &&KernelName<'_>| of == file && *entry == kernel.name;
                if kernels.iter().find(is_it).is_none() {
                    return Err(format!("{file}: Rust does not know {}", kernel.name));
                }
            }
        }
    }
    Ok(())
}

fn wgsl_files(folder: &Path, before: &str) -> std::io::Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type()?.is_dir() {
            found.extend(wgsl_files(&entry.path(), &format!("{before}{name}/"))?);
        } else if let Some(stem) = name.strip_suffix(".wgsl") {
            found.push(format!("{before}{stem}"));
        }
    }
    Ok(found)
}

fn parse(name: &str, source: &str) -> Result<(Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(source)
        .map_err(|error| format!("{name}: {}", error.emit_to_string(source)))?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let info = validator
        .validate(&module)
        .map_err(|error| format!("{name}: {}", error.emit_to_string(source)))?;
    Ok((module, info))
}

/// A variable as Rust would bind it; `None` for memory of workgroups.
fn reflect(module: &Module, variable: &GlobalVariable) -> Option<Binding> {
    let binding = variable.binding.as_ref()?;
    let name = variable.name.clone().unwrap_or_default();
    let bytes = match module.types[variable.ty].inner {
        naga::TypeInner::Array { stride, .. } => stride,
        _ => size_of_type(module, variable.ty),
    };
    Some(Binding {
        number: binding.binding,
        name,
        is_uniform: variable.space == AddressSpace::Uniform,
        is_written: matches!(variable.space, AddressSpace::Storage { access }
            if access.contains(StorageAccess::STORE)),
        bytes,
    })
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

    fn bindings(num: u32) -> Vec<Binding> {
        (0..num)
            .map(|number| Binding {
                number,
                name: format!("b{number}"),
                is_uniform: false,
                is_written: true,
                bytes: 4,
            })
            .collect()
    }

    #[test]
    fn what_every_device_has_is_enough() {
        let source = kernel(8, 4096, 256);
        assert_eq!(check("full", &source, "fill", &bindings(8)), Ok(()));
    }

    #[test]
    fn everything_beyond_is_told() {
        assert_eq!(
            check("greedy", &kernel(9, 4097, 257), "fill", &bindings(9)),
            Err("greedy: fill: 9 storage buffers, at most 8\n\
                 greedy: fill: 257 invocations of a workgroup, at most 256\n\
                 greedy: fill: 16388 bytes of a workgroup, at most 16384"
                .to_owned())
        );
    }

    #[test]
    fn bindings_that_differ_are_told() {
        let source = kernel(2, 64, 64);
        let wrong = |change: fn(&mut Binding)| {
            let mut all = bindings(2);
            change(&mut all[1]);
            check("two", &source, "fill", &all).unwrap_err()
        };
        for problem in [
            wrong(|one| one.number = 2),
            wrong(|one| one.name = "b0".to_owned()),
            wrong(|one| one.is_uniform = true),
            wrong(|one| one.is_written = false),
            wrong(|one| one.bytes = 8),
        ] {
            assert!(problem.contains("not bound from Rust"), "{problem}");
            assert!(problem.contains("not in the module"), "{problem}");
        }
        let more = check("two", &source, "fill", &bindings(3)).unwrap_err();
        assert!(more.contains("b2") && !more.contains('\n'), "{more}");
        let fewer = check("two", &source, "fill", &bindings(1)).unwrap_err();
        assert!(fewer.contains("b1") && !fewer.contains('\n'), "{fewer}");
    }

    #[test]
    fn what_is_no_module_of_kernels_is_told() {
        let no_kernel = Err("empty: no kernel fill".to_owned());
        assert_eq!(check("empty", "", "fill", &[]), no_kernel);
        for wrong in ["fn", "fn f() -> u32 { return 1.5; }"] {
            let problem = check("wrong", wrong, "f", &[]).unwrap_err();
            assert!(problem.starts_with("wrong: "), "{problem}");
        }
    }

    #[test]
    fn a_folder_without_shaders_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().to_str().unwrap();
        let source = |_: &str, _: &[&str]| Ok("fn f() {}".to_owned());
        assert!(check_folder(path, &[], &[], source).is_err());
        std::fs::create_dir(folder.path().join("shared")).unwrap();
        std::fs::write(folder.path().join("shared/a.wgsl"), "").unwrap();
        assert_eq!(check_folder(path, &["shared/a"], &[], source), Ok(()));
        assert!(check_folder(path, &["shared/b"], &[], source).is_err());
        let kernel = |_: &str, _: &[&str]| Ok(kernel(1, 1, 1));
        assert!(check_folder(path, &["shared/a"], &[], kernel).is_err());
        let kernels: &[KernelName<'_>] = &[("shared/a", "fill", &["x"])];
        assert_eq!(check_folder(path, &["shared/a"], kernels, kernel), Ok(()));
    }
}
