//! The `[[item.ask]]` of a plan, and the limits of the answers.

use std::borrow::Cow;
use std::sync::Arc;

use gnc_config::{Span, TomlEntry, TomlTable, Walk, did_you_mean};
use gnc_text::quoted;

use super::super::limits::{Limited, limit_of};
use super::super::{ItemLimit, closure};
use super::{DONE, Question, QuestionKind, QuestionWords};
use crate::limit::{Expected, Limit, MeasurementKind};
use crate::quantity::Unit;
use crate::serial_number::SerialNumberPattern;

/// Most questions of an item: nobody answers more without a pause.
const MAX_QUESTIONS: usize = 50;
/// Most characters of a question: it must fit on a screen.
const WORDS_CHARACTERS: usize = 500;
/// Most characters of a name.
const NAME_CHARACTERS: usize = 64;
/// Most choices: each has a line on the screen.
const MAX_CHOICES: usize = 12;
/// Most characters of a choice.
const CHOICE_CHARACTERS: usize = 40;
/// The kinds.
const KINDS: [&str; 4] = ["text", "number", "choice", DONE];

/// A question as read, with what its own keys say of good answers.
pub(in super::super) struct Asked {
    pub(in super::super) question: Arc<Question>,
    pub(in super::super) name_span: Span,
    good: Option<Limit>,
}

/// Reads the questions of an item. `plan` is the name of the plan's file: pictures stand beside it.
pub(in super::super) fn questions(
    walk: &Walk<'_>,
    table: &TomlTable<'_, '_>,
    (plan, item): (&str, &Span),
) -> Vec<Asked> {
    let tables = table.tables("ask");
    if tables.is_empty() && !table.has("ask") {
        let hint = "write them below lines [[item.ask]], each with name, en and kind";
        walk.mistake(item.clone(), "the item asks nothing", hint);
    }
    if tables.len() > MAX_QUESTIONS {
        let what = format!("the item has {} questions, and at most {MAX_QUESTIONS} are asked", tables.len());
        walk.mistake(item.clone(), what, "make two items of it");
    }
    tables.into_iter().take(MAX_QUESTIONS).filter_map(|table| one(walk, table, plan)).collect()
}

/// Reads the limits of the answers, in the order of the questions. `None` if some were refused.
pub(in super::super) fn limits(
    walk: &Walk<'_>,
    table: Option<&TomlTable<'_, '_>>,
    asked: &[Asked],
) -> Option<Vec<ItemLimit>> {
    let (written, refused) = written(walk, table, asked);
    let chosen = asked.iter().zip(written).map(|(asked, limit)| limit.or_else(|| asked.good.clone()));
    named(asked, chosen, refused)
}

/// Reads the limits that a part has for the answers: only those that its table writes. `None` if some were refused.
pub(in super::super) fn limits_of_part(
    walk: &Walk<'_>,
    table: &TomlTable<'_, '_>,
    asked: &[Asked],
) -> Option<Vec<ItemLimit>> {
    let (written, refused) = written(walk, Some(table), asked);
    named(asked, written, refused)
}

/// Limits with the names of their questions. `None` if some were refused and no other is left.
fn named(asked: &[Asked], limits: impl IntoIterator<Item = Option<Limit>>, refused: bool) -> Option<Vec<ItemLimit>> {
    let name = |asked: &Asked| Cow::Owned(asked.question.name.clone());
    let limits: Vec<ItemLimit> = asked
        .iter()
        .zip(limits)
        .filter_map(|(asked, limit)| Some(ItemLimit { measurement: name(asked), limit: limit? }))
        .collect();
    (!refused || !limits.is_empty()).then_some(limits)
}

