//! The pages for people name only existing links, files, programs and options.

mod commands;
mod examples;
mod markdown;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use commands::Programs;
use gnc_tests::repository;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// A page about the past: it uses the file names of that time.
const HISTORY: &str = "CHANGELOG.md";

/// A page: its path from the repository's root, and its text.
type Page = (PathBuf, String);

/// All pages: those of the root and those of `docs`.
fn pages() -> io::Result<Vec<Page>> {
    let mut pages = Vec::new();
    for folder in ["", "docs"].map(Path::new) {
        for entry in fs::read_dir(repository().join(folder))? {
            let path = folder.join(entry?.file_name());
            if path.extension().is_some_and(|extension| extension == "md") {
                let text = fs::read_to_string(repository().join(&path))?;
                pages.push((path, text));
            }
        }
    }
    pages.sort();
    Ok(pages)
}

/// Fails with all mistakes at once.
#[track_caller]
fn none_of(mistakes: &[String]) {
    assert!(mistakes.is_empty(), "\n{}\n", mistakes.join("\n"));
}

/// The mistakes in the code of all pages, each with its place.
fn mistakes_in_code(pages: &[Page], look: impl Fn(&str) -> Vec<String>) -> Vec<String> {
    let mut mistakes = Vec::new();
    for (path, text) in pages {
        for (line, code) in markdown::code(text) {
            mistakes.extend(look(code).into_iter().map(|mistake| format!("{}:{line}: {mistake}", path.display())));
        }
    }
    mistakes
}

#[test]
fn every_link_leads_somewhere() {
    let pages = pages().unwrap();
    assert!(pages.len() > 8, "where are the pages?");
    let mut mistakes = Vec::new();
    for (path, text) in &pages {
        for (line, link) in markdown::links(text) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            let known = if anchor.is_empty() {
                repository().join(&target).exists()
            } else {
                fs::read_to_string(repository().join(&target))
                    .is_ok_and(|text| markdown::anchors(&text).contains(anchor))
            };
            if !known {
                mistakes.push(format!("{}:{line}: {link} leads nowhere", path.display()));
            }
        }
    }
    none_of(&mistakes);
}

#[test]
fn every_path_is_there() {
    let mut pages = pages().unwrap();
    pages.retain(|(path, _)| path != Path::new(HISTORY));
    let root = repository();
    let folders: Vec<String> = ["src", "tests", "docs", "hw-mocks", "test-plans", "fuzz", "findings", ".ci"]
        .into_iter()
        .map(|folder| format!("{folder}/"))
        .collect();
    none_of(&mistakes_in_code(&pages, |code| {
        let words = code.split_whitespace().map(|word| word.trim_matches(|mark: char| "\"'()[],;:".contains(mark)));
        let named = words.filter(|word| folders.iter().any(|folder| word.starts_with(folder)));
        // A word with NAME stands for any name, a star for many.
        let certain = named.filter(|word| !word.contains("NAME") && !word.contains('*'));
        certain.filter(|word| !root.join(word).exists()).map(|word| format!("{word} is not there")).collect()
    }));
}

#[test]
fn every_command_can_be_given() {
    let programs = Programs::of(&repository(), Path::new(STATION)).unwrap();
    none_of(&mistakes_in_code(&pages().unwrap(), |code| programs.mistakes(code)));
}

/// A reader copies them: the program takes each example of a plan and of a bench file.
#[test]
fn every_example_is_taken() {
    let mut mistakes = Vec::new();
    let mut seen = [0; 2];
    for (path, text) in pages().unwrap() {
        for (line, example) in markdown::blocks(&text, "toml") {
            seen[usize::from(examples::is_bench(&example))] += 1;
            let refused = examples::refusal(Path::new(STATION), &example).unwrap();
            mistakes.extend(refused.map(|why| format!("{}:{line}: the example is refused: {why}", path.display())));
        }
    }
    assert!(seen.iter().all(|count| *count > 2), "where are the examples? {seen:?}");
    none_of(&mistakes);
}

#[test]
fn wrong_examples_are_noticed() {
    for wrong in
        ["[shift]\nserial_number = \"SN\"\n", "[resume]\nwiat = \"1 h\"\n", "[[item]]\nid = \"imu\"\ntries = 2\n"]
    {
        assert!(examples::refusal(Path::new(STATION), wrong).unwrap().is_some(), "{wrong}");
    }
}

#[test]
fn wrong_commands_are_noticed() {
    let programs = Programs::of(&repository(), Path::new(STATION)).unwrap();
    let check = |command: &str, expected: &[&str]| assert_eq!(programs.mistakes(command), expected, "{command}");
    check("gnc-station records verify --key station.key.pub", &[]);
    check("gnc-station records verify --seed 1", &["`gnc-station records verify` has no --seed"]);
    check("gnc-station look", &["there is no `gnc-station look`"]);
    check("cargo run --release -- --sim=good --loud", &["`gnc-station` has no --loud"]);
    check("allan FILE --column NAME [--rates HZ]", &["`gnc-station compute allan` has no --rates"]);
    check("cargo test -p gnc-tests --test walls", &[]);
    check("cargo test -p gnc-tests --test doors", &["gnc-tests has no test doors"]);
    check("cargo bench -p gnc-walls --bench speed", &["there is no package gnc-walls"]);
}
