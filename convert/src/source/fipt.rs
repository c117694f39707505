//! Real scenes of FIPT (factorised inverse path tracing, ICCV 2023).
//!
//! `cam.txt` has the number of cameras, then three lines each: origin, look-at point, up.
//! `K_list.txt` has the number, then three rows each of K. Images are `Image/{i:03}_0001.exr`,
//! linear, all of one size. The world is y up. FIPT has no split of its own.
//!
//! `segmentation/` and `scene.obj` are not read.

use super::{SourceDataset, SourceFiles, SourceFormat, SourceFrame, points_beside, size_of};
use crate::error::{ConvertError, Result};
use crate::options::ImportOptions;
use crate::world::from_look_at;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::lens::LensModel;
use eagpt_scene::{Lens, files};
use glam::DVec3;
use std::path::Path;

/// Poses.
pub(crate) const CAMERAS_FILE: &str = "cam.txt";
/// Intrinsics.
pub(crate) const INTRINSICS_FILE: &str = "K_list.txt";
/// Lines of a camera in either file.
const LINES_PER_CAMERA: usize = 3;

pub(super) fn read(root: &Path, _options: &ImportOptions) -> Result<SourceDataset> {
    let cameras_file = root.join(CAMERAS_FILE);
    let intrinsics_file = root.join(INTRINSICS_FILE);
    let cameras = Table::read(&cameras_file)?;
    let intrinsics = Table::read(&intrinsics_file)?;
    if cameras.num_cameras() != intrinsics.num_cameras() {
        let problem = format!(
            "{} cameras, but {CAMERAS_FILE} has {}",
            intrinsics.num_cameras(),
            cameras.num_cameras()
        );
        return Err(ConvertError::invalid(&intrinsics_file, "line 1", problem));
    }
    let mut source = SourceDataset::new(SourceFormat::Fipt, root, cameras_file.clone());
    source.info.up_axis = Some(UpAxis::Y);
    source.points = points_beside(root);
    let mut common_size = None;
    for index in 0..cameras.num_cameras() {
        let name = format!("{index:03}");
        let mut read = || -> Result<SourceFrame> {
            let radiance = root.join("Image").join(format!("{name}_0001.exr"));
            let size = size_of(&radiance)?;
            let expected = *common_size.get_or_insert(size);
            if size != expected {
                let problem = format!(
                    "{}x{}, but the first image is {}x{}",
                    size.0, size.1, expected.0, expected.1
                );
                return Err(ConvertError::invalid(&radiance, "size", problem));
            }
            let [origin, target, up] = cameras.rows(index);
            let world_from_camera = from_look_at(origin, target, up)
                .map_err(|problem| cameras.invalid(index, problem))?;
            Ok(SourceFrame {
                name: name.clone(),
                lens: pinhole(intrinsics.rows(index), size)
                    .map_err(|problem| intrinsics.invalid(index, problem))?,
                world_from_camera,
                files: SourceFiles {
                    radiance,
                    ..SourceFiles::default()
                },
            })
        };
        let frame = read();
        source.add(&name, frame);
    }
    source.notes.push(
        "cameras of cam.txt and K_list.txt, y up; FIPT's loader also multiplies some scenes by hdr_radiance_scale, as --radiance-scale does"
            .to_owned(),
    );
    Ok(source)
}

/// The pinhole of a K matrix, rows from the top.
fn pinhole(rows: [DVec3; 3], size: (u32, u32)) -> Result<Lens, String> {
    let [x, y, z] = rows;
    if x.y != 0.0 || y.x != 0.0 {
        return Err(format!("K has skew: {x}, {y}"));
    }
    if z != DVec3::Z {
        return Err(format!("the last row of K is {z}, not [0, 0, 1]"));
    }
    Lens::new(LensModel::Pinhole, size, &[x.x, y.y, x.z, y.z])
}

/// A count, then three lines of three numbers for each camera.
struct Table<'a> {
    path: &'a Path,
    /// With the number of the line.
    lines: Vec<(usize, DVec3)>,
}

impl<'a> Table<'a> {
    fn read(path: &'a Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let invalid = |line: usize, problem: String| {
            ConvertError::invalid(path, format!("line {line}"), problem)
        };
        let text = String::from_utf8(bytes)
            .map_err(|error| ConvertError::invalid(path, "text", error.utf8_error().to_string()))?;
        let mut filled = (1..)
            .zip(text.lines())
            .filter(|(_, line)| !line.trim().is_empty());
        let (first, count) = filled
            .next()
            .ok_or_else(|| invalid(1, "the number of cameras is missing".to_owned()))?;
        // Some writers put it as 3.000000e+00.
        let num = count.trim().parse::<f64>().ok();
        let num = num.filter(|num| num.fract() == 0.0 && (1.0..=1e6).contains(num));
        let num = num.ok_or_else(|| {
            let text: String = count.chars().take(40).collect();
            invalid(
                first,
                format!("`{}` is not a number of cameras", text.escape_debug()),
            )
        })? as usize;
        let mut lines = Vec::new();
        for (number, line) in filled {
            let row = three_numbers(line).ok_or_else(|| {
                let text: String = line.chars().take(60).collect();
                invalid(
                    number,
                    format!("`{}` is not three finite numbers", text.escape_debug()),
                )
            })?;
            lines.push((number, row));
        }
        if lines.len() != LINES_PER_CAMERA * num {
            let problem = format!(
                "{num} cameras, which take {} lines, but {} follow",
                LINES_PER_CAMERA * num,
                lines.len()
            );
            return Err(invalid(first, problem));
        }
        Ok(Self { path, lines })
    }

    fn num_cameras(&self) -> usize {
        self.lines.len() / LINES_PER_CAMERA
    }

    fn rows(&self, camera: usize) -> [DVec3; 3] {
        [0, 1, 2].map(|row| self.lines[LINES_PER_CAMERA * camera + row].1)
    }

    fn invalid(&self, camera: usize, problem: String) -> ConvertError {
        let (line, _) = self.lines[LINES_PER_CAMERA * camera];
        ConvertError::invalid(self.path, format!("line {line}"), problem)
    }
}

fn three_numbers(line: &str) -> Option<DVec3> {
    let numbers: Option<Vec<f64>> = line
        .split_whitespace()
        .map(|word| word.parse::<f64>().ok().filter(|n| n.is_finite()))
        .collect();
    match numbers?.as_slice() {
        [x, y, z] => Some(DVec3::new(*x, *y, *z)),
        _ => None,
    }
}
