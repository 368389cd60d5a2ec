//! The program names the sources that it was built from.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use gnc_tests::{Place, repository};
use tempfile::TempDir;

use super::STATION;

/// What git says in a folder; `None` without git or outside of a repository.
fn git(folder: &Path, words: &[&str]) -> Option<String> {
    let mut command = Command::new("git");
    command.current_dir(folder).args(["-c", "safe.directory=*", "-c", "user.name=a", "-c", "user.email=a@b"]);
    let output = command.args(words).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

/// `--version`, the record, the log and the passport's text name the same commit, which is that of the sources.
#[test]
fn version_and_record_name_the_commit() {
    let place = Place::new(STATION);
    let version = place.run(["--version"]).stdout;
    assert!(version.starts_with("gnc-station 0.1.0 (commit "), "{version}");
    let done = place.functional("--sim", &["--sim-speed", "max", "--only", "cpu"]);
    assert_eq!(done.code, Some(5), "{}", done.stderr);
    let record = place.record();
    let build = &record["program"]["build"];
    let folder = &place.runs()[0];
    let shown = place.run(["records", "show", "T-1"]).stdout;
    match git(&repository(), &["rev-parse", "HEAD"]) {
        Some(commit) => {
            assert_eq!(build["commit"], commit.as_str());
            assert!(version.contains(&commit[..12]), "{version} is not of {commit}");
            let when = git(&repository(), &["show", "-s", "--format=%ct", "HEAD"]).expect("a time");
            let committed =
                chrono::DateTime::parse_from_rfc3339(build["committed"].as_str().expect("a time")).expect("a time");
            assert_eq!(committed.timestamp().to_string(), when);
            for text in [shown, fs::read_to_string(folder.join("report.html")).expect("a report")] {
                assert!(text.contains(&format!("gnc-station 0.1.0 (commit {} of ", &commit[..12])), "{text}");
            }
        }
        None => {
            assert!(build.is_null() && version.contains("(commit unknown)"), "{version}");
            assert!(shown.contains("gnc-station 0.1.0\n"), "{shown}");
        }
    }
}

/// The build script of the station as a program of its own, on sources of its own.
struct Sources {
    folder: TempDir,
    program: PathBuf,
}

impl Sources {
    fn new() -> Self {
        let folder = TempDir::new().expect("a folder");
        let program = folder.path().join("build-script");
        let script = repository().join("src/station/build.rs");
        let rustc = Command::new("rustc").args(["--edition", "2024", "-o"]).arg(&program).arg(script).status();
        assert!(rustc.expect("rustc").success());
        let sources = Self { folder, program };
        for file in ["src/station/build.rs", "hw-mocks/a.rs", "Cargo.toml", "Cargo.lock", "docs/page.md"] {
            sources.write(file, "1");
        }
        sources
    }

    fn root(&self) -> PathBuf {
        self.folder.path().join("sources")
    }

    fn write(&self, file: &str, text: &str) {
        let path = self.root().join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, text).expect("a file");
    }

    fn git(&self, words: &[&str]) -> String {
        git(&self.root(), words).unwrap_or_else(|| panic!("git {words:?}"))
    }

    fn commit(&self) -> String {
        self.git(&["add", "-A"]);
        self.git(&["commit", "-q", "--allow-empty", "-m", "x"]);
        self.git(&["rev-parse", "HEAD"])
    }

    /// What the script says, as cargo starts it; git of a hook must not lead it elsewhere.
    fn said(&self, root: &Path) -> String {
        let mut command = Command::new(&self.program);
        command.env("CARGO_MANIFEST_DIR", root.join("src/station")).env("CARGO_PKG_VERSION", "0.1.0");
        command.env("GIT_DIR", "/nowhere").env("GIT_INDEX_FILE", "/nowhere");
        String::from_utf8(command.output().expect("the script").stdout).expect("UTF-8")
    }

    fn value(&self, name: &str) -> String {
        let said = self.said(&self.root());
        let found = said.lines().find_map(|line| line.strip_prefix(&format!("cargo:rustc-env={name}=")));
        found.unwrap_or_else(|| panic!("no {name} in {said}")).to_owned()
    }

    /// What cargo looks at to know whether to build anew.
    fn watched(&self) -> Vec<(PathBuf, Option<Vec<u8>>)> {
        let said = self.said(&self.root());
        let paths = said.lines().filter_map(|line| line.strip_prefix("cargo:rerun-if-changed=")).map(PathBuf::from);
        paths.map(|path| (path.clone(), fs::read(path).ok())).collect()
    }
}

