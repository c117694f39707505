//! A scene as a page for a browser. What the page shows is tested in a browser, by
//! `viewer/page/test`.

use crate::support::Workplace;

/// The value of an element of the page that holds data.
fn part<'a>(page: &'a str, id: &str) -> &'a str {
    let start = page.split_once(&format!("id=\"{id}\">")).unwrap().1;
    start.split_once("</script>").unwrap().0
}

#[test]
fn a_page_has_the_scene_and_its_views() {
    let place = Workplace::trained();
    let export = "export run/scene.ply --format html";
    let told = place.succeeds(&format!("{export} --dataset room --out room.html --json"));
    let done: serde_json::Value = serde_json::from_str(told.lines().last().unwrap()).unwrap();
    let error = &done["quantisation_error"];
    assert!(error["radiance"].as_f64().unwrap() < 0.0028, "{done}");
    assert!(error["position"].as_f64().unwrap() > 0.0, "{done}");
    let page = String::from_utf8(place.bytes("room.html")).unwrap();
    let meta: serde_json::Value = serde_json::from_str(part(&page, "meta")).unwrap();
    let views = meta["views"].as_array().unwrap();
    assert!(!views.is_empty());
    for view in views {
        let photograph = view["photograph"].as_str().unwrap();
        assert!(photograph.starts_with("data:image/jpeg;base64,"));
    }
    assert!(part(&page, "data").len() > 1000);

    place.fails_cleanly(
        &format!("{export} --out room.html"),
        &["room.html", "--force"],
    );
    place.fails_cleanly(
        &format!("{export} --dataset room --views 999 --out b.html"),
        &["--views", "there is no view `999`"],
    );
    place.fails_cleanly(
        "export run/scene.ply --format 3dgs --tone-map agx --out b.ply",
        &["--tone-map", "--format html"],
    );
    let first = views[0]["name"].as_str().unwrap();
    place.succeeds(&format!(
        "{export} --dataset room --views {first} --photograph-size 0 --title Room --out c.html"
    ));
    let page = String::from_utf8(place.bytes("c.html")).unwrap();
    let meta: serde_json::Value = serde_json::from_str(part(&page, "meta")).unwrap();
    assert_eq!(meta["views"].as_array().unwrap().len(), 1);
    assert!(meta["views"][0]["photograph"].is_null() && meta["title"] == "Room");
}
