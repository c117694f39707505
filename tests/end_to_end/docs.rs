//! The pages of `docs/`: their commands are one walkthrough, which runs here. And the commands of
//! the README.
//!
//! The info string of a fenced block decides what the test does with it:
//!
//! | fence | |
//! |---|---|
//! | `sh` | every line is a command of the program and has to succeed; `\` joins lines, `>` takes standard output to a file |
//! | `sh elsewhere` | needs what the walkthrough lacks: commands of the program are asked for their help, which refuses unknown options |
//! | `toml` | a file, whose name and a colon end the line before: `` `day.toml`: `` |
//! | `toml elsewhere` | a file that the walkthrough does not have |
//! | `text` | no commands |

use crate::support::Workplace;
use std::path::{Path, PathBuf};

/// The pages in the order in which they are followed.
const PAGES: [&str; 9] = [
    "capture.md",
    "dataset.md",
    "train.md",
    "edit.md",
    "bake.md",
    "view.md",
    "numbers.md",
    "cluster.md",
    "reference.md",
];

/// Commands on all pages together; whoever adds one that does not run has to say so here.
const COUNTS: Counts = Counts {
    run: 51,
    asked_for_help: 47,
    not_ours: 6,
};

/// Files of somebody who followed all pages.
const RESULTS: [&str; 22] = [
    "hdr/report.html",
    "room/evening/transforms.json",
    "room/day/masks/table.md",
    "room/evening/Normal-exr/p000.exr",
    "runs/evening/scene.ply",
    "base.toml",
    "b.toml",
    "edits/day.record.json",
    "edits/more.ply",
    "renders/day-path/p000.png",
    "bakes/day.ply",
    "bakes/dimmer.ply",
    "evening.html",
    "day-3dgs.ply",
    "renders/fly/frame_0005.png",
    "eval/day-path/metrics.json",
    "table/day/table.tex",
    "runs/room/run.json",
    "runs/room/report.html",
    "room.html",
    "kitchen.toml",
    "bakes/views.ply",
];

/// Numbers of commands by what the test did with them.
#[derive(Debug, Default, PartialEq, Eq)]
struct Counts {
    /// They ran.
    run: usize,
    /// They were asked for their help.
    asked_for_help: usize,
    /// Commands of other programs.
    not_ours: usize,
}

/// A fenced block of a page.
#[derive(Debug)]
struct Block {
    /// Line of the page that its first line is, from 1.
    line: usize,
    /// Info string of the opening fence.
    info: String,
    body: Vec<String>,
    /// The last line before it that is not empty.
    lead: String,
}

/// A command and the line of the page it begins on.
#[derive(Debug, PartialEq, Eq)]
struct Shown {
    line: usize,
    text: String,
}

#[test]
fn the_walkthrough_of_the_pages_works() {
    let place = Workplace::empty();
    let mut counts = Counts::default();
    for page in PAGES {
        for block in blocks(page, &read(&format!("docs/{page}"))) {
            follow(&place, page, &block, &mut counts);
        }
    }
    assert_eq!(counts, COUNTS);
    for result in RESULTS {
        assert!(place.path(result).is_file(), "no {result}");
    }
}

#[test]
fn the_commands_of_the_readme_are_known() {
    let place = Workplace::empty();
    let text = read("README.md");
    let indented = text
        .lines()
        .map(|line| line.strip_prefix("    ").unwrap_or_default().to_owned());
    let mut shown = join(1, &indented.collect::<Vec<_>>());
    shown.retain(|command| command.text.starts_with("eagpt "));
    assert_eq!(shown.len(), 11);
    for command in &shown {
        ask_for_help(&place, "README.md", command);
    }
}

#[test]
fn every_page_is_followed_and_every_link_leads_somewhere() {
    let docs = root().join("docs");
    let index = read("docs/README.md");
    for entry in std::fs::read_dir(&docs).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.ends_with(".md") || name == "README.md" {
            continue;
        }
        assert!(PAGES.contains(&name.as_str()), "docs/{name}: not in PAGES");
        assert!(
            index.contains(&format!("]({name})")),
            "docs/README.md: no link to {name}"
        );
    }
    for page in PAGES.into_iter().chain(["README.md"]) {
        let text = read(&format!("docs/{page}"));
        for link in text.split("](").skip(1) {
            let target = link.split([')', '#']).next().unwrap();
            let leads = target.contains("://") || docs.join(target).exists();
            assert!(leads, "docs/{page}: {target} is not there");
        }
    }
}

