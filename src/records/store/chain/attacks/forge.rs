//! Makes a chain anew without the station's code: lines are words, and links are computed here.

use std::collections::BTreeMap;
use std::fs;

use sha2::{Digest as _, Sha256};

use super::shelf::Shelf;

/// The word for begin or close.
pub(super) const CLOSE: usize = 4;
const RUN: usize = 7;
const DIGEST: usize = 2;

pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// All lines of a chain by their numbers, as words.
pub(super) struct Forge(Vec<Vec<String>>);

impl Forge {
    pub(super) fn read(shelf: &Shelf) -> Self {
        let mut lines = Vec::new();
        for day in fs::read_dir(shelf.path()).unwrap() {
            let text = fs::read_to_string(day.unwrap().path().join("CHAIN")).unwrap_or_default();
            lines.extend(text.lines().map(|line| line.split(' ').map(str::to_owned).collect::<Vec<_>>()));
        }
        lines.sort_by_key(|words| words[0].parse::<u64>().unwrap());
        Self(lines)
    }

    /// Number and link of the last line.
    pub(super) fn last(&self) -> String {
        let words = self.0.last().unwrap();
        format!("{} {}", words[0], words[3])
    }

    pub(super) fn keeping(mut self, keep: impl Fn(&[String]) -> bool) -> Self {
        self.0.retain(|words| keep(words));
        self
    }

    /// Without the lines of runs whose names begin so.
    pub(super) fn without(self, run: &str) -> Self {
        self.keeping(|words| !words[RUN].starts_with(run))
    }

    pub(super) fn renamed(mut self, from: &str, to: &str) -> Self {
        for words in &mut self.0 {
            words[RUN] = words[RUN].replacen(from, to, 1);
        }
        self
    }

    /// The lines of a run once more behind all others, under another name.
    pub(super) fn again(mut self, run: &str, name: &str) -> Self {
        let lines: Vec<Vec<String>> = self.0.iter().filter(|words| words[RUN] == run).cloned().collect();
        self.0.extend(lines.into_iter().map(|mut words| {
            words[RUN] = name.to_owned();
            words
        }));
        self
    }

    /// The run was moved since it began.
    pub(super) fn moved(mut self, run: &str, to: &str) -> Self {
        let close = self.0.iter_mut().find(|words| words[CLOSE] == "close" && words[RUN] == run).unwrap();
        close[RUN] = to.to_owned();
        close.splice(RUN + 1..RUN + 1, ["from".to_owned(), run.to_owned()]);
        self
    }

    /// The digests of the folders as they are now.
    pub(super) fn redigest(mut self, shelf: &Shelf) -> Self {
        for words in &mut self.0 {
            let run = shelf.path().join(&words[RUN]);
            words[DIGEST] = match words[CLOSE].as_str() {
                "close" => sha256(&fs::read(run.join("SHA256SUMS")).unwrap()),
                _ => {
                    let journal = fs::read(run.join("events.jsonl")).unwrap();
                    let end = journal.iter().position(|byte| *byte == b'\n').unwrap();
                    sha256(&journal[..=end])
                }
            };
        }
        self
    }

    pub(super) fn unsigned(mut self) -> Self {
        for words in &mut self.0 {
            let sig = words.iter().position(|word| word == "sig").unwrap();
            words.truncate(sig);
        }
        self
    }

    /// Without the signatures of the lines that are wanted.
    pub(super) fn unsigned_where(mut self, is_wanted: impl Fn(&[String]) -> bool) -> Self {
        for words in self.0.iter_mut().filter(|words| is_wanted(words)) {
            let sig = words.iter().position(|word| word == "sig").unwrap();
            words.truncate(sig);
        }
        self
    }

    /// The line of a close once more, as that of a run that began under another name.
    pub(super) fn closed_again_from(mut self, run: &str, from: &str) -> Self {
        let mut close = self.0.iter().find(|words| words[CLOSE] == "close" && words[RUN] == run).unwrap().clone();
        close.splice(RUN + 1..RUN + 1, ["from".to_owned(), from.to_owned()]);
        self.0.push(close);
        self
    }

    /// Numbers and links made anew, and the counter; old signatures stay beside new links.
    pub(super) fn write(mut self, shelf: &Shelf) {
        let before = self.link(self.0.len());
        fs::write(shelf.path().join("COUNTER"), format!("{} {before}\n", self.0.len())).unwrap();
        self.write_as_they_are(shelf);
    }

    /// Links of so many first lines made anew; the others and the counter stay.
    pub(super) fn write_first(mut self, shelf: &Shelf, lines: usize) {
        self.link(lines);
        self.write_as_they_are(shelf);
    }

    /// Numbers and links of so many lines made anew. Returns the last link.
    fn link(&mut self, lines: usize) -> String {
        let mut before = "0".repeat(64);
        for (index, words) in self.0.iter_mut().take(lines).enumerate() {
            words[0] = (index + 1).to_string();
            words[1] = before;
            let end = words.iter().position(|word| word == "sig").unwrap_or(words.len());
            let covered = [&words[..3], &words[4..end]].concat().join(" ");
            words[3] = sha256(covered.as_bytes());
            before = words[3].clone();
        }
        before
    }

    pub(super) fn write_as_they_are(self, shelf: &Shelf) {
        let mut days: BTreeMap<String, String> = BTreeMap::new();
        for words in &self.0 {
            let day = words[RUN].split('/').next().unwrap();
            days.entry(day.to_owned()).or_default().push_str(&format!("{}\n", words.join(" ")));
        }
        for (day, text) in days {
            fs::write(shelf.path().join(day).join("CHAIN"), text).unwrap();
        }
    }
}
