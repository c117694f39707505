//! Metadata of Canon's CRW files: CIFF, a tree of heaps (Canon, "CIFF Specification on Image Data
//! File" 1.0; tags as ExifTool documents them).
//!
//! A heap ends with the place of its directory, whose entries are values or heaps. Everything is
//! checked against the bytes that are there.

use super::Metadata;

/// Entries of a directory that are read, and heaps in heaps: more would be a damaged file.
const MAX_ENTRIES: usize = 512;
const MAX_DEPTH: u32 = 8;

const MAKE_MODEL: u16 = 0x080a;
const FOCAL_LENGTH: u16 = 0x1029;
const SHOT_INFO: u16 = 0x102a;
const IMAGE_SPEC: u16 = 0x1810;
const EXPOSURE: u16 = 0x1818;
const TIME: u16 = 0x180e;

/// Adds to the metadata what a CRW file says; nothing for other files.
pub(super) fn fill(metadata: &mut Metadata, bytes: &[u8]) {
    let Some(file) = Ciff::new(bytes) else { return };
    let root = &bytes[file.header..];
    // A damaged heap ends the search, with what was found before.
    let _ = file.heap(root, MAX_DEPTH, metadata);
}

struct Ciff {
    is_little_endian: bool,
    /// Bytes before the outermost heap.
    header: usize,
}

impl Ciff {
    fn new(bytes: &[u8]) -> Option<Self> {
        let is_little_endian = match bytes.get(..2)? {
            b"II" => true,
            b"MM" => false,
            _ => return None,
        };
        let mut file = Self {
            is_little_endian,
            header: 0,
        };
        file.header = file.u32(bytes, 2)? as usize;
        (bytes.get(6..14)? == b"HEAPCCDR" && file.header <= bytes.len()).then_some(file)
    }

    fn u16(&self, bytes: &[u8], at: usize) -> Option<u16> {
        let value = bytes.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(match self.is_little_endian {
            true => u16::from_le_bytes(value),
            false => u16::from_be_bytes(value),
        })
    }

    fn u32(&self, bytes: &[u8], at: usize) -> Option<u32> {
        let value = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(match self.is_little_endian {
            true => u32::from_le_bytes(value),
            false => u32::from_be_bytes(value),
        })
    }

    fn f32(&self, bytes: &[u8], at: usize) -> Option<f64> {
        let value = f32::from_bits(self.u32(bytes, at)?);
        value.is_finite().then_some(f64::from(value))
    }

    /// Reads the entries of a heap and of those in it; `None` where it is damaged.
    fn heap(&self, heap: &[u8], depth: u32, found: &mut Metadata) -> Option<()> {
        let directory = self.u32(heap, heap.len().checked_sub(4)?)? as usize;
        let num = usize::from(self.u16(heap, directory)?).min(MAX_ENTRIES);
        for index in 0..num {
            let entry = directory.checked_add(2 + 10 * index)?;
            let kind = self.u16(heap, entry)?;
            // The two highest bits: whether the value is in the entry. The lowest fourteen: its
            // tag.
            let value = if kind & 0xc000 == 0x4000 {
                heap.get(entry + 2..entry + 10)?
            } else {
                let size = self.u32(heap, entry + 2)? as usize;
                let start = self.u32(heap, entry + 6)? as usize;
                heap.get(start..start.checked_add(size)?)?
            };
            let tag = kind & 0x3fff;
            match tag & 0x3800 {
                0x2800 | 0x3000 if depth > 0 => self.heap(value, depth - 1, found)?,
                _ => self.value(tag, value, found),
            }
        }
        Some(())
    }

