//! One `[[item]]` of a plan.

use std::sync::Arc;

use gnc_config::{Span, TomlTable, Walk, did_you_mean};
use gnc_text::quoted;

use super::question::Asked;
use super::{ItemPlace, Phase, PlanItem, limits, params, question};
use crate::catalogue::{ItemId, ParamKind};
use crate::quantity::{Dimension, quantity_at};
use crate::uncertainty::Decision;

/// Characters of a name. A name becomes a folder.
pub(super) const NAME_CHARACTERS: usize = 64;

/// Most tries of an item: an item that fails ten times will fail again.
const MAX_ATTEMPTS: i64 = 10;

/// Most rounds within an attempt. Longer runs are loops; each round of a loop has its own record.
const MAX_REPEATS: i64 = 1000;

/// Shortest and longest time for an attempt.
const TIMEOUT_S: (f64, f64) = (0.001, 86_400.0);

/// Most characters of a prompt: it must fit on a screen.
const PROMPT_CHARACTERS: usize = 500;

/// An item whose requirements are still names.
pub(super) struct RawItem {
    pub(super) item: PlanItem,
    pub(super) name_span: Span,
    pub(super) requires: Vec<(String, Span)>,
    /// The item whose captures this item uses.
    pub(super) source: Option<(String, Span)>,
    /// Its questions, as read.
    pub(super) asked: Vec<Asked>,
}

/// Reads an item; `None` if its kind is unknown, since its other keys cannot be checked then.
pub(super) fn read(walk: &Walk<'_>, table: TomlTable<'_, '_>, (source, plan): (usize, &str)) -> Option<RawItem> {
    let (id, id_span) = table.required_text("id", "write id = \"imu\", or another item of the table")?;
    let Some(id) = ItemId::from_id(id) else {
        let hint = did_you_mean(id, ItemId::ALL.iter().map(|item| item.as_str()), || {
            "`docs/plan.schema.json` lists the items; an editor that reads it offers them".to_owned()
        });
        walk.mistake(id_span, format!("unknown item {}", quoted(id)), hint);
        return None;
    };
    let spec = id.spec();
    let (name, name_span) = match table.text("name") {
        None => (id.as_str(), id_span.clone()),
        Some((name, span)) => {
            check_name(walk, name, span.clone());
            (name, span)
        }
    };
    let phase = phase(walk, &table);
    let optional = table.flag("optional");
    let requires = table.texts("requires").into_iter().map(|(name, span)| (name.to_owned(), span)).collect();
    let attempts = table.integer("attempts", (1, MAX_ATTEMPTS), 1);
    let retry_failed = table.flag("retry_failed");
    if retry_failed && attempts == 1 {
        let span = table.entry("retry_failed").map_or(table.span(), |entry| entry.span());
        walk.mistake(span, "retry_failed has no effect with one attempt", "write attempts = 2 beside it");
    }
    let repeats = table.integer("repeats", (1, MAX_REPEATS), 1);
    let timeout_s = timeout(walk, &table).unwrap_or(spec.timeout_s);
    let decision = decision(walk, &table);
    let prompt = prompt(walk, &table);
    let written = table.table("params");
    let params = params::read(written.as_ref(), id);
    let source_param = spec.params.iter().find(|param| matches!(param.kind, ParamKind::Source { .. }));
    let captures = source_param.and_then(|param| {
        let name = params.source(param.name).ok()??;
        let span = written.as_ref()?.entry(param.name)?.span();
        Some((name.to_owned(), span))
    });
    let (limits, asked) = if id == ItemId::Prompt {
        if let Some(entry) = table.entry("timeout") {
            entry.key_mistake("a question has no time limit", "leave it out: the run waits as long as a person needs");
        }
        let asked = question::questions(walk, &table, (plan, &id_span));
        (question::limits(walk, table.table("limits").as_ref(), &asked), asked)
    } else {
        (limits::read(walk, table.table("limits").as_ref(), id, &params), Vec::new())
    };
    if limits.as_ref().is_some_and(Vec::is_empty) && phase == Phase::Test {
        let what = format!("{} has no limits, so the station could not judge it", quoted(name));
        walk.mistake(id_span.clone(), what, "write them below a line [item.limits]");
    }
    table.finish();
    let item = PlanItem {
        name: name.to_owned(),
        id,
        phase,
        optional,
        requires: Vec::new(),
        attempts: u32::try_from(attempts).unwrap_or(1),
        retry_failed,
        repeats: u32::try_from(repeats).unwrap_or(1),
        timeout_s,
        decision,
        prompt,
        params,
        questions: asked.iter().map(|asked| Arc::clone(&asked.question)).collect(),
        limits: limits.unwrap_or_default(),
        place: ItemPlace { source, start: id_span.start, end: id_span.end },
    };
    Some(RawItem { item, name_span, requires, source: captures, asked })
}

fn phase(walk: &Walk<'_>, table: &TomlTable<'_, '_>) -> Phase {
    match table.text("phase") {
        None | Some(("test", _)) => Phase::Test,
        Some(("setup", _)) => Phase::Setup,
        Some(("teardown", _)) => Phase::Teardown,
        Some((text, span)) => {
            let hint = "\"setup\" comes before all tests, \"teardown\" after them, and \"test\" is the usual one";
            walk.mistake(span, format!("unknown phase {}", quoted(text)), hint);
            Phase::Test
        }
    }
}

fn decision(walk: &Walk<'_>, table: &TomlTable<'_, '_>) -> Decision {
    let Some((text, span)) = table.text("decision") else { return Decision::default() };
    let known = [Decision::Simple, Decision::GuardBand].into_iter().find(|decision| decision.as_str() == text);
    known.unwrap_or_else(|| {
        let hint =
            "\"simple\": the value decides; \"guard-band\": its whole coverage interval must be within the limit";
        walk.mistake(span, format!("unknown decision {}", quoted(text)), hint);
        Decision::default()
    })
}

fn timeout(walk: &Walk<'_>, table: &TomlTable<'_, '_>) -> Option<f64> {
    let (timeout, span) = quantity_at(table, "timeout", Dimension::Time)?;
    let seconds = timeout.si();
    if !(TIMEOUT_S.0..=TIMEOUT_S.1).contains(&seconds) {
        walk.mistake(span, format!("a timeout of {timeout} is out of range"), "write 1 ms to 24 h");
        return None;
    }
    Some(seconds)
}

fn prompt(walk: &Walk<'_>, table: &TomlTable<'_, '_>) -> Option<String> {
    let (prompt, span) = table.text("prompt")?;
    let length = prompt.chars().count();
    if prompt.trim().is_empty() || length > PROMPT_CHARACTERS {
        let what = format!("the prompt has {length} characters");
        walk.mistake(span, what, format!("write 1 to {PROMPT_CHARACTERS}, or leave it out"));
        return None;
    }
    Some(prompt.to_owned())
}

/// Refuses a name that cannot be the name of a folder.
pub(super) fn check_name(walk: &Walk<'_>, name: &str, span: Span) {
    let fit = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || matches!(byte, b'-' | b'_' | b'.');
    let first = name.bytes().next().is_some_and(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit());
    if !first || !name.bytes().all(fit) || name.len() > NAME_CHARACTERS {
        let hint = "small letters, digits, - _ and . are allowed, at most 64 of them, a letter or digit first";
        walk.mistake(span, format!("{} cannot be used as the name of a folder", quoted(name)), hint);
    }
}
