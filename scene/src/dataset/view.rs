//! The images of one frame, loaded and checked.

use super::frame::Frame;
use crate::camera::Camera;
use crate::error::{Result, SceneError};
use crate::exr;
use crate::image::Image;
use glam::Vec3;
use std::path::Path;

/// Tolerance beyond 0 to 1 within which masks are clamped: the overshoot of half precision and
/// resampling.
const MASK_TOLERANCE: f32 = 1e-3;
/// Normals shorter than this are taken as unknown.
pub const MIN_NORMAL_LENGTH: f32 = 1e-3;
/// Normals nearer than this to unit length stay as they are.
const NORMAL_TOLERANCE: f32 = 1e-6;

/// A frame with its images, all of one size.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Name of the frame.
    pub name: String,
    /// Camera of the images.
    pub camera: Camera,
    /// Linear Rec.709 radiance, finite and not negative, premultiplied by opacity as stored.
    pub radiance: Image<3>,
    /// Emission mask, 0 to 1.
    pub emission: Option<Image<1>>,
    /// World-space unit normals; zero where unknown.
    pub normal: Option<Image<3>>,
    /// Opacity, 0 to 1.
    pub alpha: Option<Image<1>>,
    /// Depth along the optical axis, scene units; 0 where nothing was hit.
    pub depth: Option<Image<1>>,
    /// Diffuse albedo, finite and not negative.
    pub albedo: Option<Image<3>>,
    /// Specular reflectance at normal incidence (F0), finite and not negative.
    pub specular: Option<Image<3>>,
    /// Perceptual roughness, 0 to 1; without meaning where the specular reflectance is 0.
    pub roughness: Option<Image<1>>,
    /// 1 in channels whose radiance is a lower bound, as a clipped photograph tells; else 0. `None`
    /// where all radiance is the truth.
    pub clipped: Option<Image<3>>,
    /// 1 where the images are known; 0 where no lens showed anything, and the other images are 0
    /// whatever their files hold. `None` where all pixels are known.
    pub valid: Option<Image<1>>,
}

/// Whether a value of a mask of known pixels says so: a pixel that is known in part shows something
/// that is not there.
pub fn is_known(value: f32) -> bool {
    value >= 1.0 - MASK_TOLERANCE
}

/// Share of normals that have to be turned to the camera: maps of a network have errors, mostly at
/// grazing angles; of a mesh that is open to the other side all are turned away.
pub const MIN_FACING: f64 = 0.9;

/// Share of the known ones of some world-space normals that are turned to the camera, 0 to 1; `None`
/// where none is known.
pub fn share_facing(camera: &Camera, normal: &Image<3>) -> Option<f64> {
    let rays = camera.ray_frame();
    let width = normal.width() as usize;
    let (mut num_known, mut num_facing) = (0_usize, 0_usize);
    for (index, pixel) in normal.pixels().iter().enumerate() {
        let vector = Vec3::from(*pixel);
        if vector.length() >= MIN_NORMAL_LENGTH {
            num_known += 1;
            let at = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            num_facing += usize::from(vector.dot(rays.direction(at.0, at.1)) < 0.0);
        }
    }
    (num_known > 0).then(|| num_facing as f64 / num_known as f64)
}

impl View {
    /// A view of which the radiance is known and nothing else.
    pub fn new(name: String, camera: Camera, radiance: Image<3>) -> Self {
        Self {
            name,
            camera,
            radiance,
            emission: None,
            normal: None,
            alpha: None,
            depth: None,
            albedo: None,
            specular: None,
            roughness: None,
            clipped: None,
            valid: None,
        }
    }

    /// Bytes held by the images.
    pub fn num_bytes(&self) -> usize {
        let single = |image: &Option<Image<1>>| image.as_ref().map_or(0, Image::num_bytes);
        let colour = |image: &Option<Image<3>>| image.as_ref().map_or(0, Image::num_bytes);
        self.radiance.num_bytes()
            + [
                &self.emission,
                &self.alpha,
                &self.depth,
                &self.roughness,
                &self.valid,
            ]
            .map(single)
            .iter()
            .sum::<usize>()
            + [&self.normal, &self.albedo, &self.specular, &self.clipped]
                .map(colour)
                .iter()
                .sum::<usize>()
    }