/// Reads the limits of a table, one place for each question, and whether some were refused.
fn written(walk: &Walk<'_>, table: Option<&TomlTable<'_, '_>>, asked: &[Asked]) -> (Vec<Option<Limit>>, bool) {
    let mut limits = vec![None; asked.len()];
    let mut refused = false;
    for entry in table.into_iter().flat_map(TomlTable::entries) {
        let key = entry.key();
        let Some(at) = asked.iter().position(|asked| asked.question.name == key) else {
            let names = || asked.iter().map(|asked| asked.question.name.as_str());
            let hint = did_you_mean(key, names(), || format!("it asks {}", names().collect::<Vec<_>>().join(", ")));
            entry.key_mistake(format!("the item does not ask {}", quoted(key)), hint);
            refused = true;
            continue;
        };
        limits[at] = of_answer(walk, &entry, &asked[at]);
        refused |= limits[at].is_none();
    }
    (limits, refused)
}

/// Reads the limit of an answer; `None` if it is refused.
fn of_answer(walk: &Walk<'_>, entry: &TomlEntry<'_, '_>, asked: &Asked) -> Option<Limit> {
    let (key, question) = (entry.key(), &asked.question);
    let (kind, unit) = match question.kind {
        QuestionKind::Number { unit } => (MeasurementKind::Number(unit.dimension()), unit),
        _ => (MeasurementKind::Text, Unit::Count),
    };
    if matches!(question.kind, QuestionKind::Done) || (asked.good.is_some() && kind == MeasurementKind::Text) {
        let what = format!("{} has another limit already", quoted(key));
        entry.key_mistake(what, "its kind, its pattern or its good choices judge it; leave this limit out");
        return None;
    }
    let limit = limit_of(walk, entry, &Limited { name: key, kind, unit })?;
    // Every answer would fail.
    if let (QuestionKind::Choice { of }, Limit::Text(Expected::Literal(text))) = (&question.kind, &limit)
        && !of.contains(text)
    {
        let names = || of.iter().map(String::as_str);
        let hint = did_you_mean(text, names(), || format!("it may be {}", names().collect::<Vec<_>>().join(", ")));
        entry.mistake(format!("{} is no choice", quoted(text)), hint);
        return None;
    }
    Some(limit)
}

/// Reads a question; `None` if a part without which it cannot be asked is wrong.
fn one(walk: &Walk<'_>, table: TomlTable<'_, '_>, plan: &str) -> Option<Asked> {
    let name = table.required_text("name", "write name = \"supply_voltage\": the record has the answer under it");
    if let Some((name, span)) = &name {
        check_name(walk, name, span.clone());
    }
    let en = words(walk, table.required_text("en", "write en = \"What does the meter read?\""));
    let [zh, ru] = ["zh", "ru"].map(|lang| words(walk, table.text(lang)));
    let kind = kind(walk, &table);
    let picture = table.text("picture").and_then(|(path, span)| {
        let found = closure::joined(plan, path);
        if found.is_none() {
            let what = format!("{} is not a path beside this plan", quoted(path));
            walk.mistake(span, what, "write it relative to this file, with / between folders");
        }
        found
    });
    table.finish();
    let ((name, name_span), (kind, good)) = (name?, kind?);
    let words = QuestionWords { en: en?, zh, ru };
    let question = Arc::new(Question { name: name.to_owned(), words, kind, picture, picture_sha256: None });
    Some(Asked { question, name_span, good })
}

fn words(walk: &Walk<'_>, text: Option<(&str, Span)>) -> Option<String> {
    let (text, span) = text?;
    let length = text.chars().count();
    if text.trim().is_empty() || length > WORDS_CHARACTERS {
        let what = format!("the question has {length} characters");
        walk.mistake(span, what, format!("write 1 to {WORDS_CHARACTERS}"));
        return None;
    }
    Some(text.to_owned())
}

/// The name of a measurement is also a column of tables that programs read.
fn check_name(walk: &Walk<'_>, name: &str, span: Span) {
    let fit = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    let first = name.bytes().next().is_some_and(|byte| byte.is_ascii_lowercase());
    if !first || !name.bytes().all(fit) || name.len() > NAME_CHARACTERS {
        let hint = "small letters, digits and _ are allowed, at most 64 of them, a letter first";
        walk.mistake(span, format!("{} cannot be used as the name of a question", quoted(name)), hint);
    }
}

