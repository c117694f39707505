//! Shards that share the work on a result, and files of another one.

use super::*;

const TWO: [Shard; 2] = [Shard { index: 1, of: 2 }, Shard { index: 2, of: 2 }];

fn key(options: &str) -> Key {
    Key::new().with("options", digest::of_bytes(options.as_bytes()))
}

fn open(dir: &Path, options: &str, shard: Shard) -> Result<Ledger> {
    let ledger = Ledger::open(dir, "render", &key(options), shard, "--force starts over")?;
    ledger.check_shards()?;
    Ok(ledger)
}

fn part(dir: &Path, shard: Shard, item: &str) -> Ledger {
    let mut ledger = open(dir, "k", shard).unwrap();
    std::fs::write(dir.join(item), item).unwrap();
    ledger.add(item, 1.5, &[item.into()]).unwrap();
    ledger
}

fn refused(dir: &Path, options: &str, shard: Shard) -> String {
    open(dir, options, shard).unwrap_err().to_string()
}

#[test]
fn the_whole_takes_what_parts_have_done() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path();
    part(dir, TWO[0], "a").complete().unwrap();
    let message = refused(dir, "k", Shard::WHOLE);
    assert!(
        message.contains("shard-2-of-2.record.json is missing"),
        "{message}"
    );
    let mut second = part(dir, TWO[1], "b");
    let message = refused(dir, "k", Shard::WHOLE);
    assert!(
        message.contains("shard-2-of-2.record.json is not complete"),
        "{message}"
    );
    second.complete().unwrap();
    let whole = open(dir, "k", Shard::WHOLE).unwrap();
    assert_eq!(whole.done("b").unwrap().seconds, 1.5);
    assert!(whole.done("c").is_none());
    std::fs::write(dir.join("a"), "changed").unwrap();
    assert!(whole.done("a").is_none() && whole.noted("a").is_some());
    whole.close().unwrap();
    assert!(shards(dir).unwrap().is_empty());
}

#[test]
fn items_have_keys_and_values_of_their_own() {
    let root = tempfile::tempdir().unwrap();
    let mut ledger = open(root.path(), "k", Shard::WHOLE).unwrap();
    let value = (1.5, "two".to_owned());
    ledger
        .add_with("a", 0.0, Some(key("a")), &value, &[])
        .unwrap();
    let again = open(root.path(), "k", Shard::WHOLE).unwrap();
    let item = again.done("a").unwrap();
    assert_eq!(item.key, Some(key("a")));
    assert_eq!(item.value(), Some(value));
    assert_eq!(item.value::<[u32; 7]>(), None);
}

#[test]
fn shards_see_each_other_and_the_whole_absorbs_them() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path();
    let mut first = open(dir, "k", TWO[0]).unwrap();
    part(dir, TWO[1], "b");
    assert!(first.noted("b").is_none());
    first.take_others().unwrap();
    assert!(first.done("b").is_some());
    let mut whole = Ledger::open(dir, "render", &key("k"), Shard::WHOLE, "").unwrap();
    whole.absorb_others().unwrap();
    assert_eq!(shards(dir).unwrap(), [Shard::WHOLE]);
    assert!(open(dir, "k", Shard::WHOLE).unwrap().done("b").is_some());
}

#[test]
fn what_a_killed_process_left_of_its_own_files_goes() {
    let dir = tempfile::tempdir().unwrap();
    let [mine, record, others] = ["a.png", "shard-1-of-2.record.json", "b.png"].map(|file| {
        let path = dir.path().join(format!("{file}.0b9d304f.tmp"));
        std::fs::write(&path, b"half").unwrap();
        path
    });
    let ledger = open(dir.path(), "k", TWO[0]).unwrap();
    ledger.clear_temporaries(&["a.png".into()]).unwrap();
    assert!(!mine.exists() && !record.exists());
    assert!(others.exists());
}

#[test]
fn parts_of_something_else_are_refused_and_cleared_by_their_own_command() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path();
    part(dir, TWO[0], "a");
    let message = refused(dir, "other", TWO[0]);
    assert!(
        message.contains("with other options: --force starts over"),
        "{message}"
    );
    let three = Shard { index: 1, of: 3 };
    assert!(refused(dir, "k", three).contains("another division than --shard 1/3"));
    let message = clear(dir, "paper").unwrap_err().to_string();
    assert!(message.contains("`render`"), "{message}");
    clear(dir, "render").unwrap();
    assert!(!dir.join("a").exists() && shards(dir).unwrap().is_empty());
    std::fs::write(dir.join(file_name(TWO[0])), "{").unwrap();
    assert!(refused(dir, "k", TWO[0]).contains("no part of a result"));
}
