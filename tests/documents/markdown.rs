//! The part of Markdown that the project's pages use: links, headings and code.

use std::collections::BTreeSet;

/// An element of a page, with its line from 1.
pub(crate) type Placed<'a> = (usize, &'a str);

/// Targets of all links, `file#anchor`, except links to other hosts.
#[must_use]
pub(crate) fn links(page: &str) -> Vec<Placed<'_>> {
    let mut found = Vec::new();
    for (line, text) in prose(page) {
        let targets = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        found.extend(targets.filter(|target| !target.contains("://")).map(|target| (line, target)));
    }
    found
}

/// The anchors of a page: its headings, named as on the web pages of repositories.
#[must_use]
pub(crate) fn anchors(page: &str) -> BTreeSet<String> {
    let headings = prose(page).filter(|(_, text)| text.starts_with('#'));
    headings.map(|(_, text)| anchor(text.trim_start_matches('#').trim())).collect()
}

fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|mark| mark.is_alphanumeric() || " -_".contains(*mark));
    kept.flat_map(char::to_lowercase).map(|mark| if mark == ' ' { '-' } else { mark }).collect()
}

/// Code: spans between backticks, indented lines, and lines of fenced blocks that name no language.
#[must_use]
pub(crate) fn code(page: &str) -> Vec<Placed<'_>> {
    let mut found = Vec::new();
    for (line, text, fence) in lines(page) {
        match fence {
            Some("") => found.push((line, text.trim())),
            Some(_) => {}
            None if text.starts_with("    ") => found.push((line, text.trim())),
            None => found.extend(text.split('`').skip(1).step_by(2).map(|span| (line, span))),
        }
    }
    found
}

/// The fenced blocks of a language: the line of each block's first line, and its text.
#[must_use]
pub(crate) fn blocks(page: &str, language: &str) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut last = 0;
    for (line, text, _) in lines(page).filter(|(.., fence)| *fence == Some(language)) {
        match found.last_mut() {
            Some((_, block)) if last + 1 == line => *block += &format!("{text}\n"),
            _ => found.push((line, format!("{text}\n"))),
        }
        last = line;
    }
    found
}

/// Lines outside of fenced blocks.
fn prose(page: &str) -> impl Iterator<Item = Placed<'_>> {
    lines(page).filter_map(|(line, text, fence)| fence.is_none().then_some((line, text)))
}

/// Every line with the language of the fenced block that it stands in. The fences themselves are left out.
fn lines(page: &str) -> impl Iterator<Item = (usize, &str, Option<&str>)> {
    let mut fence = None;
    page.lines().enumerate().filter_map(move |(index, text)| match text.trim_start().strip_prefix("```") {
        Some(language) => {
            fence = if fence.is_some() { None } else { Some(language.trim()) };
            None
        }
        None => Some((index + 1, text, fence)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "\
# A page: its (first) `part`

See [one](a.md#b) and [two
words](../c.toml), not [three](https://example.org/d.md).

    gnc-station ports

```
cargo run
```
```toml
port = \"src/no.rs\"   # [no](link.md)
```
The file `src/yes.rs` and `--flag`.
";

    #[test]
    fn links_are_found_outside_of_blocks() {
        assert_eq!(links(PAGE), [(3, "a.md#b"), (4, "../c.toml")]);
    }

    #[test]
    fn blocks_are_found_by_their_language() {
        let page = format!("{PAGE}```toml\na = 1\n\n[b]\n```\n");
        let port = "port = \"src/no.rs\"   # [no](link.md)\n".to_owned();
        assert_eq!(blocks(&page, "toml"), [(12, port), (16, "a = 1\n\n[b]\n".to_owned())]);
    }

    #[test]
    fn headings_become_anchors() {
        assert_eq!(anchors(PAGE).into_iter().collect::<Vec<_>>(), ["a-page-its-first-part"]);
    }

    #[test]
    fn code_is_found_where_it_may_be_a_command() {
        let expected = [(1, "part"), (6, "gnc-station ports"), (9, "cargo run"), (14, "src/yes.rs"), (14, "--flag")];
        assert_eq!(code(PAGE), expected);
    }
}
