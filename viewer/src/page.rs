//! The page, filled with a scene.

use crate::error::Result;
use crate::pack::Pack;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use eagpt_scene::harmonics::{FUNCTION_CONSTANTS, MAX_EXPONENT};
use eagpt_scene::tonemap::{Display, ToneMap, ToneMapper};
use eagpt_scene::{Camera, Gaussians, Lamps};
use eagpt_trace::model::{MAX_RADIUS, MIN_ALPHA, MIN_TRANSMITTANCE, MIN_WEIGHT};
use glam::Vec3;
use serde::Serialize;
use serde_json::{Map, Value, json};

/// The page with places for a scene; see the folder `page`.
const PAGE: &str = include_str!("../dist/viewer.html");

/// Where a page is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PageKind {
    /// In a file of its own.
    File,
    /// At a server that keeps an edit.
    Edit,
    /// At a server of a training.
    Training,
}

/// A camera of the dataset.
#[derive(Debug, Clone)]
pub struct PageView {
    /// Its name.
    pub name: String,
    /// Where it is.
    pub camera: Camera,
    /// Its photograph as [`crate::photograph::embed`] makes it.
    pub photograph: Option<String>,
}

/// All that a page shows beside the Gaussians.
#[derive(Debug, Clone)]
pub struct PageContent<'a> {
    /// Title of the page.
    pub title: &'a str,
    /// Upwards in the world, unit length.
    pub up: Vec3,
    /// Exposure and tone map that the page opens with.
    pub display: Display,
    /// Cameras to jump to; the first is shown at first.
    pub views: &'a [PageView],
    /// Lamps of the scene.
    pub lamps: &'a Lamps,
    /// Where it is.
    pub kind: PageKind,
}

/// The page as one HTML file that needs no other.
///
/// # Errors
/// [`crate::ViewerError::Json`] if the content has numbers that JSON has not.
pub fn html(pack: &Pack, gaussians: &Gaussians, content: &PageContent<'_>) -> Result<String> {
    let meta = serde_json::to_string(&meta(pack, gaussians, content)?)?;
    // Nothing in it may end the element that holds it.
    let meta = meta.replace('<', "\\u003c");
    let title = content.title.replace('&', "&amp;").replace('<', "&lt;");
    let mut page = String::with_capacity(PAGE.len() + meta.len() + 2 * pack.bytes.len());
    let mut rest = PAGE;
    // One place after the other: what is filled in is not searched for places.
    for (place, text) in [
        ("{{TITLE}}", title),
        ("{{META}}", meta),
        ("{{DATA}}", STANDARD.encode(&pack.bytes)),
    ] {
        if let Some((before, after)) = rest.split_once(place) {
            page.push_str(before);
            page.push_str(&text);
            rest = after;
        }
    }
    page.push_str(rest);
    Ok(page)
}

/// A scene for a page that shows another one: its number, what has to be known to unpack it, and
/// the bytes in base64, as JSON.
pub(crate) fn packed(id: u64, pack: &Pack, gaussians: &Gaussians) -> Result<String> {
    let meta = scene_meta(pack, gaussians)?;
    let data = STANDARD.encode(&pack.bytes);
    Ok(json!({ "id": id, "meta": meta, "data": data }).to_string())
}

/// Facts that a page needs to unpack a scene.
fn scene_meta(pack: &Pack, gaussians: &Gaussians) -> Result<Map<String, Value>> {
    let (low, high) = gaussians.bounds().unwrap_or_default();
    let mut meta = Map::new();
    meta.insert("num".to_owned(), json!(pack.num));
    meta.insert("harmonics".to_owned(), json!(pack.has_harmonics));
    meta.insert("bounds".to_owned(), json!([low, high]));
    meta.insert("lights".to_owned(), json!(pack.lights));
    if let Value::Object(steps) = serde_json::to_value(pack.steps.on_page())? {
        meta.extend(steps);
    }
    Ok(meta)
}

