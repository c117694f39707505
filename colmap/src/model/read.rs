//! Reading a model: its files, then their consistency.

use super::binary::BinaryReader;
use super::fields::FieldReader;
use super::records::Record;
use super::text::TextReader;
use super::{Form, Model, ModelImage, Observations, Part, SensorType};
use crate::error::{ColmapError, Result};
use eagpt_scene::{SceneError, files};
use std::collections::{HashMap, HashSet};
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Bytes read at once.
const BUFFER_BYTES: usize = 1 << 20;

pub(super) fn read(dir: &Path, observations: Observations) -> Result<Model> {
    let form = Form::of(dir).ok_or_else(|| no_model(dir))?;
    let mut model = Model::default();
    for part in Part::ALL {
        let path = part.path(dir, form);
        if !Part::NEEDED.contains(&part) && !path.is_file() {
            continue;
        }
        let file = files::open(&path)?;
        let length = file
            .metadata()
            .map_err(|error| SceneError::io(&path, "read", error))?
            .len();
        let reader = BufReader::with_capacity(BUFFER_BYTES, file);
        let input = Input {
            path: &path,
            reader,
            length,
            form,
            observations,
        };
        input.read_into(part, &mut model)?;
    }
    check(dir, form, &model)?;
    Ok(model)
}

/// Reads one file of a model from bytes in memory, as tests of damaged files do.
///
/// # Errors
/// As [`Model::read`], but references to other files are not checked.
pub fn read_part(part: Part, form: Form, path: &Path, bytes: &[u8]) -> Result<Model> {
    let mut model = Model::default();
    let input = Input {
        path,
        reader: bytes,
        length: bytes.len() as u64,
        form,
        observations: Observations::Keep,
    };
    input.read_into(part, &mut model)?;
    Ok(model)
}

fn no_model(dir: &Path) -> ColmapError {
    let inside = ["sparse/0", "0", "sparse"]
        .into_iter()
        .find(|sub| Form::of(&dir.join(sub)).is_some());
    if !dir.is_dir() {
        return SceneError::no_folder(dir).into();
    }
    let problem = match (inside, incomplete(dir)) {
        (Some(sub), _) => format!("no model here, but one in {}", dir.join(sub).display()),
        (None, Some((missing, form))) => format!(
            "an incomplete model: no {missing}; a model has {}",
            Part::NEEDED.map(|part| file_name(part, form)).join(", ")
        ),
        (None, None) => {
            "no model: needs cameras, images and points3D, all .bin or all .txt".to_owned()
        }
    };
    ColmapError::invalid(dir, problem)
}

fn file_name(part: Part, form: Form) -> String {
    part.path(Path::new(""), form).display().to_string()
}

/// The missing files of a model of which some are there, and its form: the one with fewer missing.
fn incomplete(dir: &Path) -> Option<(String, Form)> {
    let missing = |form: Form| {
        let parts = Part::NEEDED.into_iter();
        let missing = parts.filter(move |part| !part.path(dir, form).is_file());
        (
            missing
                .map(move |part| file_name(part, form))
                .collect::<Vec<_>>(),
            form,
        )
    };
    let (missing, form) = [Form::Binary, Form::Text]
        .map(missing)
        .into_iter()
        .min_by_key(|(missing, _)| missing.len())?;
    (missing.len() < Part::NEEDED.len()).then(|| (missing.join(" and no "), form))
}

struct Input<'a, R> {
    path: &'a Path,
    reader: R,
    length: u64,
    form: Form,
    observations: Observations,
}

impl<R: BufRead> Input<'_, R> {
    fn read_into(self, part: Part, model: &mut Model) -> Result<()> {
        match part {
            Part::Cameras => model.cameras = self.records()?,
            Part::Images => model.images = self.records()?,
            Part::Points => model.points = self.records()?,
            Part::Rigs => model.rigs = Some(self.records()?),
            Part::Frames => model.frames = Some(self.records()?),
        }
        Ok(())
    }

    fn records<T: Record>(self) -> Result<Vec<T>> {
        match self.form {
            Form::Binary => {
                let reader = BinaryReader::new(self.path, self.reader, self.length);
                records(reader, self.observations)
            }
            Form::Text => records(TextReader::new(self.path, self.reader), self.observations),
        }
    }
}

fn records<T: Record>(mut reader: impl FieldReader, observations: Observations) -> Result<Vec<T>> {
    let mut list = Vec::new();
    let mut seen = HashSet::new();
    while reader.next_record(T::MIN_BYTES)? {
        if list.is_empty() {
            list.reserve_exact(reader.num_records_hint());
            seen.reserve(reader.num_records_hint());
        }
        let record = T::read(&mut reader, observations)?;
        reader.end_record()?;
        if !seen.insert(record.id()) {
            return Err(reader.error(format!("{} {} is there twice", T::NAME, record.id())));
        }
        list.push(record);
    }
    Ok(list)
}

/// Checks references between the files.
fn check(dir: &Path, form: Form, model: &Model) -> Result<()> {
    let invalid =
        |part: Part, problem: String| Err(ColmapError::invalid(&part.path(dir, form), problem));
    let cameras: HashSet<_> = model.cameras.iter().map(|camera| camera.id).collect();
    if let Some(image) = model.images.iter().find(|i| !cameras.contains(&i.camera)) {
        let problem = format!(
            "image {} has camera {}, which is not there",
            image.id, image.camera
        );
        return invalid(Part::Images, problem);
    }
    let mut names = HashSet::new();
    if let Some(image) = model.images.iter().find(|i| !names.insert(i.name.as_str())) {
        let problem = format!("the name `{}` is there twice", image.name.escape_debug());
        return invalid(Part::Images, problem);
    }
    let images: HashMap<_, &ModelImage> = model.images.iter().map(|i| (i.id, i)).collect();
    for point in &model.points {
        let lost = point.track.iter().find(|element| {
            let image = images.get(&element.image);
            image.is_none_or(|image| element.observation as usize >= image.observations.len())
        });
        if let Some(element) = lost {
            let problem = format!(
                "point {} is observation {} of image {}, which is not there",
                point.id, element.observation, element.image
            );
            return invalid(Part::Points, problem);
        }
    }
    let Some(frames) = &model.frames else {
        return Ok(());
    };
    let rigs: HashSet<_> = model.rigs.iter().flatten().map(|rig| rig.id).collect();
    for frame in frames {
        if !rigs.contains(&frame.rig) {
            let problem = format!(
                "frame {} has rig {}, which is not there",
                frame.id, frame.rig
            );
            return invalid(Part::Frames, problem);
        }
        let lost = frame.data.iter().find(|(sensor, datum)| {
            let image = u32::try_from(*datum).map(super::ImageId);
            sensor.kind == SensorType::Camera && !image.is_ok_and(|id| images.contains_key(&id))
        });
        if let Some((_, datum)) = lost {
            // COLMAP keeps images that lost their pose in their frames.
            tracing::debug!("frame {}: image {datum} is not registered", frame.id);
        }
    }
    Ok(())
}
