//! Arguments and options that make no sense, and folders that hold something else.

use crate::support::Workplace;

#[test]
fn unknown_and_impossible_options() {
    let place = Workplace::new();
    place.write("a.toml", "[radiance]\niteration = 5\n");
    place.fails_cleanly(
        "train room --out run --config a.toml",
        &["a.toml", "option radiance.iteration", "no such option"],
    );
    place.write("a.toml", "seed = 1\nseed = = 2\n");
    place.fails_cleanly(
        "train room --out run --config a.toml",
        &["a.toml", "line 2"],
    );
    place.write("a.toml", [0xff, 0xfe]);
    place.fails_cleanly("train room --out run --config a.toml", &["a.toml", "utf-8"]);
    place.fails_cleanly("train room --out run --config none.toml", &["none.toml"]);
    place.fails_cleanly(
        "train room --out run --set init.opacity=1.5",
        &["--set init.opacity=1.5", "init.opacity", "1.5"],
    );
    place.fails_cleanly(
        "train room --out run --set stage=both",
        &["--set stage=both", "both"],
    );
    place.fails_cleanly("eval pair a.exr b.exr --ppd 0", &["ppd", "0"]);
}

#[test]
fn wrong_arguments_have_exit_code_2() {
    let place = Workplace::new();
    for arguments in [
        "",
        "paint",
        "train room",
        "train room --out run --iterations 0",
        "train room --out run --resume --force",
        "render a.ply --cameras room --mode 2-bounce --out out",
        "render a.ply --cameras room --mode path --out out --emission-threshold 1.5",
        "render a.ply --cameras room --mode path --out out --aov depth,colour",
        "eval",
    ] {
        let output = place.run(arguments);
        assert_eq!(output.status.code(), Some(2), "eagpt {arguments}");
    }
    assert_eq!(place.names("out"), [""; 0]);
}

#[test]
fn help_is_there_for_every_command() {
    let place = Workplace::new();
    for command in [
        "",
        "train",
        "render",
        "eval",
        "eval pair",
        "eval table",
        "edit",
        "export",
    ] {
        let help = place.succeeds(&format!("{command} --help"));
        assert!(
            help.contains("Usage: eagpt") && help.contains("--threads"),
            "{command}: {help}"
        );
    }
    assert!(place.succeeds("--version").starts_with("eagpt "));
}

#[test]
fn dumped_options_read_back() {
    let place = Workplace::new();
    let dumped = place
        .succeeds("train --preset paper --seed 7 --set radiance.rates.scale=0.002 --dump-config");
    place.write("a.toml", &dumped);
    assert_eq!(
        place.succeeds("train --config a.toml --dump-config"),
        dumped
    );
    let changed = place.succeeds("train --config a.toml --iterations 9 --dump-config");
    assert_eq!(
        changed,
        dumped.replace("iterations = 30000", "iterations = 9")
    );
}

#[test]
fn views_that_are_not_there() {
    let place = Workplace::trained();
    let render = "render run/scene.ply --cameras room --mode 0-bounce --out out";
    place.fails_cleanly(
        &format!("{render} --views 000,0012"),
        &["room/transforms.json", "--views", "`0012`"],
    );
    place.fails_cleanly(&format!("{render} --views 001,001"), &["001.exr", "twice"]);
}

#[test]
fn no_command_removes_what_another_made() {
    let place = Workplace::trained();
    let render = "render run/scene.ply --cameras room --mode 0-bounce";
    place.fails_cleanly(&format!("{render} --out run"), &["run", "record.json"]);
    place.fails_cleanly(
        &format!("{render} --out run --force"),
        &["run/record.json", "`train`"],
    );
    place.fails_cleanly(
        &format!("{render} --out room/Radiance-exr --force"),
        &["Radiance-exr/000.exr", "an input"],
    );
    place.succeeds(&format!("{render} --out out"));
    place.fails_cleanly(
        "train room --out out --preset draft --force",
        &["out/record.json", "`render`"],
    );
    place.fails_cleanly(
        "train room --out run --preset draft",
        &["run", "--resume", "--force"],
    );
    place.fails_cleanly("train room --out run --resume --seed 8", &["run", "seed"]);
    place.fails_cleanly("eval out --reference room --out out --force", &["out"]);
    place.succeeds("eval out --reference room --out eval");
    place.fails_cleanly("eval out --reference room --out eval", &["eval", "--force"]);
    place.succeeds("eval out --reference room --out eval --force");
}
