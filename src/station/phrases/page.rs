//! The table as a page of the manual.

use std::fmt::Write as _;

use super::form::Form;
use super::table::all;

const HEAD: &str = "# What the station says

Each sentence with its id, in English, Chinese and Russian. Records, logs and programs get the English one; the screen shows the one of its
language, and the command line that of the locale. An id never names another sentence, so it can be searched for and told over the telephone. The program prints this page from its own
table: `cargo run -q -p gnc-station --example messages > docs/messages.md`. `{name}` stands for a value.

The texts of the screen itself, such as the names of its panels and keys, and the titles and advice of the items ([items.md](items.md)) are not
among them.
";

/// The page of the manual that lists all sentences.
#[must_use]
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    let mut part = "";
    for sentence in all() {
        if sentence.id.0 != part {
            part = sentence.id.0;
            // Writing to a String cannot fail.
            let _ = write!(page, "\n## {part}\n\n");
        }
        let english = Form::read(sentence.en).map(|form| form.fill(|name| Some(format!("{{{name}}}").into())));
        let english = english.as_deref().unwrap_or(sentence.en);
        let lines = [english, sentence.zh, sentence.ru].map(|text| text.replace('\n', " ").replace('|', "\\|"));
        let _ = writeln!(page, "- `{part}.{}`\\\n  {}", sentence.id.1, lines.join("\\\n  "));
    }
    page
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_manual_has_the_page() {
        let stored = include_str!("../../../docs/messages.md");
        assert!(stored == super::page(), "run: cargo run -q -p gnc-station --example messages > docs/messages.md");
    }
}
