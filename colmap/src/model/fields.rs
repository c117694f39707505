//! Common interface of the two forms of a file: records of named fields, one after the other.
//!
//! The records themselves are described once, in `records`; `binary` and `text` say how a field is
//! read and written.

use super::SensorType;
use crate::error::{ColmapError, Result};
use eagpt_scene::lens::LensModel;

/// Result of writing a field.
pub(super) type Written = eagpt_scene::Result<()>;

/// A file to read fields from.
pub(super) trait FieldReader {
    /// Goes to the next record; false at the end. `min_bytes` is the least that a record takes in
    /// the binary form.
    fn next_record(&mut self, min_bytes: u64) -> Result<bool>;
    /// Upper bound of the number of records, for reserving memory.
    fn num_records_hint(&self) -> usize;
    /// Ends a record: everything on its line has to be read.
    fn end_record(&mut self) -> Result<()>;
    /// An error at the place of the field read last.
    fn error(&self, problem: String) -> ColmapError;

    fn u8(&mut self, field: &'static str) -> Result<u8>;
    fn u32(&mut self, field: &'static str) -> Result<u32>;
    fn u64(&mut self, field: &'static str) -> Result<u64>;
    /// Any number, also infinite ones.
    fn f64(&mut self, field: &'static str) -> Result<f64>;
    /// A camera model: its id, or its name.
    fn model(&mut self) -> Result<LensModel>;
    /// A kind of sensor: its id, or its name.
    fn sensor_type(&mut self) -> Result<SensorType>;
    /// The name of an image, which ends a line of text.
    fn name(&mut self) -> Result<String>;
    /// The number of a point; `None` where there is none.
    fn point_or_none(&mut self) -> Result<Option<u64>>;
    /// The number of items of a list to come, each of `num_fields` fields of `item_bytes` bytes:
    /// stated, or up to the line's end.
    fn list(&mut self, field: &'static str, num_fields: usize, item_bytes: u64) -> Result<usize>;
    /// As [`Self::list`] for lists whose number is always stated, in 32 bits.
    fn short_list(&mut self, field: &'static str, min_item_bytes: u64) -> Result<usize>;
    /// Where text begins a new line inside of a record.
    fn next_line(&mut self) -> Result<()>;
    /// Passes over items of a list.
    fn skip(&mut self, num_items: usize, num_fields: usize, item_bytes: u64) -> Result<()>;

    /// A finite number.
    fn finite(&mut self, field: &'static str) -> Result<f64> {
        let value = self.f64(field)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.error(format!("{field} is {value:?}, not finite")))
    }
}

/// A file to write fields to. Text ends lines where a record says so.
pub(super) trait FieldWriter {
    fn begin(&mut self, num_records: usize, header: &str) -> Written;
    fn u8(&mut self, value: u8) -> Written;
    fn u32(&mut self, value: u32) -> Written;
    fn u64(&mut self, value: u64) -> Written;
    fn f64(&mut self, value: f64) -> Written;
    fn model(&mut self, model: LensModel) -> Written;
    fn sensor_type(&mut self, kind: SensorType) -> Written;
    fn name(&mut self, name: &str) -> Written;
    fn point_or_none(&mut self, point: Option<u64>) -> Written;
    /// The number of items of a list to come, which text does not state.
    fn list(&mut self, num_items: usize) -> Written;
    /// Where text ends a line.
    fn end_line(&mut self) -> Written;
}
