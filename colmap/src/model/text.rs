//! Text files: a record a line, fields between spaces, `#` begins a comment.

use super::SensorType;
use super::fields::{FieldReader, FieldWriter, Written};
use crate::error::{ColmapError, Result};
use eagpt_scene::SceneError;
use eagpt_scene::lens::LensModel;
use std::io::{BufRead, Write};
use std::path::Path;
use std::str::FromStr;

/// A text file. One line is held at a time.
pub(super) struct TextReader<'a, R> {
    path: &'a Path,
    reader: R,
    line: Vec<u8>,
    line_number: u64,
    /// Position in the line of the next field.
    at: usize,
}

impl<'a, R: BufRead> TextReader<'a, R> {
    pub(super) fn new(path: &'a Path, reader: R) -> Self {
        Self {
            path,
            reader,
            line: Vec::new(),
            line_number: 0,
            at: 0,
        }
    }

    /// Reads a line; false at the end of the file.
    fn read_line(&mut self) -> Result<bool> {
        self.line.clear();
        self.at = 0;
        let num_bytes = self
            .reader
            .read_until(b'\n', &mut self.line)
            .map_err(|error| SceneError::io(self.path, "read", error))?;
        self.line_number += u64::from(num_bytes > 0);
        Ok(num_bytes > 0)
    }

    fn token(&mut self) -> Option<&[u8]> {
        let rest = &self.line[self.at..];
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let rest = &rest[start..];
        let length = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        self.at += start + length;
        Some(&rest[..length])
    }

    fn text(&mut self, field: &'static str) -> Result<&str> {
        let missing = self.error(format!("{field} is missing"));
        let Some(token) = self.token() else {
            return Err(missing);
        };
        // Bytes that are not UTF-8 are not a number either.
        Ok(std::str::from_utf8(token).unwrap_or("\u{fffd}"))
    }

    fn parse<T: FromStr>(&mut self, field: &'static str) -> Result<T> {
        let text = self.text(field)?;
        if let Ok(value) = text.parse() {
            return Ok(value);
        }
        let problem = format!("{field} is `{}`", excerpt(text));
        Err(self.error(problem))
    }

    fn num_tokens(&self) -> usize {
        let rest = &self.line[self.at..];
        rest.split(u8::is_ascii_whitespace)
            .filter(|token| !token.is_empty())
            .count()
    }
}

/// Text for a message: short, and without line breaks.
fn excerpt(text: &str) -> String {
    text.chars()
        .take(40)
        .collect::<String>()
        .escape_debug()
        .to_string()
}

