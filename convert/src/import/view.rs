//! The images of one frame: read, converted, resampled.

use super::report::ViewReport;
use crate::error::{ConvertError, Result};
use crate::source::{Emission, SourceFrame};
use crate::world::turned;
use eagpt_scene::lens::Undistortion;
use eagpt_scene::pictures;
use eagpt_scene::{Camera, Image, View, exr};
use glam::{DMat3, DVec3, Vec3};
use std::path::Path;

/// Vectors shorter than this after resampling are taken as unknown: a mean of opposing normals.
const MIN_NORMAL_LENGTH: f32 = 0.1;
/// Share of clipped light from which on a resampled channel is a lower bound.
const MIN_CLIPPED: f32 = 0.01;

/// Bookkeeping of a view whose images have been written.
pub(super) struct Imported {
    pub(super) camera: Camera,
    pub(super) report: ViewReport,
}

/// Converts and writes the images of a frame.
pub(super) fn convert(
    frame: &SourceFrame,
    undistortion: &Undistortion,
    color: Option<&DMat3>,
    new_from_source: DMat3,
) -> Result<(View, Imported)> {
    let files = &frame.files;
    let expected = frame.lens.size();
    let mut light = pictures::read_light(&files.radiance)?;
    check(&files.radiance, &light.radiance, expected)?;
    let num_negative = to_rec709(&mut light.radiance, color);
    let resample = |path: &Path, problem: String| ConvertError::invalid(path, "size", problem);
    let remapped = undistortion
        .apply(&light.radiance)
        .map_err(|problem| resample(&files.radiance, problem))?;

    let single = |path: &Path, image: Image<1>| -> Result<Image<1>> {
        check(path, &image, expected)?;
        let picked = undistortion.apply_nearest(&image);
        picked.map_err(|problem| resample(path, problem))
    };
    let smooth = |path: &Path, image: &Image<3>| -> Result<Image<3>> {
        let smooth = undistortion.apply(image);
        Ok(smooth.map_err(|problem| resample(path, problem))?.image)
    };
    let colour = |path: &Path| -> Result<Image<3>> {
        let image = exr::read_rgb(path)?;
        check(path, &image, expected)?;
        smooth(path, &image)
    };
    let vectors = |path: &Path| -> Result<Image<3>> {
        let image = exr::read_vectors(path)?;
        check(path, &image, expected)?;
        smooth(path, &image)
    };
    let emission = match &files.emission {
        None => None,
        Some(Emission::Mask(path)) => Some(single(path, pictures::read_mask(path)?)?),
        Some(Emission::Radiance(path)) => {
            let emitting =
                exr::read_rgb(path)?.map(|rgb| [f32::from(u8::from(rgb.iter().any(|v| *v > 0.0)))]);
            Some(single(path, emitting)?)
        }
    };
    let alpha = match (&files.alpha, light.alpha) {
        (Some(path), _) => Some(single(path, pictures::read_mask(path)?)?),
        (None, Some(alpha)) => Some(single(&files.radiance, alpha)?),
        (None, None) => None,
    };
    let clipped = match &files.clipped {
        Some(path) => Some(vectors(path)?),
        None => light
            .clipped
            .map(|mask| smooth(&files.radiance, &mask))
            .transpose()?,
    };
    let clipped = clipped.map(|mask| lower_bounds(&mask, color));
    let depth = match &files.depth {
        None => None,
        Some(depth) => {
            let stored = pictures::read_depth(&depth.path)?;
            check_size(&depth.path, stored.size(), expected)?;
            let unit = depth.unit as f32;
            // Some writers use NaN and negative depths for unknown.
            let scaled = stored.map(|[d]| [if *d > 0.0 { d * unit } else { 0.0 }]);
            let picked = undistortion.apply_nearest(&scaled);
            Some(picked.map_err(|problem| resample(&depth.path, problem))?)
        }
    };
    let normal = files.normal.as_deref().map(vectors).transpose()?;
    let mut albedo = files.albedo.as_deref().map(colour).transpose()?;
    if let Some(albedo) = &mut albedo {
        to_rec709(albedo, None);
    }
    let source_mask = match &files.valid {
        None => None,
        Some(path) => {
            let usable = pictures::read_mask(path)?.map(|[v]| [f32::from(u8::from(*v > 0.0))]);
            Some(single(path, usable)?)
        }
    };
    let num_unknown = remapped.num_unknown();
    let valid = known(remapped.valid, source_mask, num_unknown);
    let camera = undistortion.camera(turned(new_from_source, &frame.world_from_camera));
    let report = ViewReport {
        name: frame.name.clone(),
        num_pixels: camera.num_pixels(),
        num_negative,
        num_unknown: valid.as_ref().map_or(0, |mask| {
            mask.values().iter().filter(|v| **v == 0.0).count()
        }),
        num_clipped: clipped.as_ref().map_or(0, |mask| {
            let pixels = mask.pixels().iter();
            pixels.filter(|pixel| **pixel != [0.0; 3]).count()
        }),
    };
    let view = View {
        name: frame.name.clone(),
        camera,
        radiance: remapped.image,
        emission,
        normal: normal.map(|normal| turn_normals(normal, new_from_source)),
        alpha,
        depth,
        albedo,
        specular: None,
        roughness: None,
        clipped,
        valid,
    };
    Ok((view, Imported { camera, report }))
}