    /// The view with the pixels that are `hidden` unknown, row by row.
    pub fn without(&self, hidden: &[bool]) -> Self {
        let mut view = self.clone();
        let (width, height) = (self.radiance.width(), self.radiance.height());
        let valid = (view.valid).get_or_insert_with(|| Image::filled(width, height, [1.0]));
        for (known, _) in valid
            .pixels_mut()
            .iter_mut()
            .zip(hidden)
            .filter(|(_, hidden)| **hidden)
        {
            *known = [0.0];
        }
        view.clear_unknown();
        view
    }

    /// Sets all images to 0 where they are not known, so that nothing depends on what the files
    /// hold there.
    fn clear_unknown(&mut self) {
        fn clear<const C: usize>(image: &mut Image<C>, valid: &Image<1>) {
            for (pixel, [known]) in image.pixels_mut().iter_mut().zip(valid.pixels()) {
                if *known == 0.0 {
                    *pixel = [0.0; C];
                }
            }
        }
        let Some(valid) = &self.valid else { return };
        clear(&mut self.radiance, valid);
        let colour = [
            &mut self.normal,
            &mut self.albedo,
            &mut self.specular,
            &mut self.clipped,
        ];
        for image in colour.into_iter().flatten() {
            clear(image, valid);
        }
        let single = [
            &mut self.emission,
            &mut self.alpha,
            &mut self.depth,
            &mut self.roughness,
        ];
        for image in single.into_iter().flatten() {
            clear(image, valid);
        }
    }
}

pub(super) fn load(frame: &Frame) -> Result<View> {
    let files = &frame.files;
    let radiance = exr::read_rgb(&files.radiance)?;
    let size = (frame.camera.width, frame.camera.height);
    check_size(
        &files.radiance,
        &radiance,
        size,
        "the dataset was opened with",
    )?;
    let valid = load_valid(files.valid.as_deref(), size)?;
    let mut view = View {
        name: frame.name.clone(),
        camera: frame.camera,
        radiance,
        emission: load_single(files.emission.as_deref(), size)?,
        normal: load_rgb(files.normal.as_deref(), size, exr::read_vectors)?,
        alpha: load_single(files.alpha.as_deref(), size)?,
        depth: load_single(files.depth.as_deref(), size)?,
        albedo: load_rgb(files.albedo.as_deref(), size, exr::read_rgb)?,
        specular: load_rgb(files.specular.as_deref(), size, exr::read_rgb)?,
        roughness: load_single(files.roughness.as_deref(), size)?,
        clipped: load_clipped(files.clipped.as_deref(), size)?,
        valid,
    };
    view.clear_unknown();
    check_light(&files.radiance, &view.radiance)?;
    if let (Some(path), Some(mask)) = (&files.emission, &mut view.emission) {
        clamp_mask(path, mask)?;
    }
    if let (Some(path), Some(mask)) = (&files.alpha, &mut view.alpha) {
        clamp_mask(path, mask)?;
    }
    if let (Some(path), Some(depth)) = (&files.depth, &mut view.depth) {
        check_depth(path, depth)?;
    }
    if let (Some(path), Some(normal)) = (&files.normal, &mut view.normal) {
        normalise(path, normal)?;
    }
    for (path, reflectance) in [
        (&files.albedo, &view.albedo),
        (&files.specular, &view.specular),
    ] {
        if let (Some(path), Some(reflectance)) = (path, reflectance) {
            check_light(path, reflectance)?;
        }
    }
    if let (Some(path), Some(roughness)) = (&files.roughness, &mut view.roughness) {
        clamp_mask(path, roughness)?;
    }
    Ok(view)
}

fn load_rgb(
    path: Option<&Path>,
    size: (u32, u32),
    read: fn(&Path) -> Result<Image<3>>,
) -> Result<Option<Image<3>>> {
    let Some(path) = path else { return Ok(None) };
    let image = read(path)?;
    check_size(path, &image, size, "the radiance is")?;
    Ok(Some(image))
}

fn load_single(path: Option<&Path>, size: (u32, u32)) -> Result<Option<Image<1>>> {
    let Some(path) = path else { return Ok(None) };
    let image = exr::read_single(path)?;
    check_size(path, &image, size, "the radiance is")?;
    Ok(Some(image))
}

