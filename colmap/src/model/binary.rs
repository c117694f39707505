//! Binary files: little endian, no padding.

use super::SensorType;
use super::fields::{FieldReader, FieldWriter, Written};
use crate::error::{ColmapError, Result};
use eagpt_scene::SceneError;
use eagpt_scene::lens::LensModel;
use std::io::{BufRead, Write};
use std::path::Path;

/// Longest name of an image: that of a path on the systems COLMAP runs on.
const MAX_NAME_BYTES: usize = 4096;

/// A binary file. Its length is known: nothing is allocated that does not fit into it.
pub(super) struct BinaryReader<'a, R> {
    path: &'a Path,
    reader: R,
    offset: u64,
    length: u64,
    /// Records to come; `None` before their number was read.
    num_left: Option<u64>,
}

impl<'a, R: BufRead> BinaryReader<'a, R> {
    pub(super) fn new(path: &'a Path, reader: R, length: u64) -> Self {
        Self {
            path,
            reader,
            offset: 0,
            length,
            num_left: None,
        }
    }

    fn remaining(&self) -> u64 {
        self.length.saturating_sub(self.offset)
    }

    fn bytes<const N: usize>(&mut self, field: &'static str) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        if self.remaining() < N as u64 {
            return Err(self.truncated(field));
        }
        self.reader
            .read_exact(&mut bytes)
            .map_err(|error| SceneError::io(self.path, "read", error))?;
        self.offset += N as u64;
        Ok(bytes)
    }

    fn truncated(&self, field: &'static str) -> ColmapError {
        self.error(format!(
            "the file ends within {field}: it has {} bytes",
            self.length
        ))
    }

    /// A number of items that has to fit into the rest of the file.
    fn counted(&self, count: u64, field: &'static str, item_bytes: u64) -> Result<usize> {
        let max = self.remaining() / item_bytes.max(1);
        match usize::try_from(count) {
            Ok(num) if count <= max => Ok(num),
            _ => Err(self.error(format!(
                "{count} {field}, but the rest of the file, {} bytes, holds at most {max}",
                self.remaining()
            ))),
        }
    }
}