impl<R: BufRead> FieldReader for TextReader<'_, R> {
    fn next_record(&mut self, _min_bytes: u64) -> Result<bool> {
        while self.read_line()? {
            let first = self.line.iter().find(|byte| !byte.is_ascii_whitespace());
            if first.is_some_and(|byte| *byte != b'#') {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn num_records_hint(&self) -> usize {
        0
    }

    fn end_record(&mut self) -> Result<()> {
        match self.num_tokens() {
            0 => Ok(()),
            num => Err(self.error(format!("{num} fields too many"))),
        }
    }

    fn error(&self, problem: String) -> ColmapError {
        ColmapError::Text {
            path: self.path.to_owned(),
            line: self.line_number,
            problem,
        }
    }

    fn u8(&mut self, field: &'static str) -> Result<u8> {
        self.parse(field)
    }

    fn u32(&mut self, field: &'static str) -> Result<u32> {
        self.parse(field)
    }

    fn u64(&mut self, field: &'static str) -> Result<u64> {
        self.parse(field)
    }

    fn f64(&mut self, field: &'static str) -> Result<f64> {
        self.parse(field)
    }

    fn model(&mut self) -> Result<LensModel> {
        let name = self.text("the camera model")?.to_owned();
        name.parse().map_err(|_: String| {
            self.error(format!(
                "`{}` is not a camera model of COLMAP",
                excerpt(&name)
            ))
        })
    }

    fn sensor_type(&mut self) -> Result<SensorType> {
        let name = self.text("the sensor type")?.to_owned();
        SensorType::ALL
            .into_iter()
            .find(|(_, own)| *own == name)
            .map(|(kind, _)| kind)
            .ok_or_else(|| self.error(format!("`{}` is not a sensor type", excerpt(&name))))
    }

    fn name(&mut self) -> Result<String> {
        let rest = std::str::from_utf8(&self.line[self.at..]).map(str::trim);
        let name = match rest {
            Ok("") => return Err(self.error("the name of an image is missing".to_owned())),
            Ok(name) => name.to_owned(),
            Err(error) => {
                return Err(self.error(format!("the name of an image is not UTF-8: {error}")));
            }
        };
        self.at = self.line.len();
        Ok(name)
    }

    fn point_or_none(&mut self) -> Result<Option<u64>> {
        let text = self.text("the number of a point")?;
        if text == "-1" {
            return Ok(None);
        }
        match text.parse() {
            Ok(u64::MAX) => Ok(None),
            Ok(id) => Ok(Some(id)),
            Err(_) => {
                let problem = format!("the number of a point is `{}`", excerpt(text));
                Err(self.error(problem))
            }
        }
    }

    fn list(&mut self, field: &'static str, num_fields: usize, _item_bytes: u64) -> Result<usize> {
        let num_tokens = self.num_tokens();
        if !num_tokens.is_multiple_of(num_fields) {
            return Err(self.error(format!(
                "{field}: {num_tokens} fields, not {num_fields} each"
            )));
        }
        Ok(num_tokens / num_fields)
    }

    fn short_list(&mut self, field: &'static str, _min_item_bytes: u64) -> Result<usize> {
        let count: u32 = self.parse(field)?;
        let max = self.num_tokens();
        match usize::try_from(count) {
            Ok(num) if num <= max => Ok(num),
            _ => Err(self.error(format!("{count} {field}, but {max} fields follow"))),
        }
    }

    fn next_line(&mut self) -> Result<()> {
        // The last line of a file may be empty and without its end.
        self.read_line().map(|_| ())
    }

    fn skip(&mut self, _num_items: usize, _num_fields: usize, _item_bytes: u64) -> Result<()> {
        self.at = self.line.len();
        Ok(())
    }
}

/// Writes a text file; numbers with enough digits to read the same value back.
pub(super) struct TextWriter<'a, W> {
    pub(super) path: &'a Path,
    pub(super) writer: W,
    pub(super) begins_line: bool,
}

impl<W: Write> TextWriter<'_, W> {
    fn put(&mut self, value: impl std::fmt::Display) -> Written {
        let space = if self.begins_line { "" } else { " " };
        self.begins_line = false;
        write!(self.writer, "{space}{value}")
            .map_err(|error| SceneError::io(self.path, "write", error))
    }
}

impl<W: Write> FieldWriter for TextWriter<'_, W> {
    fn begin(&mut self, num_records: usize, header: &str) -> Written {
        write!(
            self.writer,
            "# {header}\n# Number of records: {num_records}\n"
        )
        .map_err(|error| SceneError::io(self.path, "write", error))
    }

    fn u8(&mut self, value: u8) -> Written {
        self.put(value)
    }

    fn u32(&mut self, value: u32) -> Written {
        self.put(value)
    }

    fn u64(&mut self, value: u64) -> Written {
        self.put(value)
    }

    fn f64(&mut self, value: f64) -> Written {
        self.put(value)
    }

    fn model(&mut self, model: LensModel) -> Written {
        self.put(model)
    }

    fn sensor_type(&mut self, kind: SensorType) -> Written {
        let name = SensorType::ALL.into_iter().find(|(own, _)| *own == kind);
        self.put(name.map_or("INVALID", |(_, name)| name))
    }

    fn name(&mut self, name: &str) -> Written {
        self.put(name)
    }

    fn point_or_none(&mut self, point: Option<u64>) -> Written {
        match point {
            Some(point) => self.put(point),
            None => self.put("-1"),
        }
    }

    fn list(&mut self, _num_items: usize) -> Written {
        Ok(())
    }

    fn end_line(&mut self) -> Written {
        self.begins_line = true;
        writeln!(self.writer).map_err(|error| SceneError::io(self.path, "write", error))
    }
}