fn meta(pack: &Pack, gaussians: &Gaussians, content: &PageContent<'_>) -> Result<Value> {
    let mut meta = json!({
        "title": content.title,
        "model": model(),
        "toneMaps": tone_maps(),
        "display": {
            "exposure": content.display.stops,
            "toneMap": content.display.tone_map.to_string(),
        },
        "up": content.up,
        "views": content.views.iter().map(view).collect::<Vec<_>>(),
        "lamps": serde_json::to_value(&content.lamps.lamps)?,
        "kind": content.kind,
    });
    if let Value::Object(meta) = &mut meta {
        meta.extend(scene_meta(pack, gaussians)?);
    }
    Ok(meta)
}

/// Constants of the model, for the kernels of the page.
fn model() -> Map<String, Value> {
    let of_model = [
        ("MAX_RADIUS", MAX_RADIUS),
        ("MIN_ALPHA", MIN_ALPHA),
        ("MIN_WEIGHT", MIN_WEIGHT),
        ("MIN_TRANSMITTANCE", MIN_TRANSMITTANCE),
        ("MAX_EXPONENT", MAX_EXPONENT),
    ];
    let all = of_model.into_iter().chain(FUNCTION_CONSTANTS);
    all.map(|(name, value)| (name.to_owned(), json!(value)))
        .collect()
}

fn tone_maps() -> Vec<Value> {
    let of = |(map, name): (ToneMap, &str)| {
        let curve = map.mapper().map(ToneMapper::coefficients);
        json!({ "name": name, "curve": curve })
    };
    ToneMap::ALL.map(of).to_vec()
}

fn view(view: &PageView) -> Value {
    let camera = &view.camera;
    let (to_world, origin) = (
        camera.world_from_camera.matrix3,
        camera.world_from_camera.translation,
    );
    let rows = (0..3).flat_map(|k| {
        let row = to_world.row(k);
        [row.x, row.y, row.z, origin[k]]
    });
    json!({
        "name": view.name,
        "width": camera.width,
        "height": camera.height,
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "pose": rows.collect::<Vec<f64>>(),
        "photograph": view.photograph,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::gaussians::random_cloud;

    #[test]
    fn the_page_is_whole_and_names_cannot_leave_their_place() {
        let gaussians = random_cloud(20, 1);
        let pack = Pack::new(&gaussians, &Lamps::default(), None).unwrap();
        let title = "</script>{{DATA}}<b>";
        let content = PageContent {
            title,
            up: Vec3::Z,
            display: Display::default(),
            views: &[],
            lamps: &Lamps::default(),
            kind: PageKind::File,
        };
        for place in ["{{TITLE}}", "{{META}}", "{{DATA}}"] {
            assert_eq!(PAGE.matches(place).count(), 1, "{place}");
        }
        let page = html(&pack, &gaussians, &content).unwrap();
        // As many ends as the page without a scene has: the title has made none.
        assert_eq!(
            page.matches("</script>").count(),
            PAGE.matches("</script>").count()
        );
        assert!(page.contains("<title>&lt;/script>{{DATA}}&lt;b></title>"));
        assert!(page.contains(&STANDARD.encode(&pack.bytes)));
        let start = page.find("id=\"meta\">").unwrap() + "id=\"meta\">".len();
        let text = page[start..].split_once("</script>").unwrap().0;
        let meta: Value = serde_json::from_str(text).unwrap();
        assert_eq!(meta["title"], title);
        assert_eq!(meta["num"], pack.num);
        assert_eq!(meta["toneMaps"].as_array().unwrap().len(), 5);
    }

    #[test]
    fn the_page_needs_no_network() {
        for address in ["http:", "https:", "//cdn", "src=\"//"] {
            // The name of a namespace is no address that anything is loaded from.
            let found = PAGE.replace("http://www.w3.org/", "");
            assert!(!found.contains(address), "{address}");
        }
    }
}
