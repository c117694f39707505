//! Checks of the images of one view.

use super::report::{ImageKind, ValueRange, ViewCheck};
use crate::error::Problem;
use crate::surface::normals_from_depth;
use eagpt_scene::dataset::{MIN_NORMAL_LENGTH, check_mask, is_known, refuse, share_facing};
use eagpt_scene::{Frame, Image, Result, exr};
use glam::Vec3;
use std::path::{Path, PathBuf};

/// Tolerance of the length of known normals before a warning.
const MAX_LENGTH_ERROR: f32 = 0.05;

/// Findings about one view: statistics, value ranges by kind, errors.
pub(super) struct Looked {
    pub(super) view: ViewCheck,
    pub(super) ranges: Vec<(ImageKind, ValueRange)>,
    pub(super) problems: Vec<Problem>,
    /// Median of depth over the depth of points, if there are both.
    pub(super) depth_over_points: Option<f64>,
}

/// Checks all images of a view, even if some are bad. `points` is a sample of the cloud.
pub(super) fn look(frame: &Frame, points: &[Vec3]) -> Looked {
    let mut looked = Looked {
        view: ViewCheck {
            name: frame.name.clone(),
            size: [frame.camera.width, frame.camera.height],
            ..ViewCheck::default()
        },
        ranges: Vec::new(),
        problems: Vec::new(),
        depth_over_points: None,
    };
    let files = &frame.files;
    if let Some((radiance, path)) =
        looked.read(ImageKind::Radiance, Some(&files.radiance), exr::read_rgb)
    {
        looked.radiance(&radiance, path);
    }
    let emission = files.emission.as_ref();
    if let Some((mask, path)) = looked.read(ImageKind::Emission, emission, exr::read_single) {
        looked.check(check_mask(path, &mask));
        looked.view.emission = Some(share(mask.values(), |v| v >= 0.5));
    }
    let alpha = files.alpha.as_ref();
    if let Some((mask, path)) = looked.read(ImageKind::Alpha, alpha, exr::read_single) {
        looked.check(check_mask(path, &mask));
    }
    let valid = files.valid.as_ref();
    if let Some((mask, _)) = looked.read(ImageKind::Valid, valid, exr::read_single) {
        looked.view.valid = Some(share(mask.values(), is_known));
    }
    for (kind, file) in [
        (ImageKind::Albedo, files.albedo.as_ref()),
        (ImageKind::Specular, files.specular.as_ref()),
    ] {
        if let Some((reflectance, path)) = looked.read(kind, file, exr::read_rgb) {
            let is_bad = |v: f32| !(v.is_finite() && v >= 0.0);
            let problem = "is not finite and at least 0";
            looked.check(refuse(path, &reflectance, problem, is_bad));
        }
    }
    let roughness = files.roughness.as_ref();
    if let Some((roughness, path)) = looked.read(ImageKind::Roughness, roughness, exr::read_single)
    {
        looked.check(check_mask(path, &roughness));
    }
    let depth = looked.read(ImageKind::Depth, files.depth.as_ref(), exr::read_single);
    if let Some((depth, path)) = &depth {
        let is_bad = |v: f32| v.is_nan() || v < 0.0;
        looked.check(refuse(path, depth, "is not a depth", is_bad));
        looked.view.depth = Some(share(depth.values(), |v| v > 0.0 && v.is_finite()));
        looked.depth_over_points = depth_over_points(depth, frame, points);
    }
    let normal = files.normal.as_ref();
    if let Some((normal, path)) = looked.read(ImageKind::Normal, normal, exr::read_vectors) {
        looked.check(refuse(path, &normal, "is not finite", |v| !v.is_finite()));
        looked.normals(&normal, depth.as_ref().map(|(depth, _)| depth), frame);
    }
    looked
}

impl Looked {
    fn problem(&mut self, problem: impl std::fmt::Display) {
        self.problems.push(Problem::new(&self.view.name, problem));
    }

