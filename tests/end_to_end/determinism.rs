//! The same seed gives the same bits: for any number of threads, and for a run that was killed.

use crate::support::Workplace;
#[cfg(unix)]
use std::process::{Child, Stdio};
#[cfg(unix)]
use std::time::{Duration, Instant};

/// Small enough to run several times, with checkpoints close enough together to be killed between
/// them.
const RUN: &str = "--preset draft --iterations 120 --albedo-iterations 40 --gaussians 800 --set output.checkpoint_every=8 --set radiance.harmonics.degree=2";

/// A room with `whole`: [`RUN`] without interruption.
fn place() -> Workplace {
    Workplace::shared("uninterrupted", || {
        let place = Workplace::new();
        place.succeeds(&format!("train room --out whole {RUN} --threads 1"));
        place
    })
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let place = place();
    std::fs::rename(place.path("whole"), place.path("run1")).unwrap();
    place.succeeds(&format!("train room --out run2 {RUN} --threads 2"));
    for threads in [1, 2] {
        place.succeeds(&format!(
            "render run{threads}/scene.ply --cameras room --mode path --spp 3 --seed 9 --views 000 --out out{threads} --threads {threads}"
        ));
    }
    assert_eq!(place.bytes("run1/scene.ply"), place.bytes("run2/scene.ply"));
    assert_eq!(place.bytes("out1/000.exr"), place.bytes("out2/000.exr"));
    // The seed decides, and not only in name.
    place.succeeds(&format!("train room --out other {RUN} --seed 6"));
    assert_ne!(
        place.bytes("run1/scene.ply"),
        place.bytes("other/scene.ply")
    );
}

#[test]
#[cfg(debug_assertions)]
fn a_killed_run_resumes_to_the_same_bits() {
    let place = place();
    let train = format!("train room --out run {RUN}");
    // Once in each stage, between two checkpoints.
    for (failpoint, arguments, checkpoint) in [
        ("radiance=13", train.clone(), "radiance"),
        ("albedo=13", format!("{train} --resume"), "albedo"),
    ] {
        place.is_killed_at(failpoint, &arguments);
        let checkpoints = place.names("run/checkpoints");
        let is_there = |name: &String| name.starts_with(checkpoint) && name.ends_with(".ckpt");
        assert!(checkpoints.iter().any(is_there), "{checkpoints:?}");
        assert!(!place.path("run/scene.ply").exists());
    }
    place.fails(&train, &["run", "--resume"]);
    // The options come from the run itself.
    place.succeeds("train room --out run --resume");
    assert_eq!(place.bytes("run/scene.ply"), place.bytes("whole/scene.ply"));
    let lines = |run: &str| {
        let text = String::from_utf8(place.bytes(&format!("{run}/log.jsonl"))).unwrap();
        text.lines().count()
    };
    assert_eq!(lines("run"), lines("whole"));
}

#[test]
#[cfg(unix)]
fn ctrl_c_ends_a_run_with_a_checkpoint() {
    let place = place();
    let seldom = RUN.replace("checkpoint_every=8", "checkpoint_every=100000");
    let mut child = start(&place, &format!("train room --out run {seldom}"));
    // No checkpoint comes by itself, so wait for the first line of the log.
    wait_for(&mut child, || {
        std::fs::metadata(place.path("run/log.jsonl")).is_ok_and(|file| file.len() > 0)
    });
    let killed = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(place.names("run/checkpoints").len(), 1);
    assert_eq!(place.json("run/record.json")["complete"], false);
    place.succeeds("train room --out run --resume");
    assert_eq!(place.json("run/record.json")["complete"], true);
    assert_eq!(place.bytes("run/scene.ply"), place.bytes("whole/scene.ply"));
}

#[cfg(unix)]
fn start(place: &Workplace, arguments: &str) -> Child {
    place
        .command(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[cfg(unix)]
#[track_caller]
fn wait_for(child: &mut Child, mut holds: impl FnMut() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert_eq!(child.try_wait().unwrap(), None, "it ended by itself");
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "nothing within a minute"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}
