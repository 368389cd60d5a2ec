//! `[part.NAME.limits]` of a plan: limits for modules with a certain part number, or a certain revision of it.
//!
//! ```toml
//! [part.GNC-POP-26B.limits]
//! imu.gyro_x = "0 +- 1 deg/s"
//! [part.GNC-POP-26B.revision.C.limits]
//! identity.supply_current = "<= 520 mA"
//! ```
//! A revision stands under the word `revision`, so that no revision can be taken for another key of a part, and a misspelt key
//! for no revision.

use std::collections::HashMap;

use gnc_config::{Mistake, Mistakes, SourceText, Span, TomlEntry, TomlTable, Walk, did_you_mean};
use gnc_text::quoted;

use super::item::RawItem;
use super::{ItemLimit, PlanItem, limits, question};
use crate::catalogue::ItemId;
use crate::part::{PartKey, PartName, unfit};

/// Most tables of parts and revisions of a plan: more than any family of products has.
const MAX_TABLES: usize = 1000;

/// The limits of a part, or of one revision of it, by the positions of their items.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PartLimits {
    /// The part as the plan writes it.
    pub(super) name: PartName,
    /// For each item that is judged otherwise its other limits.
    pub(super) items: Vec<(usize, Vec<ItemLimit>)>,
}

/// The table of a part in one file, whose items are still names.
pub(super) struct RawTable {
    name: PartName,
    source: usize,
    span: Span,
    items: Vec<(String, Vec<ItemLimit>)>,
    /// Whether it names limits, or revisions that do.
    is_empty: bool,
    /// Whether all of it could be read.
    whole: bool,
}

/// What the tables of a file may name.
pub(super) struct Known<'a> {
    pub(super) items: &'a [RawItem],
    /// Whether an item could not be read; an unknown name may then be right.
    pub(super) unreadable: bool,
    pub(super) source: usize,
}

/// Reads all tables of parts of a file.
pub(super) fn read(walk: &Walk<'_>, root: &TomlTable<'_, '_>, known: &Known<'_>) -> Vec<RawTable> {
    let mut tables: Vec<RawTable> = Vec::new();
    let mut seen: HashMap<PartKey, String> = HashMap::new();
    let Some(parts) = root.table("part") else { return tables };
    for entry in parts.entries() {
        let Some(table) = named(&entry, "part number", false).then(|| entry.table()).flatten() else { continue };
        let name = PartName::new(entry.key(), None);
        is_new(&entry, &name, &mut seen);
        let mut own = of_table(walk, &table, known, name, entry.key_span());
        let revisions = table.table("revision").map(|table| table.entries()).unwrap_or_default();
        own.is_empty &= revisions.is_empty();
        tables.push(own);
        for revision in revisions {
            let Some(table) = named(&revision, "revision", true).then(|| revision.table()).flatten() else { continue };
            let name = PartName::new(entry.key(), Some(revision.key()));
            is_new(&revision, &name, &mut seen);
            tables.push(of_table(walk, &table, known, name, revision.key_span()));
            table.finish();
        }
        table.finish();
    }
    tables
}

/// Whether a module can have this name.
fn named(entry: &TomlEntry<'_, '_>, what: &str, may_be_empty: bool) -> bool {
    let name = entry.key();
    if name.trim().is_empty() && !may_be_empty {
        let hint = "write it as the module says it; requires_part = true refuses modules without one";
        entry.key_mistake(format!("the {what} is empty"), hint);
        return false;
    }
    let unfit = unfit(name);
    if let Some((why, hint)) = unfit {
        entry.key_mistake(format!("the {what} {} {why}", quoted(name)), hint);
    }
    unfit.is_none()
}

/// Refuses a second name of the same part in one file.
fn is_new(entry: &TomlEntry<'_, '_>, name: &PartName, seen: &mut HashMap<PartKey, String>) {
    if let Some(first) = seen.insert(name.key(), entry.key().to_owned()) {
        let what = format!("{} and {} mean the same", quoted(&first), quoted(entry.key()));
        entry.key_mistake(what, "write both into one table: large and small letters and spaces make no difference");
    }
}

fn of_table(walk: &Walk<'_>, table: &TomlTable<'_, '_>, known: &Known<'_>, name: PartName, span: Span) -> RawTable {
    let (mut items, mut whole) = (Vec::new(), true);
    let entries = table.table("limits").map(|limits| limits.entries()).unwrap_or_default();
    let is_empty = entries.is_empty();
    for entry in entries {
        let read = of_item(walk, &entry, known);
        whole &= read.is_some();
        items.extend(read);
    }
    RawTable { name, source: known.source, span, items, is_empty, whole }
}