    /// The image of a kind, if it is there, can be read and has the right size.
    fn read<'a, const C: usize>(
        &mut self,
        kind: ImageKind,
        path: Option<&'a PathBuf>,
        read: impl Fn(&Path) -> Result<Image<C>>,
    ) -> Option<(Image<C>, &'a Path)> {
        let path = path?;
        let image = match read(path) {
            Ok(image) => image,
            Err(error) => {
                self.problem(error);
                return None;
            }
        };
        self.ranges.push((kind, ValueRange::of(image.values())));
        let expected: (u32, u32) = self.view.size.into();
        if image.size() == expected {
            return Some((image, path));
        }
        let (width, height) = image.size();
        self.problem(format!(
            "{}: size: {width}x{height}, but the radiance is {}x{}",
            path.display(),
            expected.0,
            expected.1
        ));
        None
    }

    fn check(&mut self, outcome: Result<()>) {
        if let Err(error) = outcome {
            self.problem(error);
        }
    }

    fn radiance(&mut self, image: &Image<3>, path: &Path) {
        self.check(refuse(path, image, "is not finite", |v| !v.is_finite()));
        self.check(refuse(path, image, "is negative", |v| v < 0.0));
        let count = |is: &dyn Fn(f32) -> bool| {
            let has = |pixel: &&[f32; 3]| pixel.iter().any(|v| is(*v));
            image.pixels().iter().filter(has).count()
        };
        self.view.num_not_finite = count(&|v| !v.is_finite());
        self.view.num_negative = count(&|v| v < 0.0);
        let finite = image.values().iter().copied().filter(|v| v.is_finite());
        let most = finite.fold(0.0, f32::max);
        self.view.max_radiance = most;
        if most > 0.0 {
            self.view.num_at_maximum = count(&|v| v == most);
        }
        let luminances = image.pixels().iter();
        let luminances = luminances.map(|rgb| f64::from(eagpt_scene::color::luminance(*rgb)));
        let (sum, num) = luminances
            .filter(|l| l.is_finite())
            .fold((0.0, 0.0_f64), |(sum, num), l| (sum + l, num + 1.0));
        self.view.mean_luminance = sum / num.max(1.0);
    }

    fn normals(&mut self, normal: &Image<3>, depth: Option<&Image<1>>, frame: &Frame) {
        let known = |pixel: &[f32; 3]| Vec3::from(*pixel).length() >= MIN_NORMAL_LENGTH;
        let lengths = || {
            let known = normal.pixels().iter().filter(|pixel| known(pixel));
            known.map(|pixel| Vec3::from(*pixel).length())
        };
        let num_known = lengths().count();
        let num_long = lengths().filter(|length| (length - 1.0).abs() > MAX_LENGTH_ERROR);
        let all = normal.pixels().len().max(1);
        self.view.normal = Some(num_known as f64 / all as f64);
        self.view.normals_facing = share_facing(&frame.camera, normal);
        if num_known > 0 {
            self.view.normals_not_unit = Some(num_long.count() as f64 / num_known as f64);
        }
        if let Some(depth) = depth {
            let spanned = normals_from_depth(depth, &frame.camera);
            let pairs = normal.pixels().iter().zip(spanned.pixels());
            let both = pairs.filter(|(a, b)| known(a) && known(b));
            let angles = both.map(|(a, b)| {
                let cosine = Vec3::from(*a).normalize().dot(Vec3::from(*b));
                f64::from(cosine.clamp(-1.0, 1.0)).acos().to_degrees()
            });
            self.view.normal_from_depth_deg = median(angles.collect());
        }
    }
}

fn share(values: &[f32], is: impl Fn(f32) -> bool) -> f64 {
    let num = values.iter().filter(|v| is(**v)).count();
    num as f64 / values.len().max(1) as f64
}

/// Median ratio of depths to those of points in the picture; occluded points make it smaller than
/// 1.
fn depth_over_points(depth: &Image<1>, frame: &Frame, points: &[Vec3]) -> Option<f64> {
    let ratios = points.iter().filter_map(|point| {
        let at = frame.camera.project(*point);
        let inside = at.z > 0.0 && at.x >= 0.0 && at.y >= 0.0;
        if !inside || at.x >= depth.width() as f32 || at.y >= depth.height() as f32 {
            return None;
        }
        let [stored] = depth.get(at.x as u32, at.y as u32);
        (stored > 0.0 && stored.is_finite()).then(|| f64::from(stored / at.z))
    });
    median(ratios.collect())
}

/// The median; `None` if empty.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
