//! Tells the program which sources it is built from: the commit, its date, and whether files differ from it.
//!
//! Sources without git (a tarball) give empty values, which the program calls unknown. The time of the build is not
//! told, so that the same commit gives the same program.

use std::path::{Path, PathBuf};
use std::process::Command;

/// What the program is built from, by paths from the root of the sources.
const SOURCES: [&str; 4] = ["src", "hw-mocks", "Cargo.toml", "Cargo.lock"];
/// Digits of a commit that `--version` shows: enough for millions of commits, and the same in every clone.
const SHOWN_DIGITS: usize = 12;

fn main() {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let root = here.ancestors().nth(2).unwrap_or(&here);
    let version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    for source in SOURCES {
        println!("cargo:rerun-if-changed={}", root.join(source).display());
    }
    let head = Head::of(root);
    let (commit, committed, modified) = match &head {
        Some(head) => (head.commit.as_str(), head.committed.as_str(), head.modified),
        None => ("", "", false),
    };
    for path in head.as_ref().map(|head| head.moves.as_slice()).unwrap_or_default() {
        println!("cargo:rerun-if-changed={}", path.display());
    }
    let day = committed.get(..10).unwrap_or_default();
    let shown = match (commit.get(..SHOWN_DIGITS), modified) {
        (Some(commit), false) => format!("{version} (commit {commit} of {day})"),
        (Some(commit), true) => format!("{version} (commit {commit} of {day}, and changes that are not committed)"),
        (None, _) => format!("{version} (commit unknown)"),
    };
    println!("cargo:rustc-env=GNC_VERSION={shown}");
    println!("cargo:rustc-env=GNC_COMMIT={commit}");
    println!("cargo:rustc-env=GNC_COMMITTED={committed}");
    println!("cargo:rustc-env=GNC_MODIFIED={}", if modified { "yes" } else { "" });
}

/// The commit that the sources are at.
struct Head {
    /// All digits.
    commit: String,
    /// Date and time with offset, RFC 3339.
    committed: String,
    /// Whether a file of the sources differs from the commit.
    modified: bool,
    /// Files of git that change when another commit is made or checked out.
    moves: Vec<PathBuf>,
}

impl Head {
    /// `None` without git, or if these sources do not belong to the repository in which they lie.
    fn of(root: &Path) -> Option<Self> {
        git(root, &["ls-files", "--error-unmatch", "src/station/build.rs"])?;
        let commit = git(root, &["rev-parse", "--verify", "HEAD^{commit}"])?;
        let committed = git(root, &["show", "--no-patch", "--no-show-signature", "--format=%cI", &commit])?;
        let modified = !git(root, &[&["status", "--porcelain", "--"], &SOURCES[..]].concat())?.is_empty();
        Some(Self { commit, committed, modified, moves: moves(root) })
    }
}

/// Only files that are there: a missing one would make cargo build anew each time.
fn moves(root: &Path) -> Vec<PathBuf> {
    let branch = git(root, &["symbolic-ref", "--quiet", "HEAD"]);
    let named = ["HEAD", "logs/HEAD", "packed-refs"].into_iter().chain(branch.as_deref());
    let paths = named.filter_map(|name| Some(root.join(git(root, &["rev-parse", "--git-path", name])?)));
    paths.filter(|path| path.is_file()).collect()
}

/// What git says, without the line end; `None` if it fails or is not there.
fn git(root: &Path, words: &[&str]) -> Option<String> {
    let mut command = Command::new("git");
    command.current_dir(root);
    // A container may build a folder of another user. What builds it runs its code anyway.
    command.args(["-c", "safe.directory=*", "-c", "core.fsmonitor=false"]).args(words);
    // A look must not write the index, and a hook of git that builds must not point elsewhere.
    command.env("GIT_OPTIONAL_LOCKS", "0");
    for name in ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_PREFIX", "GIT_COMMON_DIR"] {
        command.env_remove(name);
    }
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim_end().to_owned())
}