/// The mask to write: none if all pixels are known and the source has no mask.
fn known(remapped: Image<1>, source: Option<Image<1>>, num_unknown: usize) -> Option<Image<1>> {
    match source {
        None => (num_unknown > 0).then_some(remapped),
        Some(mut source) => {
            for (own, [other]) in source.pixels_mut().iter_mut().zip(remapped.pixels()) {
                own[0] *= other;
            }
            Some(source)
        }
    }
}

/// The channels, 0 or 1, to which a clipped channel of the source contributes: by resampling, and
/// by a matrix of colours.
fn lower_bounds(clipped: &Image<3>, matrix: Option<&DMat3>) -> Image<3> {
    let mixes = matrix.is_some_and(|matrix| {
        let gains = DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z);
        *matrix != DMat3::from_diagonal(gains)
    });
    clipped.map(|pixel| {
        // Interpolation overshoots to either side.
        let flags = pixel.map(|share| share.abs() > MIN_CLIPPED);
        let all = flags.contains(&true);
        flags.map(|flag| f32::from(u8::from(if mixes { all } else { flag })))
    })
}

/// Converts radiance to linear Rec.709 by a matrix, if needed; negative values become 0. Returns
/// the number of pixels that had one.
fn to_rec709(image: &mut Image<3>, matrix: Option<&DMat3>) -> usize {
    let mut num_negative = 0;
    for pixel in image.pixels_mut() {
        if let Some(matrix) = matrix {
            let light = *matrix * DVec3::from(pixel.map(f64::from));
            *pixel = light.as_vec3().to_array();
        }
        if pixel.iter().any(|value| *value < 0.0) {
            num_negative += 1;
            *pixel = pixel.map(|value| value.max(0.0));
        }
    }
    num_negative
}

fn turn_normals(mut normals: Image<3>, new_from_old: DMat3) -> Image<3> {
    let turn = new_from_old.as_mat3();
    for pixel in normals.pixels_mut() {
        let normal = turn * Vec3::from(*pixel);
        let length = normal.length();
        *pixel = if length < MIN_NORMAL_LENGTH {
            [0.0; 3]
        } else {
            (normal / length).to_array()
        };
    }
    normals
}

/// Checks the size of an image and that its values are finite.
fn check<const C: usize>(path: &Path, image: &Image<C>, expected: (u32, u32)) -> Result<()> {
    check_size(path, image.size(), expected)?;
    let is_bad = |pixel: &[f32; C]| pixel.iter().any(|value| !value.is_finite());
    let Some(first) = image.pixels().iter().position(is_bad) else {
        return Ok(());
    };
    let num_bad = image.pixels().iter().filter(|pixel| is_bad(pixel)).count();
    let width = image.width() as usize;
    let field = format!("pixel ({}, {})", first % width, first / width);
    let problem = format!(
        "{:?} is not finite; {num_bad} of {} pixels are like this",
        image.pixels()[first],
        image.pixels().len()
    );
    Err(ConvertError::invalid(path, field, problem))
}

fn check_size(path: &Path, size: (u32, u32), expected: (u32, u32)) -> Result<()> {
    if size == expected {
        return Ok(());
    }
    let problem = format!(
        "{}x{}, but the photograph is {}x{}",
        size.0, size.1, expected.0, expected.1
    );
    Err(ConvertError::invalid(path, "size", problem))
}
