//! Names of frames, from paths of images.

use std::path::{Component, Path};

/// Whether `name` can name a frame. Names become paths of results: they must stay inside the folder
/// they are put in, and on one line of a message.
pub fn is_frame_name(name: &str) -> bool {
    let mut components = Path::new(name).components().peekable();
    components.peek().is_some()
        && components.all(|part| matches!(part, Component::Normal(_)))
        && !name.contains(|c: char| c == '\\' || c.is_control())
}

/// Takes the folder of the images off names that are paths, `images/10/a`: what is shared up to a
/// folder `images` (`images_2`, …), or all folders that are shared where there is none of that
/// name. What lies within the folder of the images is part of a name, shared or not: it is where
/// other images of the frame are.
pub fn strip_image_folder(names: &mut [&mut String]) {
    let folder_of = |name: &str| name.rfind('/').map_or(0, |slash| slash + 1);
    let Some(first) = names.first().map(|name| (**name).clone()) else {
        return;
    };
    let mut common = &first[..folder_of(&first)];
    for other in names.iter() {
        while !other.starts_with(common) {
            common = &common[..folder_of(common.trim_end_matches('/'))];
        }
    }
    let mut end = 0;
    for folder in common.split_inclusive('/') {
        end += folder.len();
        let name = folder.trim_end_matches('/');
        if name == "images" || name.starts_with("images_") {
            break;
        }
    }
    for name in names {
        name.drain(..end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_begin_within_the_folder_of_images() {
        for (paths, wanted) in [
            (["images/10/a", "images/11/a"], ["10/a", "11/a"]),
            (["images/cam/a", "images/cam/b"], ["cam/a", "cam/b"]),
            (["x/images_2/cam/a", "x/images_2/cam/b"], ["cam/a", "cam/b"]),
            (
                ["images/images/a", "images/images/b"],
                ["images/a", "images/b"],
            ),
            (["train/a", "train/b"], ["a", "b"]),
            (["x/cam/a", "x/camera/a"], ["cam/a", "camera/a"]),
            (["a", "images/b"], ["a", "images/b"]),
        ] {
            let mut names = paths.map(str::to_owned);
            strip_image_folder(&mut names.each_mut());
            assert_eq!(names, wanted);
        }
    }
}