impl<R: BufRead> FieldReader for BinaryReader<'_, R> {
    fn next_record(&mut self, min_bytes: u64) -> Result<bool> {
        let left = match self.num_left {
            Some(left) => left,
            None => {
                let count = self.u64("the number of records")?;
                self.counted(count, "records", min_bytes)? as u64
            }
        };
        if left == 0 {
            if self.remaining() > 0 {
                let problem = format!("{} bytes after the last record", self.remaining());
                return Err(self.error(problem));
            }
            return Ok(false);
        }
        self.num_left = Some(left - 1);
        Ok(true)
    }

    fn num_records_hint(&self) -> usize {
        // Checked against the length of the file when it was read.
        self.num_left.unwrap_or(0) as usize + 1
    }

    fn end_record(&mut self) -> Result<()> {
        Ok(())
    }

    fn error(&self, problem: String) -> ColmapError {
        ColmapError::Binary {
            path: self.path.to_owned(),
            offset: self.offset,
            problem,
        }
    }

    fn u8(&mut self, field: &'static str) -> Result<u8> {
        self.bytes(field).map(|[byte]| byte)
    }

    fn u32(&mut self, field: &'static str) -> Result<u32> {
        self.bytes(field).map(u32::from_le_bytes)
    }

    fn u64(&mut self, field: &'static str) -> Result<u64> {
        self.bytes(field).map(u64::from_le_bytes)
    }

    fn f64(&mut self, field: &'static str) -> Result<f64> {
        self.bytes(field).map(f64::from_le_bytes)
    }

    fn model(&mut self) -> Result<LensModel> {
        let id = self.bytes("the camera model").map(i32::from_le_bytes)?;
        LensModel::from_id(id)
            .ok_or_else(|| self.error(format!("{id} is not a camera model of COLMAP")))
    }

    fn sensor_type(&mut self) -> Result<SensorType> {
        let id = self.bytes("the sensor type").map(i32::from_le_bytes)?;
        SensorType::ALL
            .into_iter()
            .find(|(kind, _)| *kind as i32 == id)
            .map(|(kind, _)| kind)
            .ok_or_else(|| self.error(format!("{id} is not a sensor type")))
    }

    fn name(&mut self) -> Result<String> {
        let mut name = Vec::new();
        loop {
            match self.u8("the name of an image")? {
                0 => break,
                byte => name.push(byte),
            }
            if name.len() > MAX_NAME_BYTES {
                return Err(self.error(format!(
                    "the name of an image is longer than {MAX_NAME_BYTES} bytes"
                )));
            }
        }
        String::from_utf8(name)
            .map_err(|error| self.error(format!("the name of an image is not UTF-8: {error}")))
    }

    fn point_or_none(&mut self) -> Result<Option<u64>> {
        let id = self.u64("the number of a point")?;
        Ok((id != u64::MAX).then_some(id))
    }

    fn list(&mut self, field: &'static str, _num_fields: usize, item_bytes: u64) -> Result<usize> {
        let count = self.u64(field)?;
        self.counted(count, field, item_bytes)
    }

    fn short_list(&mut self, field: &'static str, min_item_bytes: u64) -> Result<usize> {
        let count = self.u32(field)?;
        self.counted(count.into(), field, min_item_bytes)
    }

    fn next_line(&mut self) -> Result<()> {
        Ok(())
    }

    fn skip(&mut self, num_items: usize, _num_fields: usize, item_bytes: u64) -> Result<()> {
        // The list has been held against the file's length.
        let mut left = num_items as u64 * item_bytes;
        self.offset += left;
        while left > 0 {
            let buffer = self
                .reader
                .fill_buf()
                .map_err(|error| SceneError::io(self.path, "read", error))?;
            if buffer.is_empty() {
                return Err(self.truncated("a list"));
            }
            let taken = buffer
                .len()
                .min(usize::try_from(left).unwrap_or(usize::MAX));
            self.reader.consume(taken);
            left -= taken as u64;
        }
        Ok(())
    }
}

/// Writes a binary file.
pub(super) struct BinaryWriter<'a, W> {
    pub(super) path: &'a Path,
    pub(super) writer: W,
}

impl<W: Write> BinaryWriter<'_, W> {
    fn put(&mut self, bytes: &[u8]) -> Written {
        self.writer
            .write_all(bytes)
            .map_err(|error| SceneError::io(self.path, "write", error))
    }
}

impl<W: Write> FieldWriter for BinaryWriter<'_, W> {
    fn begin(&mut self, num_records: usize, _header: &str) -> Written {
        self.u64(num_records as u64)
    }

    fn u8(&mut self, value: u8) -> Written {
        self.put(&[value])
    }

    fn u32(&mut self, value: u32) -> Written {
        self.put(&value.to_le_bytes())
    }

    fn u64(&mut self, value: u64) -> Written {
        self.put(&value.to_le_bytes())
    }

    fn f64(&mut self, value: f64) -> Written {
        self.put(&value.to_le_bytes())
    }

    fn model(&mut self, model: LensModel) -> Written {
        self.put(&model.id().to_le_bytes())
    }

    fn sensor_type(&mut self, kind: SensorType) -> Written {
        self.put(&(kind as i32).to_le_bytes())
    }

    fn name(&mut self, name: &str) -> Written {
        self.put(name.as_bytes())?;
        self.put(&[0])
    }

    fn point_or_none(&mut self, point: Option<u64>) -> Written {
        self.u64(point.unwrap_or(u64::MAX))
    }

    fn list(&mut self, num_items: usize) -> Written {
        self.u64(num_items as u64)
    }

    fn end_line(&mut self) -> Written {
        Ok(())
    }
}