#[test]
fn pages_are_read_as_they_are_meant() {
    let text = "Save it as\n`a.toml`:\n\n```toml\nx = 1\n```\n\n```sh elsewhere\nls\n```\n```sh\na b \\\n    c\nd\n```\n";
    let found = blocks("p.md", text);
    let infos: Vec<&str> = found.iter().map(|block| block.info.as_str()).collect();
    assert_eq!(infos, ["toml", "sh elsewhere", "sh"]);
    assert_eq!(file_name(&found[0].lead), Some("a.toml"));
    assert_eq!(file_name(&found[1].lead), None);
    let shown = |line, text: &str| Shown {
        line,
        text: text.to_owned(),
    };
    assert_eq!(
        join(found[2].line, &found[2].body),
        [shown(12, "a b c"), shown(14, "d")]
    );
}

/// Does what somebody does who reads a block.
#[track_caller]
fn follow(place: &Workplace, page: &str, block: &Block, counts: &mut Counts) {
    let here = format!("docs/{page}: line {}", block.line);
    match block.info.as_str() {
        "sh" => {
            for command in join(block.line, &block.body) {
                run(place, page, &command);
                counts.run += 1;
            }
        }
        "sh elsewhere" => {
            for command in join(block.line, &block.body) {
                if command.text.starts_with("eagpt ") {
                    ask_for_help(place, &format!("docs/{page}"), &command);
                    counts.asked_for_help += 1;
                } else {
                    counts.not_ours += 1;
                }
            }
        }
        "toml" => {
            let name = file_name(&block.lead);
            let name = name.unwrap_or_else(|| panic!("{here}: nobody says what this file is"));
            place.write(name, block.body.join("\n") + "\n");
        }
        "toml elsewhere" | "text" => {}
        other => panic!("{here}: a fence `{other}` is none that this test knows"),
    }
}

/// Runs a command of the walkthrough, which has to succeed.
#[track_caller]
fn run(place: &Workplace, page: &str, command: &Shown) {
    let Shown { line, text } = command;
    let Some(arguments) = text.strip_prefix("eagpt ") else {
        panic!("docs/{page}: line {line}: not a command of the program: {text}");
    };
    let (arguments, file) = match arguments.split_once(" > ") {
        Some((arguments, file)) => (arguments, Some(file.trim())),
        None => (arguments, None),
    };
    let output = place.run(arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "docs/{page}: line {line}: {text}\n{stderr}"
    );
    if let Some(file) = file {
        place.write(file, &output.stdout);
    }
}

/// Finds out whether a command and its options exist: help at the end is given only if everything
/// before it is right.
#[track_caller]
fn ask_for_help(place: &Workplace, page: &str, command: &Shown) {
    let Shown { line, text } = command;
    // From there on words are the shell's.
    let words = text.split_whitespace().skip(1);
    let own = words.take_while(|word| ![">", "|", "&&", "#"].contains(word));
    let arguments: Vec<&str> = own.chain(["--help"]).collect();
    let output = place.run(&arguments.join(" "));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{page}: line {line}: {text}\n{stderr}"
    );
}

/// The fenced blocks of a page.
fn blocks(page: &str, text: &str) -> Vec<Block> {
    let mut found = Vec::new();
    let mut lead = String::new();
    let mut lines = text.lines().zip(1..);
    while let Some((line, number)) = lines.next() {
        let Some(info) = line.strip_prefix("```") else {
            if !line.trim().is_empty() {
                line.clone_into(&mut lead);
            }
            continue;
        };
        let mut body = Vec::new();
        loop {
            let Some((line, _)) = lines.next() else {
                panic!("docs/{page}: line {number}: this fence is never closed");
            };
            if line.starts_with("```") {
                break;
            }
            body.push(line.to_owned());
        }
        found.push(Block {
            line: number + 1,
            info: info.to_owned(),
            body,
            lead: std::mem::take(&mut lead),
        });
    }
    found
}

/// The commands of lines, of which the first is line `first` of the page; a backslash at the end
/// joins the next line.
fn join(first: usize, lines: &[String]) -> Vec<Shown> {
    let mut shown: Vec<Shown> = Vec::new();
    let mut is_open = false;
    for (text, line) in lines.iter().zip(first..) {
        let part = text.trim_end_matches('\\').trim();
        match shown.last_mut() {
            Some(command) if is_open => {
                command.text.push(' ');
                command.text.push_str(part);
            }
            _ if part.is_empty() => {}
            _ => shown.push(Shown {
                line,
                text: part.to_owned(),
            }),
        }
        is_open = text.ends_with('\\');
    }
    shown
}

/// The file that a line like ``Save it as `day.toml`:`` announces.
fn file_name(lead: &str) -> Option<&str> {
    let (_, name) = lead.strip_suffix("`:")?.rsplit_once('`')?;
    Some(name)
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// A file of the repository.
fn read(relative: &str) -> String {
    let path = root().join(relative);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
