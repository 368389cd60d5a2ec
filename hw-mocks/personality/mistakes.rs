//! All mistakes of a personality at once.
//!
//! serde and the checks stop at the first mistake. What it stands at is taken out of the parsed file then, and the rest is
//! read again, until nothing more is found. A table or list that lacks only what was taken out of it is no mistake of its own,
//! and is not looked at further.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use super::check::Mistake;

/// Mistakes that are told; a file with more is no personality.
const MOST: usize = 50;

/// Reads a text by `read`, which stops at its first mistake.
pub(super) fn all<T>(
    text: &str,
    mut read: impl FnMut(Spanned<DeTable<'_>>) -> Result<T, Mistake>,
) -> Result<T, Vec<Mistake>> {
    // What follows a mistake of syntax is guesswork.
    let mut root = DeTable::parse(text).map_err(|error| vec![Mistake::of(&error)])?;
    let mut mistakes: Vec<Mistake> = Vec::new();
    let mut lacking: Vec<Range<usize>> = Vec::new();
    loop {
        let mistake = match read(root.clone()) {
            Ok(value) if mistakes.is_empty() => return Ok(value),
            Ok(_) => break,
            Err(mistake) => mistake,
        };
        let whole = root.span();
        let taken = take_out(root.get_mut(), &whole, &mistake.span);
        if let Some(moot) = &mistake.moot {
            take_out(root.get_mut(), &whole, moot);
        }
        if !lacking.contains(&mistake.span) {
            mistakes.push(mistake);
        }
        match taken {
            Some(container) if mistakes.len() < MOST => lacking.push(container),
            _ => break,
        }
    }
    mistakes.sort_by_key(|mistake| mistake.span.start);
    Err(mistakes)
}

/// Takes the innermost entry at a place out of a table; gives the place of the table or list that has lost it.
fn take_out(table: &mut DeTable<'_>, span: &Range<usize>, target: &Range<usize>) -> Option<Range<usize>> {
    let exactly = |place: Range<usize>| place == *target;
    let around = |place: Range<usize>| place.start <= target.start && target.end <= place.end;
    of_table(table, span, &exactly).or_else(|| of_table(table, span, &around))
}

type Hits<'a> = &'a dyn Fn(Range<usize>) -> bool;

fn of_table(table: &mut DeTable<'_>, span: &Range<usize>, hits: Hits) -> Option<Range<usize>> {
    if let Some(container) = table.iter_mut().find_map(|(_, value)| of_value(value, hits)) {
        return Some(container);
    }
    let (key, _) = table.iter().find(|(key, value)| hits(key.span()) || hits(value.span()))?;
    let key = key.clone();
    table.remove(&key).map(|_| span.clone())
}

fn of_value(value: &mut Spanned<DeValue<'_>>, hits: Hits) -> Option<Range<usize>> {
    let span = value.span();
    match value.get_mut() {
        DeValue::Table(table) => of_table(table, &span, hits),
        DeValue::Array(list) => {
            if let Some(container) = list.iter_mut().find_map(|element| of_value(element, hits)) {
                return Some(container);
            }
            let place = list.iter().position(|element| hits(element.span()))?;
            let rest = list.iter().enumerate().filter(|(index, _)| *index != place);
            *list = rest.fold(DeArray::new(), |mut kept, (_, element)| {
                kept.push(element.clone());
                kept
            });
            Some(span)
        }
        _ => None,
    }
}