/// The limits for one item; `None` if some are refused.
fn of_item(walk: &Walk<'_>, entry: &TomlEntry<'_, '_>, known: &Known<'_>) -> Option<(String, Vec<ItemLimit>)> {
    let name = entry.key();
    let Some(raw) = known.items.iter().find(|raw| raw.item.name == name) else {
        if !known.unreadable {
            let names = known.items.iter().map(|raw| raw.item.name.as_str());
            let hint = did_you_mean(name, names, || {
                "write the name of an item before the measurement: imu.gyro_x = \"0 +- 1 deg/s\"".to_owned()
            });
            entry.key_mistake(format!("no item has the name {}", quoted(name)), hint);
        }
        return None;
    };
    let table = entry.table()?;
    let many = table.entries().len();
    let limits = match raw.item.id {
        ItemId::Prompt => question::limits_of_part(walk, &table, &raw.asked),
        id => limits::read(walk, Some(&table), id, &raw.item.params),
    }?;
    // Some of several limits may be refused.
    (many == 0 || !limits.is_empty()).then(|| (name.to_owned(), limits))
}

/// Joins the tables of all files, in the order of reading: a limit of the file that includes counts more. Refuses tables that
/// change nothing; if `all_named`, an empty one says that the part may be tested.
pub(super) fn link(
    raw: Vec<RawTable>,
    items: &[PlanItem],
    sources: &[SourceText],
    all_named: bool,
    mistakes: &mut Mistakes,
) -> Vec<PartLimits> {
    if raw.len() > MAX_TABLES {
        let what = format!("the plan has {} tables of parts, and at most {MAX_TABLES} are read", raw.len());
        mistakes.add(|| Mistake::nowhere(what, "write a plan for each family of parts"));
        return Vec::new();
    }
    let positions: HashMap<&str, usize> =
        items.iter().enumerate().map(|(position, item)| (item.name.as_str(), position)).collect();
    let mut joined: Vec<Joined> = Vec::new();
    let mut by_key: HashMap<PartKey, usize> = HashMap::new();
    for RawTable { name, source, span, items, is_empty, whole } in raw {
        let key = name.key();
        let at = *by_key.entry(key).or_insert(joined.len());
        if at == joined.len() {
            let limits = PartLimits { name, items: Vec::new() };
            joined.push(Joined { limits, source, span: span.clone(), is_empty: true, whole: true });
        }
        let one = &mut joined[at];
        (one.source, one.span) = (source, span);
        one.is_empty &= is_empty;
        one.whole &= whole;
        for (name, limits) in items {
            let Some(position) = positions.get(name.as_str()) else { continue };
            match one.limits.items.iter_mut().find(|(other, _)| other == position) {
                Some((_, before)) => limits.into_iter().for_each(|limit| put(before, limit)),
                None => one.limits.items.push((*position, limits)),
            }
        }
    }
    for one in joined.iter().filter(|one| one.whole) {
        let name = &one.limits.name;
        let below = name.revision.as_ref().and_then(|_| by_key.get(&PartName { revision: None, ..name.clone() }.key()));
        let below = below.map(|at| &joined[*at].limits);
        if let Some((what, hint)) = one.useless(items, below, all_named) {
            mistakes.add(|| sources[one.source].mistake(one.span.clone(), what, hint));
        }
    }
    joined.into_iter().map(|one| one.limits).collect()
}

/// The tables of one part in all files.
struct Joined {
    limits: PartLimits,
    /// Where the last of them stands.
    source: usize,
    span: Span,
    is_empty: bool,
    whole: bool,
}

impl Joined {
    /// What is wrong with a table that changes nothing beside the limits below it.
    fn useless(
        &self,
        items: &[PlanItem],
        below: Option<&PartLimits>,
        all_named: bool,
    ) -> Option<(String, &'static str)> {
        let name = quoted(&self.limits.name.to_string());
        if self.is_empty {
            let hint = "write limits below it, or remove it";
            return (!all_named).then(|| (format!("the table of {name} has no limits"), hint));
        }
        let was = |position: usize, limit: &ItemLimit| {
            let of_part = below.and_then(|below| {
                let (_, limits) = below.items.iter().find(|(other, _)| *other == position)?;
                limits.iter().find(|other| other.measurement == limit.measurement).map(|other| &other.limit)
            });
            of_part.or_else(|| items.get(position)?.limit(&limit.measurement)) == Some(&limit.limit)
        };
        let mut all = self.limits.items.iter().flat_map(|(at, limits)| limits.iter().map(move |limit| (*at, limit)));
        // A part whose revisions alone have limits has none itself.
        if self.limits.items.is_empty() || !all.all(|(position, limit)| was(position, limit)) {
            return None;
        }
        let whose = if below.is_some() { "the limits of its part" } else { "the plan's own limits" };
        Some((format!("the table of {name} has {whose}"), "write limits that differ, or remove it"))
    }
}

/// Puts a limit in the place of the one for the same measurement.
pub(super) fn put(limits: &mut Vec<ItemLimit>, limit: ItemLimit) {
    match limits.iter_mut().find(|other| other.measurement == limit.measurement) {
        Some(other) => *other = limit,
        None => limits.push(limit),
    }
}
