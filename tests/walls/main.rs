//! The walls between the crates and between their modules, as `ARCHITECTURE.md` draws them.
//!
//! Only the page holds the table of dependencies: a change of a dependency is a change of the page.

mod graph;
mod page;
mod paths;
mod sentences;
mod source;
mod workspace;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::LazyLock;

use graph::{cycles, edges};
use source::{Module, modules};
use workspace::{Crate, crates, users};

/// Largest share of all lines that a crate may hold, in percent.
const LARGEST_SHARE_PERCENT: usize = 40;

fn page() -> std::io::Result<String> {
    std::fs::read_to_string(gnc_tests::repository().join("ARCHITECTURE.md"))
}

/// The workspace, read once for all tests.
static WORKSPACE: LazyLock<Result<Vec<Crate>, String>> = LazyLock::new(|| crates(&gnc_tests::repository()));

/// Fails with all mistakes at once.
#[track_caller]
fn none_of(mistakes: &[String]) {
    assert!(mistakes.is_empty(), "\n{}\n", mistakes.join("\n"));
}

#[test]
fn a_crate_is_built_on_what_the_page_says() {
    let allowed = page::table(&page().unwrap(), "crate").unwrap();
    let crates = WORKSPACE.as_ref().unwrap();
    let mut mistakes = Vec::new();
    for one in crates {
        match allowed.get(&one.name) {
            None => mistakes.push(format!("{} is not on the page", one.name)),
            Some(allowed) => {
                let forbidden = one.built_on.difference(allowed);
                mistakes.extend(forbidden.map(|other| format!("{} may not be built on {other}", one.name)));
                let gone = allowed.difference(&one.built_on);
                mistakes.extend(gone.map(|other| format!("the page says that {} is built on {other}", one.name)));
            }
        }
    }
    let names: BTreeSet<&String> = crates.iter().map(|one| &one.name).collect();
    mistakes.extend(allowed.keys().filter(|name| !names.contains(name)).map(|name| format!("there is no {name}")));
    none_of(&mistakes);
}

#[test]
fn what_a_manifest_names_is_used() {
    let crates = WORKSPACE.as_ref().unwrap();
    let mut mistakes = Vec::new();
    for other in crates {
        let users = users(crates, &other.in_code());
        let idle = crates.iter().filter(|one| one.built_on.contains(&other.name) && !users.contains_key(&*one.name));
        mistakes.extend(idle.map(|one| format!("no code of {} uses {}", one.name, other.name)));
    }
    none_of(&mistakes);
}

#[test]
fn a_crate_stands_in_the_picture_above_what_it_is_built_on() {
    let picture = page::picture(&page().unwrap());
    let crates = WORKSPACE.as_ref().unwrap();
    let row = |name: &str| {
        let rows: Vec<usize> = (0..picture.len()).filter(|row| picture[*row].iter().any(|word| word == name)).collect();
        if let [row] = rows[..] { Ok(row) } else { Err(format!("{name} stands {} times in the picture", rows.len())) }
    };
    let mut mistakes = Vec::new();
    for one in crates {
        for other in &one.built_on {
            match (row(&one.name), row(other)) {
                (Ok(above), Ok(below)) if above < below => {}
                (Ok(_), Ok(_)) => mistakes.push(format!("{} is built on {other}, which is not below it", one.name)),
                (Err(mistake), _) | (_, Err(mistake)) => mistakes.push(mistake),
            }
        }
    }
    none_of(&mistakes);
}

#[test]
fn a_library_is_used_only_where_the_page_says() {
    let allowed = page::table(&page().unwrap(), "library").unwrap();
    let crates = WORKSPACE.as_ref().unwrap();
    let mut mistakes = Vec::new();
    for (what, allowed) in &allowed {
        let users = users(crates, what);
        let forbidden = users.iter().filter(|(name, _)| !allowed.contains(**name));
        mistakes.extend(forbidden.map(|(name, place)| format!("{name} may not use {what} ({place})")));
        let gone = allowed.iter().filter(|name| !users.contains_key(name.as_str()));
        mistakes.extend(gone.map(|name| format!("the page says that {name} uses {what}")));
    }
    none_of(&mistakes);
}

/// Calls that open what others may have exchanged for a pipe, a device or a link, by the ends of their paths.
const UNGUARDED: [[&str; 2]; 7] = [
    ["fs", "read"],
    ["fs", "read_to_string"],
    ["fs", "write"],
    ["fs", "copy"],
    ["File", "open"],
    ["File", "create"],
    ["OpenOptions", "new"],
];

/// The calls without a guard that a module names.
fn unguarded(module: &Module) -> Vec<String> {
    let is_one = |path: &[String]| UNGUARDED.iter().any(|end| path.ends_with(&end.map(str::to_owned)));
    let named = module.named.iter().filter(|named| named.path.len() > 1 && is_one(&named.path));
    named.map(|named| format!("{}:{}: {}", module.file.display(), named.line, named.path.join("::"))).collect()
}

