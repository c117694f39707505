//! WGSL files of `shader/`, and a preprocessor for their imports.
//!
//! A line `#import name` puts the text of that file there, once in a module. `#ifdef name`, `#else`
//! and `#endif` choose between lines, for kernels that share a file. Names of structures and
//! constants that Rust declares are in the file `declarations`, which is generated.

use super::declarations;
use std::borrow::Cow;

/// Finds the text of a file by its name.
pub type Sources = fn(&str) -> Option<Cow<'static, str>>;

/// A table of files of the folder `shader/` of a crate: paths without `.wgsl`, and texts.
#[macro_export]
macro_rules! shaders {
    ($($path:literal)*) => {
        &[$((
            $path,
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shader/", $path, ".wgsl")),
        )),*]
    };
}
pub use shaders;

/// All files of this crate.
pub(super) const FILES: &[(&str, &str)] = shaders! {
    "adjoint_count" "adjoint_gather" "adjoint_rows" "adjoint_weights"
    "bins_expand" "bins_lists" "bins_project" "bounce" "camera" "harmonics_view"
    "free_rays" "matrix" "path" "rays" "scan" "sort"
    "shared/band" "shared/blend" "shared/bsdf" "shared/bvh" "shared/camera_no_record" "shared/camera_record" "shared/color"
    "shared/contribution_row" "shared/exp" "shared/features" "shared/gloss_blend" "shared/gradient_row"
    "shared/harmonics" "shared/integrator" "shared/light_list" "shared/lights"
    "shared/path_diffuse" "shared/path_glossy" "shared/pending" "shared/pixel_gloss" "shared/points"
    "shared/prefix_sum" "shared/random" "shared/ray_grid" "shared/ray_search" "shared/sampling" "shared/surface"
    "shared/surfel" "shared/tile_lists" "shared/tile_rect" "shared/view" "shared/workgroup"
};

/// The files of this crate, and what Rust declares.
pub fn sources(name: &str) -> Option<Cow<'static, str>> {
    match name {
        "declarations" => Some(declarations::declarations().into()),
        "sobol" => Some(declarations::sobol_function().into()),
        _ => find(FILES, name),
    }
}

/// The file `name` of a table; the folder `shared/` is no part of a name.
pub fn find(files: &[(&str, &'static str)], name: &str) -> Option<Cow<'static, str>> {
    let is_it = |path: &str| path.strip_prefix("shared/").unwrap_or(path) == name;
    let found = files.iter().find(|(path, _)| is_it(path));
    found.map(|&(_, text)| text.into())
}

/// The file `name` with everything it imports; `defines` are the names that `#ifdef` asks for.
///
/// # Errors
/// A line that says what is wrong with a directive.
pub fn preprocess(sources: Sources, name: &str, defines: &[&str]) -> Result<String, String> {
    let mut module = Preprocessor {
        sources,
        defines,
        begun: Vec::new(),
        ended: Vec::new(),
        text: String::new(),
    };
    module.add(name)?;
    Ok(module.text)
}

struct Preprocessor<'a> {
    sources: Sources,
    defines: &'a [&'a str],
    /// Files whose text is not complete: each imports the next one.
    begun: Vec<String>,
    ended: Vec<String>,
    text: String,
}

impl Preprocessor<'_> {
    fn add(&mut self, name: &str) -> Result<(), String> {
        if self.ended.iter().any(|other| other == name) {
            return Ok(());
        }
        let is_begun = self.begun.iter().any(|other| other == name);
        self.begun.push(name.to_owned());
        if is_begun {
            return Err(format!("cyclic import: {}", self.begun.join(" > ")));
        }
        let source = (self.sources)(name)
            .ok_or_else(|| format!("there is no such file: {}", self.begun.join(" > ")))?;
        // Whether the lines of each open `#ifdef` are taken.
        let mut taken: Vec<bool> = Vec::new();
        let mut lines = String::with_capacity(source.len());
        for line in source.lines() {
            let is_taken = taken.iter().all(|&one| one);
            let Some(directive) = line.strip_prefix('#') else {
                if is_taken {
                    lines.push_str(line);
                    lines.push('\n');
                }
                continue;
            };
            let wrong = || format!("{name}: cannot be followed: {line}");
            let (word, argument) = directive.split_once(' ').unwrap_or((directive, ""));
            match word {
                "import" if is_taken => self.add(argument)?,
                "import" => {}
                "ifdef" => taken.push(self.defines.contains(&argument)),
                "else" => {
                    let last = taken.last_mut().ok_or_else(wrong)?;
                    *last = !*last;
                }
                "endif" => taken.pop().map(|_| ()).ok_or_else(wrong)?,
                _ => return Err(wrong()),
            }
        }
        if !taken.is_empty() {
            return Err(format!("{name}: #ifdef without #endif"));
        }
        self.text.push_str(&lines);
        self.ended.extend(self.begun.pop());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(name: &str) -> Option<Cow<'static, str>> {
        let files = [
            ("a", "#import b\n#import c\nA\n"),
            ("b", "#import c\nB\n"),
            ("c", "C\n"),
            ("choice", "#ifdef x\n#import b\nX\n#else\nY\n#endif\nZ\n"),
            ("around", "#import and\n"),
            ("and", "#import around\n"),
            ("lost", "#import nowhere\n"),
            ("open", "#ifdef x\n"),
            ("shut", "#endif\n"),
            ("odd", "#include b\n"),
        ];
        find(&files, name)
    }

    fn of(name: &str, defines: &[&str]) -> Result<String, String> {
        preprocess(text, name, defines)
    }

    #[test]
    fn imports_come_once_and_before_those_who_ask() {
        assert_eq!(of("a", &[]).as_deref(), Ok("C\nB\nA\n"));
    }

    #[test]
    fn lines_are_chosen_by_name() {
        assert_eq!(of("choice", &[]).as_deref(), Ok("Y\nZ\n"));
        assert_eq!(of("choice", &["x"]).as_deref(), Ok("C\nB\nX\nZ\n"));
    }

    #[test]
    fn wrong_directives_are_told() {
        for (name, message) in [
            ("around", "cyclic import: around > and > around"),
            ("lost", "there is no such file: lost > nowhere"),
            ("open", "open: #ifdef without #endif"),
            ("shut", "shut: cannot be followed: #endif"),
            ("odd", "odd: cannot be followed: #include b"),
        ] {
            assert_eq!(of(name, &[]), Err(message.to_owned()));
        }
    }
}
