//! The findings about a dataset, for programs and as text.

use crate::error::Problem;
use eagpt_scene::dataset::{SplitRule, UpAxis};
use eagpt_scene::words::listed;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Most missing names that are listed.
const MAX_LISTED: usize = 6;

/// A kind of image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ImageKind {
    /// Photographs
    Radiance,
    /// Emission masks
    Emission,
    /// Normals
    Normal,
    /// Opacities
    Alpha,
    /// Depths
    Depth,
    /// Diffuse albedos
    Albedo,
    /// Specular reflectances
    Specular,
    /// Roughness
    Roughness,
    /// Masks of known pixels
    Valid,
}

/// Report of all views.
#[derive(Debug, Clone, Serialize)]
pub struct CheckReport {
    /// The file of cameras.
    pub dataset: PathBuf,
    /// Frames that the file lists and that can be used.
    pub num_views: usize,
    /// The up axis, if it is stored.
    pub up_axis: Option<UpAxis>,
    /// Length of a scene unit in metres, if it is stored.
    pub metres_per_unit: Option<f64>,
    /// Images by kind.
    pub kinds: Vec<KindReport>,
    /// Poses.
    pub cameras: CameraReport,
    /// Intrinsics.
    pub(crate) intrinsics: IntrinsicsReport,
    /// The point cloud, if there is one.
    pub points: Option<PointsReport>,
    /// Median of depths over the depths of points in the same pixels, over views; some occluded
    /// points make it smaller than 1.
    pub depth_over_points: Option<f64>,
    /// The dataset divided by each rule.
    pub splits: Vec<SplitReport>,
    /// Views.
    pub views: Vec<ViewCheck>,
    /// Errors, by view.
    pub problems: Vec<Problem>,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// Images of one kind.
#[derive(Debug, Clone, Serialize)]
pub struct KindReport {
    /// The kind.
    pub kind: ImageKind,
    /// Views that have one.
    pub num_present: usize,
    /// Views without, by name, where others have one.
    pub missing: Vec<String>,
    /// Values over all views that can be read.
    pub values: Option<ValueRange>,
    /// Mean share of pixels of the views that have one: marked as light, with a normal, with a
    /// depth, known.
    pub coverage: Option<f64>,
}

/// Finite values of images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ValueRange {
    /// Smallest.
    pub min: f32,
    /// Largest.
    pub max: f32,
    /// Mean.
    pub mean: f64,
    /// Number.
    #[serde(skip)]
    pub num: u64,
}

impl ValueRange {
    /// Of some values.
    pub(crate) fn of(values: &[f32]) -> Self {
        let mut range = Self {
            min: f32::INFINITY,
            max: f32::NEG_INFINITY,
            mean: 0.0,
            num: 0,
        };
        let mut sum = 0.0;
        for value in values.iter().filter(|value| value.is_finite()) {
            range.min = range.min.min(*value);
            range.max = range.max.max(*value);
            sum += f64::from(*value);
            range.num += 1;
        }
        range.mean = sum / range.num.max(1) as f64;
        range
    }

    /// Of both.
    pub(crate) fn and(self, other: Self) -> Self {
        let num = self.num + other.num;
        let sum = self.mean * self.num as f64 + other.mean * other.num as f64;
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            mean: sum / num.max(1) as f64,
            num,
        }
    }
}

/// Poses of the cameras, scene units.
#[derive(Debug, Clone, Serialize)]
pub struct CameraReport {
    /// Lower corner of the box around all centres.
    pub low: [f64; 3],
    /// Upper corner.
    pub high: [f64; 3],
    /// Its diagonal.
    pub extent: f64,
    /// Lowest, median and largest coordinate along the up axis.
    pub heights: [f64; 3],
    /// Angle between the up axis and the cameras' mean upward direction, degrees.
    pub up_angle_deg: Option<f64>,
    /// The axis that is nearest to that direction.
    pub most_upright: Option<UpAxis>,
    /// Least, median and largest distance of a camera to the one next to it.
    pub nearest_neighbour: [f64; 3],
    /// Pairs of views with one pose.
    pub same_pose: Vec<[String; 2]>,
}

/// Intrinsics, as ranges over all cameras.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct IntrinsicsReport {
    /// Different sizes of images.
    pub sizes: Vec<[u32; 2]>,
    /// Angle of view across, degrees.
    pub fov_x_deg: [f64; 2],
    /// Angle of view down, degrees.
    pub fov_y_deg: [f64; 2],
    /// fx over fy.
    pub pixel_aspect: [f64; 2],
    /// Distance of the principal point from the middle, the larger of both axes, as a share of the
    /// image.
    pub principal_offset: [f64; 2],
}

/// The point cloud.
#[derive(Debug, Clone, Serialize)]
pub struct PointsReport {
    /// Points.
    pub num: usize,
    /// Lower corner of the box around them.
    pub low: [f32; 3],
    /// Upper corner.
    pub high: [f32; 3],
    /// Share, of an even sample, that projects into some view.
    pub share_in_view: f64,
}

/// The dataset divided by a rule.
#[derive(Debug, Clone, Serialize)]
pub struct SplitReport {
    /// The rule.
    pub rule: SplitRule,
    /// Training views.
    pub num_train: usize,
    /// Test views.
    pub num_test: usize,
    /// Test views that are trained on.
    pub num_shared: usize,
    /// The reason why the rule cannot be applied, if it cannot.
    pub problem: Option<String>,
    /// Warnings for readers of results.
    pub warnings: Vec<String>,
}

