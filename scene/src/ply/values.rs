//! The values of a PLY file: chosen properties of the `vertex` element, row by row.

use super::header::{self, Element, Encoding, Header, Property, PropertyType, Scalar};
use crate::error::{Result, SceneError};
use std::path::Path;

/// The `vertex` element of a PLY file held in memory.
pub(super) struct Vertices<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    header: Header,
    vertex_index: usize,
}

/// A property to read: its index among the properties of a row, and its type.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    index: usize,
    pub(super) scalar: Scalar,
}

impl<'a> Vertices<'a> {
    /// Parses the header and checks that the file can hold as many rows as it promises.
    pub(super) fn parse(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let header = header::parse(path, bytes)?;
        let vertex_index = header
            .elements
            .iter()
            .position(|element| element.name == "vertex")
            .ok_or_else(|| SceneError::invalid(path, "header", "no element named vertex"))?;
        let vertices = Self {
            path,
            bytes,
            header,
            vertex_index,
        };
        vertices.check_size()?;
        Ok(vertices)
    }

    /// Number of rows; the file is known to be long enough for them.
    pub(super) fn len(&self) -> usize {
        self.vertex().count
    }

    /// The properties of a row.
    pub(super) fn properties(&self) -> &[Property] {
        &self.vertex().properties
    }

    fn vertex(&self) -> &Element {
        &self.header.elements[self.vertex_index]
    }

    fn check_size(&self) -> Result<()> {
        let num_left = self.bytes.len() - self.header.num_bytes;
        let num_wanted = self.header.elements[..=self.vertex_index]
            .iter()
            .map(|element| {
                let row = match self.header.encoding {
                    // A digit and a separator for each value; the last value of the file may have
                    // no separator.
                    Encoding::Ascii => 2 * element.properties.len(),
                    _ => element.min_row_bytes(),
                };
                element.count.saturating_mul(row)
            })
            .fold(0, usize::saturating_add);
        if num_wanted > num_left + usize::from(self.header.encoding == Encoding::Ascii) {
            return Err(self.truncated(format!(
                "{} rows need {num_wanted} bytes, {num_left} are there",
                self.len()
            )));
        }
        Ok(())
    }

    fn truncated(&self, what: impl std::fmt::Display) -> SceneError {
        SceneError::invalid(self.path, "vertex", format!("truncated: {what}"))
    }

    /// The property `name` if the file has it as a single value.
    pub(super) fn find(&self, name: &str) -> Option<Column> {
        let properties = self.vertex().properties.iter();
        properties.enumerate().find_map(|(index, property)| {
            match (property.name == name, &property.kind) {
                (true, PropertyType::Single(scalar)) => Some(Column {
                    index,
                    scalar: *scalar,
                }),
                _ => None,
            }
        })
    }

    /// The columns of `names`.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] naming the first missing property and those found.
    pub(super) fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[Column; N]> {
        let mut columns = [Column {
            index: 0,
            scalar: Scalar::F32,
        }; N];
        for (column, name) in columns.iter_mut().zip(names) {
            *column = self.find(name).ok_or_else(|| {
                SceneError::invalid(
                    self.path,
                    format!("vertex.{name}"),
                    format!("missing property; found {}", self.names()),
                )
            })?;
        }
        Ok(columns)
    }

    fn names(&self) -> String {
        /// A splat file with all harmonics has 62.
        const MAX_LISTED: usize = 20;
        let properties = &self.vertex().properties;
        let names = properties.iter().take(MAX_LISTED);
        let mut list: Vec<String> = names.map(|p| p.name.escape_debug().to_string()).collect();
        if properties.len() > MAX_LISTED {
            list.push(format!("and {} more", properties.len() - MAX_LISTED));
        }
        if list.is_empty() {
            list.push("none".to_owned());
        }
        list.join(" ")
    }

    /// Calls `take(index, values)` for every row, values in the order of `columns`.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] for a truncated file or an ascii value that is no number, or what
    /// `take` returns.
    pub(super) fn for_each_row<const N: usize>(
        &self,
        columns: [Column; N],
        take: impl FnMut(usize, [f64; N]) -> Result<()>,
    ) -> Result<()> {
        let body = &self.bytes[self.header.num_bytes..];
        match self.header.encoding {
            Encoding::Ascii => self.ascii_rows(body, columns, take),
            Encoding::LittleEndian => self.binary_rows::<N, false>(body, columns, take),
            Encoding::BigEndian => self.binary_rows::<N, true>(body, columns, take),
        }
    }