/// Reads the kind with its keys, and what these say of good answers.
fn kind(walk: &Walk<'_>, table: &TomlTable<'_, '_>) -> Option<(QuestionKind, Option<Limit>)> {
    let (kind, span) = table.required_text("kind", "write kind = \"number\", or text, choice, done")?;
    match kind {
        "number" => {
            // An empty one is that of a count.
            let (unit, span) = table.required_any_text("unit", "write unit = \"V\"; unit = \"\" for a plain number")?;
            let Some(unit) = Unit::parse(unit.trim()) else {
                walk.mistake(
                    span,
                    format!("unknown unit {}", quoted(unit)),
                    "write it as limits do: \"V\", \"mA\", \"degC\"",
                );
                return None;
            };
            Some((QuestionKind::Number { unit }, None))
        }
        "text" => {
            let Some((text, span)) = table.text("pattern") else {
                return Some((QuestionKind::Text { pattern: None }, None));
            };
            match SerialNumberPattern::new(text) {
                Ok(pattern) => {
                    Some((QuestionKind::Text { pattern: Some(pattern.clone()) }, Some(Limit::Matches(pattern))))
                }
                Err(why) => {
                    let hint = "write a regular expression, like \"GPS-[0-9]{5}\"";
                    walk.mistake(span, format!("the pattern {} cannot be read: {why}", quoted(text)), hint);
                    None
                }
            }
        }
        "choice" => choice(walk, table, span),
        DONE => Some((QuestionKind::Done, Some(Limit::Text(Expected::Literal(DONE.to_owned()))))),
        _ => {
            let hint = did_you_mean(kind, KINDS, || format!("it may be {}", KINDS.join(", ")));
            walk.mistake(span, format!("unknown kind {}", quoted(kind)), hint);
            None
        }
    }
}

fn choice(walk: &Walk<'_>, table: &TomlTable<'_, '_>, kind: Span) -> Option<(QuestionKind, Option<Limit>)> {
    let choices = table.texts("choices");
    let good = table.texts("good");
    if !(2..=MAX_CHOICES).contains(&choices.len()) {
        let what = format!("the question has {} choices", choices.len());
        walk.mistake(kind, what, format!("write 2 to {MAX_CHOICES} of them: choices = [\"clean\", \"scratched\"]"));
        return None;
    }
    let mut of: Vec<String> = Vec::new();
    for (choice, span) in choices {
        let length = choice.chars().count();
        let problem = if choice.trim() != choice || length == 0 || length > CHOICE_CHARACTERS {
            Some((
                format!("{} cannot be a choice", quoted(choice)),
                "write 1 to 40 characters, without blanks around them",
            ))
        } else if choice.parse::<f64>().is_ok() {
            Some((
                format!("the choice {} is a number", quoted(choice)),
                "the operator chooses by number; add a word, or ask kind = \"number\"",
            ))
        } else if of.iter().any(|known| known.to_lowercase() == choice.to_lowercase()) {
            Some((format!("the choice {} stands twice", quoted(choice)), "remove one of them"))
        } else {
            None
        };
        match problem {
            Some((what, hint)) => walk.mistake(span, what, hint),
            None => of.push(choice.to_owned()),
        }
    }
    let mut chosen: Vec<String> = Vec::new();
    for (choice, span) in good {
        if of.iter().any(|known| known == choice) {
            chosen.push(choice.to_owned());
        } else {
            let hint =
                did_you_mean(choice, of.iter().map(String::as_str), || "good choices stand in choices too".to_owned());
            walk.mistake(span, format!("{} is no choice", quoted(choice)), hint);
        }
    }
    if chosen.is_empty() && table.has("good") {
        walk.mistake(kind, "no choice is good", "name those that pass in good, or leave it out for information");
    }
    let limit = (!chosen.is_empty()).then_some(Limit::OneOf(chosen));
    Some((QuestionKind::Choice { of }, limit))
}