/// A view.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ViewCheck {
    /// Name.
    pub name: String,
    /// Width and height.
    pub size: [u32; 2],
    /// Largest value of any channel.
    pub max_radiance: f32,
    /// Mean luminance.
    pub mean_luminance: f64,
    /// Pixels that are NaN or infinite.
    pub num_not_finite: usize,
    /// Pixels with a negative channel.
    pub num_negative: usize,
    /// Pixels with a channel at the view's largest value: clipped, or an evenly bright lamp.
    pub num_at_maximum: usize,
    /// Share of pixels that are marked as light.
    pub emission: Option<f64>,
    /// Share of pixels with a normal.
    pub normal: Option<f64>,
    /// Share of normals that are turned to the camera.
    pub normals_facing: Option<f64>,
    /// Share of normals whose length is not 1.
    pub normals_not_unit: Option<f64>,
    /// Median angle between normals and those of the surface that the depths span, degrees.
    pub normal_from_depth_deg: Option<f64>,
    /// Share of pixels with a depth.
    pub depth: Option<f64>,
    /// Share of pixels that are known.
    pub valid: Option<f64>,
}

impl CheckReport {
    /// Whether there are no errors.
    pub fn is_sound(&self) -> bool {
        self.problems.is_empty()
    }

    /// The report for people.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        self.write(&mut text).unwrap_or_default();
        text
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let up = self
            .up_axis
            .map_or("not stored, taken as z".to_owned(), |a| a.to_string());
        let unit = self
            .metres_per_unit
            .map_or("not stored".to_owned(), |m| format!("{m} m"));
        writeln!(out, "{}", self.dataset.display())?;
        writeln!(
            out,
            "  {} views; up axis {up}; scene unit {unit}",
            self.num_views
        )?;
        writeln!(
            out,
            "\n  images     views  values                              coverage"
        )?;
        for kind in &self.kinds {
            self.write_kind(out, kind)?;
        }
        self.write_cameras(out)?;
        writeln!(out, "\n  split       train   test  trained on")?;
        for split in &self.splits {
            match &split.problem {
                Some(problem) => writeln!(out, "  {:<10}  {problem}", split.rule.to_string())?,
                None => writeln!(
                    out,
                    "  {:<10} {:>6} {:>6} {:>11}",
                    split.rule.to_string(),
                    split.num_train,
                    split.num_test,
                    split.num_shared
                )?,
            }
        }
        if !self.warnings.is_empty() {
            writeln!(out)?;
        }
        for warning in &self.warnings {
            writeln!(out, "  warning: {warning}")?;
        }
        if !self.problems.is_empty() {
            writeln!(out)?;
        }
        for Problem { view, problem, .. } in &self.problems {
            writeln!(out, "  broken: {view}: {problem}")?;
        }
        let verdict = match self.problems.len() {
            0 => "no errors".to_owned(),
            num => format!("{num} problems"),
        };
        writeln!(out, "\n  {verdict}, {} warnings", self.warnings.len())
    }

    fn write_kind(&self, out: &mut String, kind: &KindReport) -> std::fmt::Result {
        let name = format!("{:?}", kind.kind).to_lowercase();
        let values = kind.values.map_or(String::new(), |values| {
            format!(
                "{:.4} to {:.4}, mean {:.4}",
                values.min, values.max, values.mean
            )
        });
        let coverage = kind
            .coverage
            .map_or(String::new(), |share| format!("{:.2} %", 100.0 * share));
        writeln!(
            out,
            "  {name:<9} {:>6}  {values:<34}  {coverage}",
            kind.num_present
        )?;
        if !kind.missing.is_empty() {
            let names = listed(&kind.missing, MAX_LISTED);
            writeln!(out, "                    none: {names}")?;
        }
        Ok(())
    }

    fn write_cameras(&self, out: &mut String) -> std::fmt::Result {
        let c = &self.cameras;
        let corner = |v: &[f64; 3]| format!("({:.3}, {:.3}, {:.3})", v[0], v[1], v[2]);
        let three = |v: &[f64; 3]| format!("{:.3}, {:.3}, {:.3}", v[0], v[1], v[2]);
        writeln!(
            out,
            "\n  cameras    from {} to {}, {:.3} across",
            corner(&c.low),
            corner(&c.high),
            c.extent
        )?;
        writeln!(
            out,
            "             heights (least, median, most) {}",
            three(&c.heights)
        )?;
        writeln!(
            out,
            "             to the next camera (least, median, most) {}",
            three(&c.nearest_neighbour)
        )?;
        if let Some(angle) = c.up_angle_deg {
            writeln!(
                out,
                "             mean up direction {angle:.1}° from the up axis"
            )?;
        }
        let i = &self.intrinsics;
        let sizes: Vec<String> = i
            .sizes
            .iter()
            .take(MAX_LISTED)
            .map(|[w, h]| format!("{w}x{h}"))
            .collect();
        writeln!(
            out,
            "  intrinsics {} sizes: {}",
            i.sizes.len(),
            sizes.join(", ")
        )?;
        writeln!(
            out,
            "             {:.2}° to {:.2}° across, {:.2}° to {:.2}° down; pixels {:.4} to {:.4} wide",
            i.fov_x_deg[0],
            i.fov_x_deg[1],
            i.fov_y_deg[0],
            i.fov_y_deg[1],
            i.pixel_aspect[0],
            i.pixel_aspect[1]
        )?;
        match &self.points {
            None => writeln!(out, "  points     none"),
            Some(p) => {
                let corner = |v: &[f32; 3]| corner(&v.map(f64::from));
                let seen = 100.0 * p.share_in_view;
                writeln!(
                    out,
                    "  points     {} from {} to {}, {seen:.1} % in some picture",
                    p.num,
                    corner(&p.low),
                    corner(&p.high)
                )
            }
        }
    }
}