#[test]
fn sources_without_git_are_unknown() {
    let sources = Sources::new();
    assert_eq!(sources.value("GNC_VERSION"), "0.1.0 (commit unknown)");
    assert_eq!((sources.value("GNC_COMMIT"), sources.value("GNC_COMMITTED")), (String::new(), String::new()));
    // A tarball that was unpacked within a repository of something else.
    let outer = sources.folder.path();
    git(outer, &["init", "-q"]).expect("git");
    git(outer, &["commit", "-q", "--allow-empty", "-m", "x"]).expect("git");
    assert_eq!(sources.value("GNC_VERSION"), "0.1.0 (commit unknown)");
}

#[test]
fn the_commit_and_changes_of_the_sources_are_told() {
    let sources = Sources::new();
    sources.git(&["init", "-q"]);
    let commit = sources.commit();
    let day = sources.git(&["show", "-s", "--format=%cs", "HEAD"]);
    let clean = format!("0.1.0 (commit {} of {day})", &commit[..12]);
    assert_eq!((sources.value("GNC_VERSION"), sources.value("GNC_COMMIT")), (clean.clone(), commit));
    // What the program is not built from does not count.
    sources.write("docs/page.md", "2");
    assert_eq!(sources.value("GNC_VERSION"), clean);
    sources.write("src/new.rs", "2");
    assert!(sources.value("GNC_VERSION").ends_with(", and changes that are not committed)"));
    assert_eq!(sources.value("GNC_MODIFIED"), "yes");
    fs::remove_file(sources.root().join("src/new.rs")).expect("a file");
    sources.write("Cargo.lock", "2");
    assert_eq!(sources.value("GNC_MODIFIED"), "yes");
    // The same sources say the same, whenever they are built.
    assert_eq!(sources.said(&sources.root()), sources.said(&sources.root()));
}

/// Wherever git keeps the name of the commit, cargo sees another commit; and no file is watched that is not there,
/// which would build anew each time.
#[test]
fn another_commit_builds_anew() {
    let sources = Sources::new();
    sources.git(&["init", "-q"]);
    sources.commit();
    let moved = |what: &str, change: &dyn Fn()| {
        let before = sources.watched();
        assert!(before.iter().all(|(path, _)| path.exists()), "{what}: {before:?}");
        let was = sources.value("GNC_COMMIT");
        change();
        let now = |(path, was): &(PathBuf, Option<Vec<u8>>)| fs::read(path).ok() != *was;
        assert!(before.iter().any(now), "{what}: cargo does not see it in {before:?}");
        assert_ne!(sources.value("GNC_COMMIT"), was, "{what}");
    };
    moved("a commit on a branch", &|| drop(sources.commit()));
    sources.git(&["pack-refs", "--all"]);
    moved("a commit on a packed branch", &|| drop(sources.commit()));
    sources.git(&["checkout", "-q", "--detach"]);
    moved("a commit without a branch", &|| drop(sources.commit()));
    moved("an earlier commit", &|| drop(sources.git(&["checkout", "-q", "HEAD~1"])));
    sources.git(&["checkout", "-q", "-b", "quiet"]);
    sources.git(&["config", "core.logAllRefUpdates", "false"]);
    fs::remove_dir_all(sources.root().join(".git/logs")).expect("logs");
    moved("a commit without a log", &|| drop(sources.commit()));
}
