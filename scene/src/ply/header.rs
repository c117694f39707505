//! The header of a PLY file.

use crate::error::{Result, SceneError};
use std::path::Path;

/// A header longer than this is not one: the longest in use, a few hundred properties, take a
/// tenth.
const MAX_HEADER_BYTES: usize = 1 << 16;

/// Encoding of the values after the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of one binary value.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// One value of a row, or a list of them with its count in front.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum PropertyType {
    Single(Scalar),
    List { count: Scalar, item: Scalar },
}

/// A named property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: PropertyType,
}

/// A table of the file: `count` rows of `properties`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes a binary row takes, lists being empty.
    pub(super) fn min_row_bytes(&self) -> usize {
        self.properties
            .iter()
            .map(|property| match property.kind {
                PropertyType::Single(scalar) => scalar.size(),
                PropertyType::List { count, .. } => count.size(),
            })
            .sum()
    }

    /// Whether every binary row takes [`Self::min_row_bytes`].
    pub(super) fn has_fixed_rows(&self) -> bool {
        self.properties
            .iter()
            .all(|property| matches!(property.kind, PropertyType::Single(_)))
    }
}

/// The header of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Offset of the values, bytes from the start of the file.
    pub(super) num_bytes: usize,
}

/// Parses the header at the start of `bytes`.
///
/// # Errors
/// [`SceneError::Invalid`] naming the line of the header and its text.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Header> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut lines = Lines {
        bytes: &bytes[..bytes.len().min(MAX_HEADER_BYTES)],
        position: 0,
        number: 0,
    };
    if lines.next_line().as_deref() != Some("ply") {
        return Err(SceneError::invalid(path, "header", "not a PLY file"));
    }
    loop {
        let Some(line) = lines.next_line() else {
            return Err(SceneError::invalid(
                path,
                "header",
                format!("truncated: no end_header in {} bytes", lines.bytes.len()),
            ));
        };
        let number = lines.number;
        let bad = |problem: &str| {
            let text: String = line.chars().take(80).collect();
            SceneError::invalid(
                path,
                format!("header line {number}"),
                format!("{problem}: `{}`", text.escape_debug()),
            )
        };
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, _version] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(bad("unknown format")),
                });
            }
            ["element", name, count] => elements.push(Element {
                name: (*name).to_owned(),
                count: count.parse().map_err(|_| bad("the count is no number"))?,
                properties: Vec::new(),
            }),
            ["property", rest @ ..] => {
                let element = elements
                    .last_mut()
                    .ok_or_else(|| bad("property before any element"))?;
                let (name, kind) = property(rest).ok_or_else(|| bad("unknown property type"))?;
                if element.properties.iter().any(|other| other.name == name) {
                    return Err(bad("property listed twice"));
                }
                element.properties.push(Property {
                    name: name.to_owned(),
                    kind,
                });
            }
            _ => return Err(bad("unknown keyword")),
        }
    }
    Ok(Header {
        encoding: encoding.ok_or_else(|| SceneError::invalid(path, "header", "no format line"))?,
        elements,
        num_bytes: lines.position,
    })
}

fn property<'a>(words: &[&'a str]) -> Option<(&'a str, PropertyType)> {
    match words {
        ["list", count, item, name] => Some((
            name,
            PropertyType::List {
                count: Scalar::parse(count)?,
                item: Scalar::parse(item)?,
            },
        )),
        [scalar, name] => Some((name, PropertyType::Single(Scalar::parse(scalar)?))),
        _ => None,
    }
}

/// Lines ending in "\n" or "\r\n".
struct Lines<'a> {
    bytes: &'a [u8],
    position: usize,
    number: usize,
}

impl Lines<'_> {
    fn next_line(&mut self) -> Option<String> {
        let rest = &self.bytes[self.position..];
        let length = rest.iter().position(|&byte| byte == b'\n')?;
        self.position += length + 1;
        self.number += 1;
        let line = rest[..length]
            .strip_suffix(b"\r")
            .unwrap_or(&rest[..length]);
        Some(String::from_utf8_lossy(line).into_owned())
    }
}