/// The mask as 0 and 1, which is from half on; `None` where it says nothing.
fn load_clipped(path: Option<&Path>, size: (u32, u32)) -> Result<Option<Image<3>>> {
    let Some(mut mask) = load_rgb(path, size, exr::read_vectors)? else {
        return Ok(None);
    };
    if let Some(path) = path {
        clamp_mask(path, &mut mask)?;
    }
    for value in mask.pixels_mut().as_flattened_mut() {
        *value = value.round();
    }
    let is_any = mask.values().iter().any(|value| *value > 0.0);
    Ok(is_any.then_some(mask))
}

/// The mask as 0 and 1; `None` where it says nothing.
fn load_valid(path: Option<&Path>, size: (u32, u32)) -> Result<Option<Image<1>>> {
    let Some(mut mask) = load_single(path, size)? else {
        return Ok(None);
    };
    if let Some(path) = path {
        clamp_mask(path, &mut mask)?;
    }
    for [value] in mask.pixels_mut() {
        *value = f32::from(u8::from(is_known(*value)));
    }
    let all_known = mask.values().iter().all(|value| *value > 0.0);
    Ok((!all_known).then_some(mask))
}

fn check_size<const C: usize>(
    path: &Path,
    image: &Image<C>,
    wanted: (u32, u32),
    who: &str,
) -> Result<()> {
    if image.size() == wanted {
        return Ok(());
    }
    let (width, height) = image.size();
    let problem = format!("{width}x{height}, but {who} {}x{}", wanted.0, wanted.1);
    Err(SceneError::invalid(path, "size", problem))
}

/// Refuses an image that has values that are bad.
///
/// # Errors
/// [`SceneError::Invalid`] naming the first pixel with a channel that `is_bad`, the value, `what`
/// it is, and how many pixels are like it.
pub fn refuse<const C: usize>(
    path: &Path,
    image: &Image<C>,
    what: &str,
    is_bad: impl Fn(f32) -> bool,
) -> Result<()> {
    let Some(first) = image.values().iter().position(|&value| is_bad(value)) else {
        return Ok(());
    };
    let num_bad = image
        .pixels()
        .iter()
        .filter(|p| p.iter().any(|&v| is_bad(v)))
        .count();
    let (pixel, channel) = (first / C, first % C);
    let width = image.width() as usize;
    let channel = match (C, channel) {
        (3, 0) => " channel R",
        (3, 1) => " channel G",
        (3, 2) => " channel B",
        _ => "",
    };
    Err(SceneError::invalid(
        path,
        format!("pixel ({}, {}){channel}", pixel % width, pixel / width),
        format!(
            "{:?} {what}; {num_bad} of {} pixels are like this",
            image.values()[first],
            image.pixels().len()
        ),
    ))
}

fn check_light(path: &Path, image: &Image<3>) -> Result<()> {
    refuse(path, image, "is not finite and at least 0", |v| {
        !(v.is_finite() && v >= 0.0)
    })
}

/// Refuses a mask with values outside 0 to 1, but for rounding.
///
/// # Errors
/// As [`refuse`].
pub fn check_mask<const C: usize>(path: &Path, mask: &Image<C>) -> Result<()> {
    refuse(path, mask, "is outside 0 to 1", |v| {
        !(-MASK_TOLERANCE..=1.0 + MASK_TOLERANCE).contains(&v)
    })
}

fn clamp_mask<const C: usize>(path: &Path, mask: &mut Image<C>) -> Result<()> {
    check_mask(path, mask)?;
    for value in mask.pixels_mut().as_flattened_mut() {
        *value = value.clamp(0.0, 1.0);
    }
    Ok(())
}

/// Renderers write a huge depth where they hit nothing, which is infinite in half precision.
fn check_depth(path: &Path, depth: &mut Image<1>) -> Result<()> {
    refuse(path, depth, "is not a depth", |v| v.is_nan() || v < 0.0)?;
    for [value] in depth.pixels_mut() {
        if value.is_infinite() {
            *value = 0.0;
        }
    }
    Ok(())
}

fn normalise(path: &Path, normal: &mut Image<3>) -> Result<()> {
    refuse(path, normal, "is not finite", |v| !v.is_finite())?;
    for pixel in normal.pixels_mut() {
        let vector = Vec3::from_array(*pixel);
        let length = vector.length();
        if length < MIN_NORMAL_LENGTH {
            *pixel = [0.0; 3];
        } else if (length - 1.0).abs() > NORMAL_TOLERANCE {
            *pixel = (vector / length).to_array();
        }
    }
    Ok(())
}