    fn binary_rows<const N: usize, const BIG: bool>(
        &self,
        body: &[u8],
        columns: [Column; N],
        mut take: impl FnMut(usize, [f64; N]) -> Result<()>,
    ) -> Result<()> {
        let mut cursor = Binary::<BIG> { rest: body };
        for element in &self.header.elements[..self.vertex_index] {
            let skipped = cursor.skip_rows(element);
            skipped.ok_or_else(|| self.truncated(format!("ends in element {}", element.name)))?;
        }
        let vertex = self.vertex();
        let row_bytes = vertex.min_row_bytes();
        if vertex.has_fixed_rows() {
            let mut offsets = vec![0; vertex.properties.len()];
            let mut offset = 0;
            for (slot, property) in offsets.iter_mut().zip(&vertex.properties) {
                *slot = offset;
                if let PropertyType::Single(scalar) = property.kind {
                    offset += scalar.size();
                }
            }
            let places = columns.map(|column| (offsets[column.index], column.scalar));
            let num_bytes = row_bytes.saturating_mul(vertex.count);
            let rows = cursor
                .take(num_bytes)
                .ok_or_else(|| self.truncated("rows"))?;
            let rows = rows.chunks_exact(row_bytes.max(1)).enumerate();
            // The usual type by itself: choosing the type anew for every value doubles the time.
            if columns.iter().all(|column| column.scalar == Scalar::F32) {
                let offsets = places.map(|(at, _)| at);
                for (index, row) in rows {
                    let mut values = [0.0; N];
                    for (value, at) in values.iter_mut().zip(offsets) {
                        *value = f64::from(f32::from_le_bytes(little::<4, BIG>(&row[at..])));
                    }
                    take(index, values)?;
                }
            } else {
                for (index, row) in rows {
                    let values = places.map(|(at, scalar)| value::<BIG>(&row[at..], scalar));
                    take(index, values)?;
                }
            }
            return Ok(());
        }
        let mut row = vec![0.0; vertex.properties.len()];
        for index in 0..vertex.count {
            cursor
                .read_row(vertex, &mut row)
                .ok_or_else(|| self.truncated(format!("ends in row {index}")))?;
            take(index, columns.map(|column| row[column.index]))?;
        }
        Ok(())
    }

    fn ascii_rows<const N: usize>(
        &self,
        body: &[u8],
        columns: [Column; N],
        mut take: impl FnMut(usize, [f64; N]) -> Result<()>,
    ) -> Result<()> {
        let text = String::from_utf8_lossy(body);
        let mut words = text.split_ascii_whitespace();
        let mut row = Vec::new();
        for element in &self.header.elements[..=self.vertex_index] {
            let is_vertex = element.name == self.vertex().name;
            row.resize(element.properties.len(), 0.0);
            // Rows without properties have no text; there may be any number of them.
            let count = if row.is_empty() { 0 } else { element.count };
            for index in 0..count {
                for (slot, property) in row.iter_mut().zip(&element.properties) {
                    let mut next = || {
                        let word = words.next().ok_or_else(|| {
                            self.truncated(format!("ends in row {index} of {}", element.name))
                        })?;
                        word.parse::<f64>().map_err(|_| {
                            SceneError::invalid(
                                self.path,
                                format!("{}[{index}].{}", element.name, property.name),
                                format!("`{}` is no number", word.escape_debug()),
                            )
                        })
                    };
                    *slot = next()?;
                    if let PropertyType::List { .. } = property.kind {
                        // A count beyond the end of the text stops at the end of the text.
                        for _ in 0..*slot as u64 {
                            next()?;
                        }
                    }
                }
                if is_vertex {
                    take(index, columns.map(|column| row[column.index]))?;
                }
            }
        }
        Ok(())
    }
}

/// The binary values that are not read yet.
struct Binary<'a, const BIG: bool> {
    rest: &'a [u8],
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    fn take(&mut self, num_bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(num_bytes)?;
        self.rest = rest;
        Some(taken)
    }

    fn read(&mut self, scalar: Scalar) -> Option<f64> {
        Some(value::<BIG>(self.take(scalar.size())?, scalar))
    }

    /// Reads the single values of a row into `row` and steps over its lists.
    fn read_row(&mut self, element: &Element, row: &mut [f64]) -> Option<()> {
        for (slot, property) in row.iter_mut().zip(&element.properties) {
            match property.kind {
                PropertyType::Single(scalar) => *slot = self.read(scalar)?,
                PropertyType::List { count, item } => {
                    let num_items = self.read(count)? as usize;
                    self.take(num_items.checked_mul(item.size())?)?;
                }
            }
        }
        Some(())
    }

    fn skip_rows(&mut self, element: &Element) -> Option<()> {
        if element.has_fixed_rows() {
            let num_bytes = element.min_row_bytes().checked_mul(element.count)?;
            return self.take(num_bytes).map(|_| ());
        }
        let mut row = vec![0.0; element.properties.len()];
        (0..element.count).try_for_each(|_| self.read_row(element, &mut row))
    }
}

/// The value at the start of `bytes`, which hold at least its size.
#[inline]
fn value<const BIG: bool>(bytes: &[u8], scalar: Scalar) -> f64 {
    match scalar {
        Scalar::I8 => f64::from(bytes[0] as i8),
        Scalar::U8 => f64::from(bytes[0]),
        Scalar::I16 => f64::from(u16::from_le_bytes(little::<2, BIG>(bytes)) as i16),
        Scalar::U16 => f64::from(u16::from_le_bytes(little::<2, BIG>(bytes))),
        Scalar::I32 => f64::from(u32::from_le_bytes(little::<4, BIG>(bytes)) as i32),
        Scalar::U32 => f64::from(u32::from_le_bytes(little::<4, BIG>(bytes))),
        Scalar::F32 => f64::from(f32::from_le_bytes(little::<4, BIG>(bytes))),
        Scalar::F64 => f64::from_le_bytes(little::<8, BIG>(bytes)),
    }
}

#[inline]
fn little<const N: usize, const BIG: bool>(bytes: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&bytes[..N]);
    if BIG {
        array.reverse();
    }
    array
}
