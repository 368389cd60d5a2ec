//! The content of `ARCHITECTURE.md` about the crates: its tables and its picture.

use std::collections::{BTreeMap, BTreeSet};

/// Names of crates or libraries, by name.
pub(crate) type Names = BTreeMap<String, BTreeSet<String>>;

/// The first table that has this first heading: the names in its second column by those in its first.
///
/// Names stand in backticks; other words are only for people.
///
/// # Errors
/// There is no such table, or a name stands in two rows.
pub(crate) fn table(page: &str, heading: &str) -> Result<Names, String> {
    let mut rows = page
        .lines()
        .skip_while(|line| cells(line).first() != Some(&heading))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .peekable();
    rows.peek().ok_or_else(|| format!("no table with the heading {heading:?}"))?;
    let mut names = Names::new();
    for row in rows {
        let cells = cells(row);
        let second: BTreeSet<String> = quoted(cells.get(1).copied().unwrap_or("")).map(str::to_owned).collect();
        for name in quoted(cells.first().copied().unwrap_or("")) {
            if names.insert(name.to_owned(), second.clone()).is_some() {
                return Err(format!("{name} stands in two rows"));
            }
        }
    }
    Ok(names)
}

/// The words of the picture, line by line: it is the first block of text on the page.
#[must_use]
pub(crate) fn picture(page: &str) -> Vec<Vec<String>> {
    page.lines()
        .skip_while(|line| *line != "```text")
        .skip(1)
        .take_while(|line| *line != "```")
        .map(|line| line.split_whitespace().map(str::to_owned).collect())
        .collect()
}

fn cells(line: &str) -> Vec<&str> {
    line.trim().trim_matches('|').split('|').map(str::trim).collect()
}

fn quoted(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}
