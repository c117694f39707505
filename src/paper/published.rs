//! Numbers of the paper: EAG-PT (SIGGRAPH 2026, arXiv 2601.23065), Tables 1 to 3.
//!
//! Measured by its authors on an RTX 4090 at 540×360 or 360×540 pixels, 1,024 samples a pixel, 7
//! bounces where a row says nothing else. PSNR is that of sRGB, FLIP is HDR-FLIP, LPIPS that of
//! VGG. Where the paper has no number there is none here.

use eagpt_eval::tabulate::repeats::SECONDS;
use std::collections::BTreeMap;

/// Scenes with numbers, by the names to give datasets.
pub(super) const SCENES: [&str; 4] = ["b-kitchen", "b-livingroom", "f-classroom", "f-conference"];

/// Measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Light {
    /// As photographed.
    Original,
    /// Changed.
    Relit,
}

use Light::{Original, Relit};

/// Key of a value that this program does not measure.
const LPIPS: &str = "lpips_vgg";

/// PSNR in dB, LPIPS and FLIP of images.
const IMAGES: [(&str, Light, &str, [f64; 3]); 20] = [
    // Table 1.
    ("b-kitchen", Original, "0-bounce", [37.57, 0.0680, 0.0732]),
    ("b-kitchen", Original, "1-bounce", [32.05, 0.0733, 0.1064]),
    ("b-kitchen", Original, "path", [26.57, 0.0829, 0.1759]),
    ("b-kitchen", Relit, "0-bounce", [16.22, 0.1098, 0.3593]),
    ("b-kitchen", Relit, "1-bounce", [19.78, 0.0896, 0.3176]),
    ("b-kitchen", Relit, "path", [28.70, 0.0825, 0.1839]),
    ("b-kitchen", Relit, "baked", [28.97, 0.0977, 0.1823]),
    (
        "b-livingroom",
        Original,
        "0-bounce",
        [37.83, 0.0587, 0.0646],
    ),
    (
        "b-livingroom",
        Original,
        "1-bounce",
        [33.02, 0.0724, 0.0982],
    ),
    ("b-livingroom", Original, "path", [27.03, 0.0829, 0.1843]),
    ("b-livingroom", Relit, "0-bounce", [11.59, 0.1687, 0.5147]),
    ("b-livingroom", Relit, "1-bounce", [15.47, 0.1243, 0.4474]),
    ("b-livingroom", Relit, "path", [29.30, 0.0983, 0.2047]),
    ("b-livingroom", Relit, "baked", [29.33, 0.1033, 0.2045]),
    // Table 2.
    ("f-classroom", Original, "0-bounce", [32.09, 0.1432, 0.1329]),
    ("f-classroom", Original, "1-bounce", [30.37, 0.1849, 0.1658]),
    ("f-classroom", Original, "path", [28.65, 0.1998, 0.2117]),
    (
        "f-conference",
        Original,
        "0-bounce",
        [29.41, 0.1809, 0.1326],
    ),
    (
        "f-conference",
        Original,
        "1-bounce",
        [28.57, 0.1834, 0.1490],
    ),
    ("f-conference", Original, "path", [26.44, 0.1960, 0.2066]),
];

/// PSNR of the ablations of Table 3; its full model is the path-traced row of Table 2.
const ABLATIONS: [(&str, f64); 8] = [
    ("no-normal-supervision", 28.29),
    ("no-normal-consistency", 29.20),
    ("inaccurate-masks", 23.58),
    ("bounces-3", 24.94),
    ("bounces-7", 28.65),
    ("spp-256", 28.57),
    ("spp-1024", 28.65),
    ("spp-4096", 28.67),
];
/// The scene of Table 3.
const ABLATED: &str = "f-classroom";

/// Seconds a frame, of Tables 1 and 3.
const TIMES: [(&str, &str, f64); 13] = [
    ("b-kitchen", "0-bounce", 0.015),
    ("b-kitchen", "1-bounce", 27.9),
    ("b-kitchen", "path", 188.0),
    ("b-livingroom", "0-bounce", 0.013),
    ("b-livingroom", "1-bounce", 22.4),
    ("b-livingroom", "path", 155.0),
    ("f-classroom", "path", 123.0),
    ("f-classroom", "bounces-3", 55.0),
    ("f-classroom", "bounces-7", 123.0),
    ("f-classroom", "bounces-11", 187.0),
    ("f-classroom", "spp-256", 31.0),
    ("f-classroom", "spp-4096", 496.0),
    ("f-classroom", "fewer-gaussians", 110.0),
];

/// The numbers of a row, by the keys of metrics; empty where there are none.
pub(super) fn values(scene: &str, light: Light, row: &str) -> BTreeMap<String, f64> {
    let mut found = BTreeMap::new();
    let mut put = |key: &str, value: f64| {
        found.insert(key.to_owned(), value);
    };
    let is_it = |of: &&(&str, Light, &str, [f64; 3])| (of.0, of.1, of.2) == (scene, light, row);
    if let Some((_, _, _, [psnr, lpips, flip])) = IMAGES.iter().find(is_it) {
        put("psnr_srgb_db", *psnr);
        put(LPIPS, *lpips);
        put("flip_hdr", *flip);
    }
    if light == Original {
        let ablation = ABLATIONS.iter().filter(|_| scene == ABLATED);
        for (_, psnr) in ablation.filter(|(name, _)| *name == row) {
            put("psnr_srgb_db", *psnr);
        }
        for (_, _, seconds) in TIMES.iter().filter(|of| (of.0, of.1) == (scene, row)) {
            put(SECONDS, *seconds);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::rows::ROWS;

    #[test]
    fn every_number_is_of_a_scene_and_a_row() {
        let of_images = IMAGES.iter().map(|of| (of.0, of.2));
        let of_ablations = ABLATIONS.iter().map(|of| (ABLATED, of.0));
        let of_times = TIMES.iter().map(|of| (of.0, of.1));
        for (scene, name) in of_images.chain(of_ablations).chain(of_times) {
            assert!(SCENES.contains(&scene), "{scene}");
            assert!(ROWS.iter().any(|row| row.name == name), "{name}");
        }
        let relit = values("b-kitchen", Relit, "baked");
        assert_eq!(relit["psnr_srgb_db"], 28.97);
        assert!(values("b-kitchen", Original, "spp-256").is_empty());
    }
}