    fn value(&self, tag: u16, value: &[u8], found: &mut Metadata) {
        match tag {
            MAKE_MODEL => {
                let text = String::from_utf8_lossy(value);
                let mut parts = text.split('\0').map(str::trim);
                for known in [&mut found.make, &mut found.model] {
                    let part = parts.next().unwrap_or_default();
                    if known.is_empty() {
                        part.clone_into(known);
                    }
                }
            }
            // APEX: time 2^−Tv s, f-number 2^(Av / 2).
            EXPOSURE => {
                let [tv, av] = [4, 8].map(|at| self.f32(value, at));
                found.exposure_s = found.exposure_s.or(tv.map(|tv| (-tv).exp2()));
                found.f_number = found.f_number.or(av.map(|av| (0.5 * av).exp2()));
            }
            // Base and automatic speed: steps of 1/32 of a stop from 100/32 and from 100 %.
            SHOT_INFO => {
                let steps =
                    |index: usize| Some((f64::from(self.u16(value, 2 * index)?) / 32.0).exp2());
                let iso = steps(2)
                    .zip(steps(1))
                    .map(|(base, auto)| 100.0 / 32.0 * base * auto);
                found.iso = found.iso.or(iso.filter(|iso| (1.0..1e7).contains(iso)));
            }
            FOCAL_LENGTH => {
                let mm = self.u16(value, 2).filter(|mm| *mm > 0);
                found.focal_mm = found.focal_mm.or(mm.map(f64::from));
            }
            TIME => {
                let seconds = self.u32(value, 0).filter(|seconds| *seconds > 0);
                found.time_s = found.time_s.or(seconds.map(f64::from));
            }
            // Width, height, width of a pixel over its height.
            IMAGE_SPEC => {
                let aspect = self.f32(value, 8).filter(|aspect| *aspect > 0.0);
                found.pixel_aspect = found.pixel_aspect.or(aspect);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A heap of entries and the directory behind them: values of more than 8 bytes, or heaps, lie
    /// before it.
    fn heap(entries: &[(u16, Vec<u8>)], be: bool) -> Vec<u8> {
        let u16_bytes = |v: u16| if be { v.to_be_bytes() } else { v.to_le_bytes() };
        let u32_bytes = |v: usize| {
            let v = v as u32;
            if be { v.to_be_bytes() } else { v.to_le_bytes() }
        };
        let (mut heap, mut directory) = (Vec::new(), u16_bytes(entries.len() as u16).to_vec());
        for (tag, value) in entries {
            if tag & 0x3800 < 0x2800 && value.len() == 8 {
                directory.extend(u16_bytes(tag | 0x4000));
                directory.extend(value);
            } else {
                directory.extend(u16_bytes(*tag));
                directory.extend([u32_bytes(value.len()), u32_bytes(heap.len())].concat());
                heap.extend(value);
            }
        }
        let place = u32_bytes(heap.len());
        heap.extend(directory);
        heap.extend(place);
        heap
    }

    fn crw(be: bool) -> Vec<u8> {
        let u16s = |values: &[u16]| -> Vec<u8> {
            let bytes = |v: &u16| if be { v.to_be_bytes() } else { v.to_le_bytes() };
            values.iter().flat_map(bytes).collect()
        };
        let u32s = |values: &[u32]| -> Vec<u8> {
            let bytes = |v: &u32| if be { v.to_be_bytes() } else { v.to_le_bytes() };
            values.iter().flat_map(bytes).collect()
        };
        // 1/60 s, f/4.
        let exposure = [0.0, 60f32.log2(), 4.0].map(f32::to_bits);
        let camera = heap(&[(MAKE_MODEL, b"Canon\0Canon EOS D60\0".to_vec())], be);
        // ISO 200 of a base of 100: 32 · 5 steps of 100/32, and one stop more.
        let shot = heap(
            &[
                (SHOT_INFO, u16s(&[8, 32, 160, 0])),
                (FOCAL_LENGTH, u16s(&[2, 35, 0, 0])),
            ],
            be,
        );
        let spec = [[3072, 2048, 1.0f32.to_bits(), 0], [12, 8, 1, 0]].concat();
        let image = heap(
            &[
                (0x2807, camera),
                (0x300b, shot),
                (EXPOSURE, u32s(&exposure)),
                (TIME, u32s(&[1_041_379_200, 0, 0])),
                (IMAGE_SPEC, u32s(&spec)),
            ],
            be,
        );
        let root = heap(&[(0x2005, vec![1; 40]), (0x300a, image)], be);
        let mark: &[u8] = if be { b"MM" } else { b"II" };
        [mark, &u32s(&[26]), b"HEAPCCDR", &[0; 12], &root].concat()
    }

    #[test]
    fn a_file_says_how_it_was_exposed() {
        for be in [false, true] {
            let mut found = Metadata::default();
            fill(&mut found, &crw(be));
            assert_eq!(found.camera(), "Canon EOS D60");
            assert!((found.exposure_s.unwrap() - 1.0 / 60.0).abs() < 1e-8);
            assert!((found.f_number.unwrap() - 4.0).abs() < 1e-12);
            assert!((found.iso.unwrap() - 200.0).abs() < 1e-9);
            assert_eq!(found.focal_mm, Some(35.0));
            assert_eq!(found.time_s, Some(1_041_379_200.0));
            assert_eq!(found.pixel_aspect, Some(1.0));
        }
    }

    #[test]
    fn damaged_files_end_the_search() {
        let good = crw(false);
        for length in 0..good.len() {
            fill(&mut Metadata::default(), &good[..length]);
        }
        for at in 0..good.len() {
            for value in [0, 0x30, 0xff] {
                let mut bad = good.clone();
                bad[at] = value;
                fill(&mut Metadata::default(), &bad);
            }
        }
        let mut none = Metadata::default();
        fill(&mut none, b"II\x2a\0\x08\0\0\0 no CIFF");
        assert_eq!(none, Metadata::default());
    }
}
