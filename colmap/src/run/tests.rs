use super::*;
use std::fs;

#[test]
fn images_are_listed_and_exr_is_explained() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("b")).unwrap();
    for name in ["z.JPG", "b/a.png", "notes.txt"] {
        fs::write(dir.path().join(name), "").unwrap();
    }
    assert_eq!(list_images(dir.path()).unwrap(), ["b/a.png", "z.JPG"]);
    let linear = tempfile::tempdir().unwrap();
    fs::write(linear.path().join("a.exr"), "").unwrap();
    let message = list_images(linear.path()).unwrap_err().to_string();
    assert!(message.contains("1 EXR images"), "{message}");
}

#[test]
fn a_missing_program_says_how_to_install_it() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.png"), "").unwrap();
    let options = RunOptions {
        program: PathBuf::from("/nonexistent/colmap"),
        ..RunOptions::default()
    };
    let outcome = run(dir.path(), dir.path(), &options, &mut |_| ());
    let message = outcome.unwrap_err().to_string();
    assert!(message.contains("apt-get install colmap"), "{message}");
    let options = RunOptions {
        camera_model: "LENS".to_owned(),
        ..RunOptions::default()
    };
    assert!(options.validate().is_err());
}
