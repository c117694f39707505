//! Gaussians of other programs: imported, rendered, measured, trained on from.

use crate::support::{SHORT, Workplace};
use eagpt_scene::ply;

#[test]
fn gaussians_of_other_programs_become_a_scene_and_get_albedo() {
    let place = Workplace::trained();
    for format in ["2dgs", "3dgs"] {
        place.succeeds(&format!(
            "export run/scene.ply --format {format} --out {format}.ply"
        ));
        place.fails_cleanly(
            &format!("render {format}.ply --cameras room --mode 0-bounce --out renders"),
            &[&format!("{format}.ply"), "`eagpt import`"],
        );
        place.succeeds(&format!("import {format}.ply --out {format}-scene.ply"));
    }
    assert_eq!(place.bytes("2dgs-scene.ply"), place.bytes("3dgs-scene.ply"));
    place.fails_cleanly(
        "import 3dgs.ply --out 3dgs-scene.ply",
        &["3dgs-scene.ply", "--force"],
    );
    place.fails_cleanly(
        "import 3dgs.ply --out 3dgs.ply --force",
        &["would replace an input"],
    );
    place.fails_cleanly(
        "import run/scene.ply --out other.ply",
        &["run/scene.ply", "a scene already"],
    );
    place.fails_cleanly(
        "import 3dgs.ply --aligned room --out other.ply",
        &["room/transforms.json", "aligned_from_model"],
    );
    let render = "render 3dgs-scene.ply --cameras room --mode 0-bounce --out renders";
    place.succeeds(render);
    place.succeeds("eval renders --reference room --out eval");

    // Stage 1 alone keeps what was imported and finds the albedo.
    let train = "train room --start 3dgs-scene.ply --out more";
    let albedo = format!("{train} {SHORT} --stage albedo");
    place.succeeds(&albedo);
    let read = |file: &str| ply::read_gaussians(&place.path(file)).unwrap();
    let (before, after) = (read("3dgs-scene.ply"), read("more/scene.ply"));
    assert_eq!(before.len(), after.len());
    let sum = |of: &eagpt_scene::Gaussians| -> f32 {
        of.radiances.iter().map(|radiance| radiance.x).sum()
    };
    assert!((sum(&before) / sum(&after) - 1.0).abs() < 1e-3);
    let inputs = place.json("more/record.json")["inputs"].to_string();
    assert!(inputs.contains("3dgs-scene.ply"), "{inputs}");
    assert!(
        after
            .albedos
            .iter()
            .any(|albedo| (albedo.x - 0.5).abs() > 1e-3)
    );
    place.fails(&albedo, &["more", "--force"]);
    // Both stages, and a run whose start is another one.
    place.succeeds(&format!("{train} {SHORT} --force"));
    place.fails(
        &format!("train room --start run/scene.ply --out more {SHORT} --resume"),
        &["more", "another scene to start from"],
    );
}