/// Files are opened by `gnc-files`. The files of code that opens some by itself stand in `unguarded.toml`, each with the reason.
#[test]
fn files_of_others_are_read_with_guards() {
    let allowed = std::fs::read_to_string(gnc_tests::repository().join("tests/walls/unguarded.toml")).unwrap();
    let allowed: toml::Table = allowed.parse().unwrap();
    let modules = || WORKSPACE.as_ref().unwrap().iter().flat_map(|one| &one.modules);
    let file = |module: &Module| module.file.to_string_lossy().into_owned();
    let found = modules().filter(|module| !allowed.contains_key(&file(module))).flat_map(unguarded);
    none_of(&found.map(|call| format!("{call}: use gnc_files, or say in unguarded.toml why not")).collect::<Vec<_>>());
    let needed: BTreeSet<String> = modules().filter(|module| !unguarded(module).is_empty()).map(file).collect();
    let idle = allowed.keys().filter(|file| !needed.contains(*file));
    none_of(&idle.map(|file| format!("{file} opens nothing without a guard")).collect::<Vec<_>>());
}

#[test]
fn a_read_without_a_guard_is_found_however_it_is_written() {
    for (text, is_one) in [
        ("fn f() { std::fs::read(path); }", true),
        ("use std::fs; fn f() { fs::read_to_string(path); }", true),
        ("use std::fs::{read as take}; fn f() { take(path); }", true),
        ("use std::fs::File; fn f() { File::open(path).map(|file| file); }", true),
        ("fn f() { paths.map(std::fs::File::create); }", true),
        ("use std::fs::OpenOptions; fn f() { OpenOptions::new().append(true).open(path); }", true),
        ("fn f() { RawFile::create(path); gnc_files::read(path, 9); fs::read_dir(path); }", false),
        ("#[cfg(test)] mod tests { fn f() { std::fs::read(path); } }", false),
    ] {
        let found = made_up(&[("lib.rs", text)]).unwrap().iter().flat_map(unguarded).count();
        assert_eq!(found > 0, is_one, "{text}");
    }
}

#[test]
fn modules_do_not_depend_on_each_other_in_a_circle() {
    let found = WORKSPACE.as_ref().unwrap().iter().flat_map(|one| cycles(&edges(&one.modules))).collect::<Vec<_>>();
    none_of(&found);
}

#[test]
fn no_crate_is_too_large_a_part() {
    let crates = WORKSPACE.as_ref().unwrap();
    let all: usize = crates.iter().map(|one| one.lines).sum();
    let large = crates.iter().filter(|one| one.lines * 100 > all * LARGEST_SHARE_PERCENT);
    none_of(&large.map(|one| format!("{} has {} of {all} lines", one.name, one.lines)).collect::<Vec<_>>());
}

/// The modules of a crate with these files.
fn made_up(files: &[(&str, &str)]) -> Result<Vec<Module>, String> {
    let load =
        |wanted: &Path| files.iter().find(|(file, _)| Path::new(file) == wanted).map(|(_, text)| (*text).to_owned());
    modules(Path::new("lib.rs"), &load)
}

#[test]
fn a_circle_is_found_however_it_is_written() {
    let by = [
        "use crate::a::A;",
        "use crate::{a, b as other};",
        "use super::a;",
        "use super::{self as root, a::{A}};",
        "fn f() { println!(\"{}\", crate::a::f()); }",
        "mod inner { fn f() -> super::super::a::A { todo!() } }",
        // Through names that the root passes on, and through the root's own names.
        "use crate::PassedOn;",
        "fn f() { crate::renamed() }",
        "use crate::Own;",
    ];
    for text in by {
        let root = "mod a; mod b; pub use a::{PassedOn, f as renamed}; pub struct Own(a::A);";
        let modules = made_up(&[("lib.rs", root), ("a.rs", "pub fn f() { crate::b::g(); }"), ("b.rs", text)]).unwrap();
        let found = cycles(&edges(&modules));
        assert_eq!(found.len(), 1, "{text}: {found:?}");
        assert!(found[0].contains("a.rs:1: crate::b::g"), "{text}: {found:?}");
    }
}

#[test]
fn what_is_no_circle_is_not_called_one() {
    let by = [
        "#[cfg(test)] mod tests { use crate::a::A; } fn f() {}",
        "#[cfg(test)] use crate::a::A; fn f() {}",
        "//! See [`crate::a`].\nfn f() { let text = \"crate::a\"; }",
        "pub(in crate::a) fn f() {}",
        "use crate::b::inner; mod inner { use super::f; } fn f() { a::f(); std::a::f(); }",
        "use a::A;",
    ];
    for text in by {
        let modules = made_up(&[
            ("lib.rs", "mod a; mod b; pub use a::f;"),
            ("a.rs", "pub fn f() { crate::b::g(); }"),
            ("b.rs", text),
        ])
        .unwrap();
        assert_eq!(cycles(&edges(&modules)), Vec::<String>::new(), "{text}");
    }
}

#[test]
fn modules_are_found_in_files_and_in_place() {
    let modules = made_up(&[
        ("lib.rs", "mod a; mod b { mod c; }"),
        ("a.rs", "mod d;"),
        ("a/d/mod.rs", "mod e;"),
        ("a/d/e.rs", "use super::super::super::b;"),
        ("b/c.rs", "use std::{fs::{self, File}, io as io_of};"),
    ])
    .unwrap();
    let found: Vec<String> = modules.iter().map(|module| module.path.join("::")).collect();
    assert_eq!(found, ["a::d::e", "a::d", "a", "b::c", "b", ""]);
    let named: Vec<String> = modules[3].named.iter().map(|named| named.path.join("::")).collect();
    assert_eq!(named, ["std::fs", "std::fs::File", "std::io"]);
    assert_eq!(edges(&modules)["a"].keys().collect::<Vec<_>>(), ["b"]);
}
