//! Writing a model.

use super::binary::BinaryWriter;
use super::fields::{FieldWriter, Written};
use super::records::Record;
use super::text::TextWriter;
use super::{Form, Model, Part};
use crate::error::{ColmapError, Result};
use eagpt_scene::files;
use std::path::Path;

pub(super) fn write(model: &Model, dir: &Path, form: Form) -> Result<()> {
    let skipped = |point: &super::ModelPoint| point.track.len() != point.track_length as usize;
    if model.points.iter().any(skipped) {
        let problem = "the observations of the model were not read, it cannot be written";
        return Err(ColmapError::invalid(dir, problem));
    }
    files::create_dir(dir)?;
    let path = |part: Part| part.path(dir, form);
    write_part(&path(Part::Cameras), form, &model.cameras)?;
    write_part(&path(Part::Images), form, &model.images)?;
    write_part(&path(Part::Points), form, &model.points)?;
    match &model.rigs {
        Some(rigs) => write_part(&path(Part::Rigs), form, rigs)?,
        None => files::remove_if_there(&path(Part::Rigs))?,
    }
    match &model.frames {
        Some(frames) => write_part(&path(Part::Frames), form, frames)?,
        // Stale poses of another world would be taken for this one's.
        None => files::remove_if_there(&path(Part::Frames))?,
    }
    Ok(())
}

fn write_part<T: Record>(path: &Path, form: Form, records: &[T]) -> Result<()> {
    let written = files::write_atomic(path, |file| match form {
        Form::Binary => write_records(&mut BinaryWriter { path, writer: file }, records),
        Form::Text => write_records(
            &mut TextWriter {
                path,
                writer: file,
                begins_line: true,
            },
            records,
        ),
    });
    Ok(written?)
}

fn write_records<T: Record>(sink: &mut impl FieldWriter, records: &[T]) -> Written {
    sink.begin(records.len(), T::HEADER)?;
    records.iter().try_for_each(|record| record.write(sink))
}

/// Writes one part into memory, for tests.
#[cfg(test)]
pub(super) fn to_bytes<T: Record>(form: Form, records: &[T]) -> Vec<u8> {
    let path = Path::new("memory");
    let mut bytes = Vec::new();
    match form {
        Form::Binary => write_records(
            &mut BinaryWriter {
                path,
                writer: &mut bytes,
            },
            records,
        ),
        Form::Text => write_records(
            &mut TextWriter {
                path,
                writer: &mut bytes,
                begins_line: true,
            },
            records,
        ),
    }
    .unwrap();
    bytes
}
