//! What the station says, held against the table of its sentences in other languages.
//!
//! Each text of the code that looks like a sentence is a sentence of the table, or stands in `english.toml` with the
//! reason why it needs no other language.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;

use crate::{WORKSPACE, none_of};

/// The texts that stay English.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct English {
    /// Files and folders whose texts stay English, each with the reason.
    files: BTreeMap<String, String>,
    /// Single texts, by the reason.
    texts: BTreeMap<String, Vec<String>>,
}

/// The form of a text, whatever names its places have.
fn shape(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        match c {
            '{' if rest.peek() == Some(&'{') => out.extend(rest.next()),
            '}' if rest.peek() == Some(&'}') => out.extend(rest.next()),
            '{' => {
                rest.by_ref().find(|c| *c == '}');
                out.push_str("{}");
            }
            c => out.push(c),
        }
    }
    out
}

/// Whether it holds two words behind each other, both in lower case. The names of places are no words.
fn is_sentence(text: &str) -> bool {
    let words: Vec<bool> = shape(text)
        .split(|c: char| c.is_whitespace())
        .map(|word| word.trim_matches(|c: char| !c.is_alphanumeric()))
        .map(|word| word.len() >= 2 && word.chars().all(|c| c.is_ascii_lowercase()))
        .collect();
    words.windows(2).any(|pair| pair[0] && pair[1])
}

fn table() -> Result<BTreeSet<String>, String> {
    let folder = gnc_tests::repository().join("src/station/phrases");
    let mut forms = BTreeSet::new();
    for file in std::fs::read_dir(&folder).map_err(|error| error.to_string())?.flatten() {
        let path = file.path();
        if path.extension().is_none_or(|end| end != "toml") {
            continue;
        }
        let text = std::fs::read_to_string(&path).map_err(|error| error.to_string())?;
        let table: toml::Table = toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        forms.extend(table.values().filter_map(|row| row.get("en")?.as_str()).map(shape));
    }
    Ok(forms)
}

#[test]
fn each_sentence_of_the_code_is_in_the_table() {
    let table = table().unwrap();
    let english: English = toml::from_str(include_str!("english.toml")).unwrap();
    let mut files: BTreeMap<&String, bool> = english.files.keys().map(|file| (file, false)).collect();
    let mut texts: BTreeMap<&str, bool> = english.texts.values().flatten().map(|text| (text.as_str(), false)).collect();
    let mut mistakes = Vec::new();
    for module in WORKSPACE.as_ref().unwrap().iter().flat_map(|one| &one.modules) {
        let file = module.file.display().to_string();
        if let Some((_, used)) = files.iter_mut().find(|(prefix, _)| file.starts_with(prefix.as_str())) {
            *used = true;
            continue;
        }
        for found in module.texts.iter().filter(|found| is_sentence(&found.text)) {
            if table.contains(&shape(&found.text)) {
                continue;
            }
            match texts.get_mut(found.text.as_str()) {
                Some(used) => *used = true,
                None => mistakes.push(format!("{file}:{}: {:?} is in no table", found.line, found.text)),
            }
        }
    }
    let unused = files.into_iter().map(|(file, used)| (file.as_str(), used)).chain(texts).filter(|(_, used)| !used);
    mistakes.extend(unused.map(|(text, _)| format!("english.toml: {text:?} is in no file any more, or in the table")));
    none_of(&mistakes);
}

#[test]
fn sentences_are_told_from_keys() {
    for text in ["port {} is in use", "no answer", "requires {item}, which {} was skipped"] {
        assert!(is_sentence(text), "{text}");
    }
    for text in ["serial_number", "IMU", "{of_it}: {why}", "{one two} three", "SN 0001", "x", ""] {
        assert!(!is_sentence(text), "{text}");
    }
    assert_eq!(shape("{a} of {b:.1}, {{c}}"), "{} of {}, {c}");
}
