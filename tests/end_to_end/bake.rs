//! `eagpt bake`: an edited scene in, one with its light baked out.

use crate::support::Workplace;
use eagpt_scene::ply;

/// A room, and `edited.ply`: its lamps off and a ball light in it.
fn workplace() -> Workplace {
    Workplace::shared("edited", edited)
}

fn edited() -> Workplace {
    let place = Workplace::trained();
    let script = "[[step]]
select = { emission = { min = 0.1 } }
then = [\"lights_off\", { set_albedo = 0.5 }]

[[step]]
insert = { ball = { centre = [0, 0, 1], radius = 0.3, radiance = 5 } }
";
    std::fs::write(place.path("ball.toml"), script).unwrap();
    place.succeeds("edit run/scene.ply ball.toml --out edited.ply");
    place
}

#[test]
fn solving_changes_nothing_but_what_reflects_and_repeat_to_the_bit() {
    let place = workplace();
    let bake = "bake edited.ply --cameras room --samples 32";
    place.succeeds(&format!("{bake} --out a.ply --threads 1"));
    place.succeeds(&format!("{bake} --out b.ply --threads 2"));
    assert_eq!(place.bytes("a.ply"), place.bytes("b.ply"));
    let edited = ply::read_gaussians(&place.path("edited.ply")).unwrap();
    let mut baked = ply::read_gaussians(&place.path("a.ply")).unwrap();
    let mut num_changed = 0;
    for i in 0..edited.len() {
        if edited.emissions[i] > 0.1 {
            assert_eq!(baked.radiances[i], edited.radiances[i]);
        } else {
            assert!(baked.radiances[i].is_finite());
            num_changed += usize::from(baked.radiances[i] != edited.radiances[i]);
        }
    }
    let num_dark = edited.emissions.iter().filter(|e| **e <= 0.1).count();
    assert_eq!(num_changed, num_dark);
    baked.radiances.clone_from(&edited.radiances);
    assert_eq!(baked, edited);
    // At whatever does not emit, half of 32 directions about the normal, towards emitters what is
    // above the surface of the others, and half as many and one to what is brightly lit.
    let record = place.json("a.record.json");
    let num_rays = record["options"]["num_rays"].as_u64().unwrap() as usize;
    assert!((17 * num_dark..=41 * num_dark).contains(&num_rays));
    assert_eq!(record["options"]["method"], "gaussians");
    assert!(!place.path("a.work").exists());
    // The same command does not replace its result, and --force does.
    place.fails(&format!("{bake} --out a.ply"), &["a.ply", "--force"]);
    place.succeeds(&format!("{bake} --out a.ply --bounces 1 --force"));
    assert_ne!(place.bytes("a.ply"), place.bytes("b.ply"));
}

/// Edits one after the other with the matrix of the first bake: bit-identical to bakes from
/// nothing, and no ray as long as the geometry is the same.
#[test]
fn a_transport_matrix_is_reused_while_the_geometry_is_the_same() {
    let place = workplace();
    let num_rays = |name: &str| {
        let record = place.json(&format!("{name}.record.json"));
        record["options"]["num_rays"].as_u64().unwrap()
    };
    let bake = |scene: &str, rest: &str| {
        place.succeeds(&format!(
            "bake {scene}.ply --cameras room --samples 32 {rest}"
        ))
    };
    bake("edited", "--out a.ply");
    bake("edited", "--out b.ply --transport k.transport --threads 1");
    assert_eq!(place.bytes("a.ply"), place.bytes("b.ply"));
    assert_eq!(num_rays("a"), num_rays("b"));
    bake("edited", "--out c.ply --transport k.transport");
    assert_eq!(place.bytes("a.ply"), place.bytes("c.ply"));
    assert_eq!(num_rays("c"), 0);
    let inputs = place.json("c.record.json")["inputs"].to_string();
    assert!(inputs.contains("k.transport"), "{inputs}");

    // Albedos and the light of the lamp: not a ray, and the bits of a bake from nothing, since
    // there is one lamp.
    let script = "[[step]]
select = { emission = { min = 0.1 } }
then = [{ scale_light = 2 }]

[[step]]
select = { half_space = { point = [0, 0, 0], normal = \"x\" } }
then = [{ set_albedo = [0.7, 0.2, 0.2] }]
";
    std::fs::write(place.path("light.toml"), script).unwrap();
    place.succeeds("edit edited.ply light.toml --out light.ply");
    bake("light", "--out light-a.ply");
    bake("light", "--out light-b.ply --transport k.transport");
    assert_eq!(num_rays("light-b"), 0);
    assert_eq!(place.bytes("light-a.ply"), place.bytes("light-b.ply"));

    // A second lamp is another geometry: all is traced anew, and kept from then on.
    let script = "[[step]]
insert = { ball = { centre = [0.6, 0.6, 1.6], radius = 0.1, radiance = 9 } }
";
    std::fs::write(place.path("more.toml"), script).unwrap();
    place.succeeds("edit light.ply more.toml --out more.ply");
    bake("more", "--out more-a.ply");
    let text = bake("more", "--out more-b.ply --transport k.transport --json");
    assert!(
        text.contains("k.transport: rays of another geometry"),
        "{text}"
    );
    assert_eq!(num_rays("more-b"), num_rays("more-a"));
    assert_eq!(place.bytes("more-a.ply"), place.bytes("more-b.ply"));
    bake("more", "--out more-c.ply --transport k.transport");
    assert_eq!(num_rays("more-c"), 0);
    assert_eq!(place.bytes("more-a.ply"), place.bytes("more-c.ply"));

    // One of the lamps a hundred times as bright: it would be sampled too little.
    let script = "[[step]]
select = { sphere = { centre = [0.6, 0.6, 1.6], radius = 0.2 }, emission = { min = 0.1 } }
then = [{ scale_light = 100 }]
";
    std::fs::write(place.path("glare.toml"), script).unwrap();
    place.succeeds("edit more.ply glare.toml --out glare.ply");
    bake("glare", "--out glare-a.ply");
    let text = bake("glare", "--out glare-b.ply --transport k.transport --json");
    assert!(text.contains("k.transport: light samples of"), "{text}");
    assert_eq!(place.bytes("glare-a.ply"), place.bytes("glare-b.ply"));
}

#[test]
fn a_transport_matrix_is_of_one_key_and_not_believed_when_damaged() {
    let place = workplace();
    let bake = "bake edited.ply --cameras room --samples 8 --transport k.transport";
    place.succeeds(&format!("{bake} --out a.ply"));
    let text = place.succeeds(&format!("{bake} --seed 1 --out b.ply --json"));
    assert!(text.contains("k.transport: rays of another seed"), "{text}");
    place.succeeds("bake edited.ply --cameras room --samples 8 --seed 1 --out c.ply");
    assert_eq!(place.bytes("b.ply"), place.bytes("c.ply"));
    let mut bytes = place.bytes("k.transport");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(place.path("k.transport"), bytes).unwrap();
    place.fails(&format!("{bake} --out d.ply"), &["k.transport", "damaged"]);
    place.fails(
        &format!("{bake} --out d.ply --method views"),
        &["--transport", "--method gaussians"],
    );
    let other = "bake edited.ply --cameras room --out d.ply --transport edited.ply";
    place.fails(other, &["edited.ply", "damaged"]);
}

#[test]
fn shards_of_views_come_together_to_the_same_bits() {
    let place = workplace();
    let bake = "bake edited.ply --cameras room --method views --spp 2 --bounces 2 --iterations 8";
    for part in ["1/2", "2/2"] {
        let text = place.succeeds(&format!("{bake} --out parts.ply --shard {part} --json"));
        assert!(text.contains("\"complete\":false"), "{text}");
        assert!(!place.path("parts.ply").exists());
    }
    place.succeeds(&format!("{bake} --out parts.ply"));
    place.succeeds(&format!("{bake} --out whole.ply"));
    assert_eq!(place.bytes("parts.ply"), place.bytes("whole.ply"));
    // All rays were traced by the shards.
    assert_eq!(place.json("parts.record.json")["options"]["num_rays"], 0);
    assert_ne!(place.json("whole.record.json")["options"]["num_rays"], 0);
    // The work folder is a dataset of what the bake saw.
    place.succeeds("render edited.ply --cameras whole.work --split all --mode 0-bounce --out out");
    // It belongs to this bake.
    place.fails(
        &format!("{bake} --seed 1 --out other.ply --work whole.work"),
        &["whole.work", "other options", "--force"],
    );
}

#[test]
fn what_cannot_be_baked_is_told_before_the_work() {
    let place = workplace();
    let script = "[[step]]\nselect = { emission = { min = 0.1 } }\nthen = [\"remove\"]\n";
    std::fs::write(place.path("dark.toml"), script).unwrap();
    place.succeeds("edit edited.ply dark.toml --out dark.ply");
    place.fails(
        "bake dark.ply --cameras room --out baked.ply",
        &["dark.ply", "emission", "nothing emits"],
    );
    place.fails(
        "bake edited.ply --cameras room --out edited.ply",
        &["edited.ply", "input"],
    );
    place.fails(
        "bake edited.ply --cameras room --out baked.ply --shard 1/2",
        &["--shard", "--method views"],
    );
    place.fails(
        "bake edited.ply --cameras room --out run/scene.ply --force",
        &["run", "--force does not replace it"],
    );
    assert!(!place.path("baked.ply").exists());
}
