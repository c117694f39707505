//! Numbers of the paper: EAG-PT (SIGGRAPH 2026, arXiv 2601.23065), Tables 1 to 3.
//!
//! Measured by its authors on an RTX 4090 at 540×360 or 360×540 pixels, 1,024 samples a pixel, 7
//! bounces where a row says nothing else. PSNR is that of sRGB, FLIP is HDR-FLIP, LPIPS that of
//! VGG, which this program does not measure. Where the paper has no number there is none here.

use std::collections::BTreeMap;

/// Scene, light and row, then values under the keys of metrics.
const TABLES: &str = include_str!("published.csv");

/// The light that the paper changes a scene to; the other is [`crate::run::ORIGINAL`].
pub(super) const RELIT: &str = "relit";

/// The first fields of each line of the tables, and its values by the keys of metrics.
fn lines() -> impl Iterator<Item = ([&'static str; 3], BTreeMap<String, f64>)> {
    let mut lines = TABLES.lines();
    let keys = lines.next().unwrap_or_default().split(',').skip(3);
    lines.map(move |line| {
        let fields: Vec<&str> = line.split(',').collect();
        let values = keys.clone().zip(&fields[3..]);
        let values = values.filter_map(|(key, text)| Some((key.to_owned(), text.parse().ok()?)));
        ([fields[0], fields[1], fields[2]], values.collect())
    })
}

/// Whether the paper has numbers of a scene of this name.
pub(super) fn has_scene(name: &str) -> bool {
    lines().any(|([scene, ..], _)| scene == name)
}

/// The numbers of a row, by the keys of metrics; empty where there are none.
pub(super) fn values(scene: &str, light: &str, row: &str) -> BTreeMap<String, f64> {
    let found = lines().find(|(place, _)| *place == [scene, light, row]);
    found.map(|(_, values)| values).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::rows::ROWS;
    use crate::run::ORIGINAL;
    use eagpt_eval::METRICS;
    use eagpt_eval::tabulate::repeats::SECONDS;

    #[test]
    fn every_number_is_of_a_row_and_a_key() {
        for ([_, light, name], values) in lines() {
            assert!([ORIGINAL, RELIT].contains(&light), "{light}");
            assert!(ROWS.iter().any(|row| row.name == name), "{name}");
            assert!(!values.is_empty(), "{name}");
        }
        // A field that is no number would be left out.
        assert_eq!(lines().map(|(_, values)| values.len()).sum::<usize>(), 81);
        let kitchen = values("b-kitchen", ORIGINAL, "path");
        let is_known = |key: &&String| {
            ["lpips_vgg", SECONDS].contains(&key.as_str())
                || METRICS.iter().any(|metric| metric.key == **key)
        };
        assert_eq!(kitchen.keys().filter(is_known).count(), 4);
        let relit = values("b-kitchen", RELIT, "baked");
        assert_eq!(relit["psnr_srgb_db"], 28.97);
        assert!(values("b-kitchen", ORIGINAL, "spp-256").is_empty());
        assert!(has_scene("f-conference") && !has_scene("kitchen"));
    }
}
