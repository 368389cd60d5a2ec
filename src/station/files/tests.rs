use std::fs::File;

use super::*;
use tempfile::TempDir;

const PLAN: &str = "name = \"by-hand\"\nversion = \"1\"\n[[item]]\nid = \"prompt\"\nname = \"by-hand\"\n[[item.ask]]\n\
                    name = \"lid\"\nen = \"Close the lid.\"\nkind = \"done\"\npicture = \"lid.png\"\n";

fn folder() -> (TempDir, PathBuf, PathBuf) {
    let folder = TempDir::new().expect("a folder");
    let [path, lid] = ["p.toml", "lid.png"].map(|name| folder.path().join(name));
    std::fs::write(&path, PLAN).expect("a plan");
    (folder, path, lid)
}

fn refused(path: &Path) -> String {
    plan(path, Reach::Folder).map(drop).map_err(|refusal| refusal.what).expect_err("a mistake")
}

/// The question has the digest of its picture (of `abc`, from FIPS 180-4). A picture that is another one at the start, or
/// that is gone, is told.
#[test]
fn a_picture_is_held_by_its_digest() {
    let (_folder, path, lid) = folder();
    std::fs::write(&lid, "abc").expect("a picture");
    let held = plan(&path, Reach::Folder).unwrap_or_else(|refusal| panic!("{}", refusal.what));
    let question = &held.plan().items()[0].questions[0];
    let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    assert_eq!(question.picture_sha256.as_deref(), Some(expected));
    assert_eq!(changed_plan(&path, &held), []);
    let name = lid.display().to_string();
    std::fs::write(&lid, "abd").expect("another picture");
    assert_eq!(changed_plan(&path, &held), [ChangedFile { name: name.clone(), unreadable: None }]);
    std::fs::remove_file(&lid).expect("no picture");
    let unreadable = Some("entity not found".to_owned());
    assert_eq!(changed_plan(&path, &held), [ChangedFile { name, unreadable }]);
}

/// A plan is refused if its picture cannot be shown; a pipe or a device in its place blocks nothing.
#[test]
fn a_picture_that_cannot_be_shown_refuses_the_plan() {
    let (folder, path, lid) = folder();
    let missing = "and there is no such file";
    assert!(refused(&path).contains(missing), "{}", refused(&path));
    std::fs::create_dir(&lid).expect("a folder");
    assert!(refused(&path).contains("which cannot be read: it is a folder, not a file"), "{}", refused(&path));
    std::fs::remove_dir(&lid).expect("no folder");
    let pipe = folder.path().join("pipe");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    for target in [pipe.as_path(), Path::new("/dev/zero"), Path::new("lid.png")] {
        std::os::unix::fs::symlink(target, &lid).expect("a link");
        let told = refused(&path);
        let expected = match target.to_str() {
            Some("lid.png") => "which cannot be read: it is a link that leads in a circle",
            Some("/dev/zero") => "which lies outside of the plan's folder",
            _ => "which cannot be read: it is a pipe, not a file",
        };
        assert!(told.contains(expected), "{told}");
        let anywhere = plan(&path, Reach::Anywhere).map(drop).map_err(|refusal| refusal.what).expect_err("a mistake");
        let expected = if target == Path::new("/dev/zero") {
            "which cannot be read: it is a device, not a file"
        } else {
            expected
        };
        assert!(anywhere.contains(expected), "{anywhere}");
        std::fs::remove_file(&lid).expect("no link");
    }
    File::create(&lid).and_then(|file| file.set_len(16 << 20)).expect("a large file");
    assert_eq!(plan(&path, Reach::Folder).map(drop).map_err(|refusal| refusal.what), Ok(()));
    File::create(&lid).and_then(|file| file.set_len((16 << 20) + 1)).expect("a larger file");
    assert!(refused(&path).contains("which has more than 16 MiB"), "{}", refused(&path));
    // Who judges again needs no picture.
    std::fs::remove_file(&lid).expect("no picture");
    assert!(plan_to_judge(&path, Reach::Folder).is_ok());
}
