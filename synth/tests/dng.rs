//! DNG files against a reader of somebody else's.

use eagpt_synth::dng::{self, CfaColor, DngInfo, Mosaic};
use std::collections::BTreeMap;
use std::path::Path;

fn info() -> DngInfo {
    DngInfo {
        make: "eagpt".to_owned(),
        model: "Virtual 14".to_owned(),
        cfa: dng::RGGB,
        black: [512, 513, 514, 515],
        white: 16_383,
        as_shot_neutral: [0.5, 1.0, 0.625],
        camera_from_xyz: [
            [0.8139, -0.2171, -0.0664],
            [-0.8747, 1.6541, 0.2295],
            [-0.1925, 0.2008, 0.8093],
        ],
        exposure_s: Some(1.0 / 60.0),
        iso: 200,
        f_number: 5.6,
        focal_length_mm: 24.0,
        taken_ms: 1_772_359_200_250,
    }
}

fn mosaic() -> Mosaic {
    let (width, height) = (46, 34);
    let samples = (0..width * height).map(|i| (i * 7919 % 16_384) as u16);
    Mosaic {
        width,
        height,
        samples: samples.collect(),
    }
}

fn write(path: &Path) {
    dng::write(path, &mosaic(), &info()).unwrap();
}

#[test]
fn rawloader_reads_the_same_mosaic_and_levels() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.dng");
    write(&path);
    let image = rawloader::decode_file(&path).unwrap();
    assert_eq!((image.width, image.height, image.cpp), (46, 34, 1));
    let rawloader::RawImageData::Integer(samples) = &image.data else {
        panic!("float samples");
    };
    assert_eq!(*samples, mosaic().samples);
    assert_eq!(image.blacklevels, [512, 513, 514, 515]);
    assert_eq!(image.whitelevels, [16_383; 4]);
    assert_eq!(
        (image.make.as_str(), image.model.as_str()),
        ("eagpt", "Virtual 14")
    );
    let colors = [0, 1, 2, 3].map(|cell| image.cfa.color_at(cell / 2, cell % 2));
    assert_eq!(colors, dng::RGGB.map(|color: CfaColor| color as usize));
    assert_eq!(image.wb_coeffs[..3], [2.0, 1.0, 1.6]);
    for (row, wanted) in image.xyz_to_cam.iter().zip(info().camera_from_xyz) {
        for (found, wanted) in row.iter().zip(wanted) {
            // Single precision of a number below 2.
            assert!((f64::from(*found) - wanted).abs() < 1e-6);
        }
    }
}

/// The bytes of EXIF by a walk over the directories as TIFF 6.0 has them.
#[test]
fn exif_is_in_its_own_directory() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.dng");
    write(&path);
    let bytes = std::fs::read(&path).unwrap();
    let u16_at = |at: usize| u16::from_ne_bytes(bytes[at..at + 2].try_into().unwrap());
    let u32_at = |at: usize| u32::from_ne_bytes(bytes[at..at + 4].try_into().unwrap());
    let directory = |at: usize| -> BTreeMap<u16, usize> {
        let entries = (0..usize::from(u16_at(at))).map(|i| at + 2 + 12 * i);
        let tags: Vec<u16> = entries.clone().map(u16_at).collect();
        assert!(tags.is_sorted(), "{tags:?}");
        tags.into_iter().zip(entries.map(|at| at + 8)).collect()
    };
    let main = directory(u32_at(4) as usize);
    let text = u32_at(main[&306]) as usize;
    assert_eq!(&bytes[text..text + 20], b"2026:03:01 10:00:00\0");
    let exif = directory(u32_at(main[&34665]) as usize);
    let fraction = |tag: u16| {
        let at = u32_at(exif[&tag]) as usize;
        (u32_at(at), u32_at(at + 4))
    };
    assert_eq!(fraction(33434), (1, 60));
    assert_eq!(fraction(33437), (28, 5));
    assert_eq!(fraction(37386), (24, 1));
    assert_eq!(u16_at(exif[&34855]), 200);
}
