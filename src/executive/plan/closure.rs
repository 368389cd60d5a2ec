//! A plan file and all its includes.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use gnc_config::{Mistake, Mistakes, SourceText, Span, TomlTable, Walk, did_you_mean, parse};
use gnc_text::{printable, quoted};

use super::item::{self, NAME_CHARACTERS, RawItem, check_name};
use super::part::{self, Known, RawTable};
use super::question::Asked;
use super::resume::{self, ResumeRules};
use super::{
    DEFAULT_VALID_DAYS, MAX_INCLUDE_DEPTH, MAX_ITEMS, MAX_PLAN_BYTES, MAX_PLAN_FILES, MAX_REQUIRED_PLANS, MAX_RESULTS,
    MAX_VALID_DAYS, OnFail, Plan, PlanItem,
};
use crate::catalogue::{ItemId, ParamKind};
use crate::numbers::{self, NumberField};
use crate::serial_number::{self, SerialNumberPattern};

/// Bytes of a path: the limit of most systems.
const PATH_BYTES: usize = 4096;

/// What can be tried if an include is not there.
const NO_SUCH_FILE: &str = "the path is relative to the file that includes it";

/// Why an include cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnreadInclude {
    /// The cause.
    pub why: String,
    /// What can be tried; `None` if the file is not there.
    pub try_this: Option<&'static str>,
}

impl From<String> for UnreadInclude {
    fn from(why: String) -> Self {
        Self { why, try_this: None }
    }
}

/// The state of reading a plan with its includes.
struct Reader<'l> {
    load: &'l mut dyn FnMut(&str) -> Result<Vec<u8>, UnreadInclude>,
    sources: Vec<SourceText>,
    items: Vec<RawItem>,
    /// Items of the files so far, whether they are read or too many.
    planned: usize,
    parts: Vec<RawTable>,
    /// Whether an item or include could not be read; an unknown name may then be right.
    unreadable: bool,
    mistakes: Mistakes,
}

/// The keys of a plan beside its items.
struct Head {
    name: String,
    version: String,
    description: String,
    on_fail: OnFail,
    requires_plan: Vec<String>,
    valid_days: u32,
    resume: ResumeRules,
    serial_number: Option<SerialNumberPattern>,
    requires_part: bool,
    numbers: Vec<NumberField>,
}

/// Reads the plan, its includes first.
pub(super) fn read(
    name: &str,
    bytes: Vec<u8>,
    load: &mut dyn FnMut(&str) -> Result<Vec<u8>, UnreadInclude>,
) -> Result<Plan, Mistakes> {
    let source = SourceText::new(name, bytes, MAX_PLAN_BYTES)?;
    let sources = vec![source];
    let mut reader = Reader {
        load,
        sources,
        items: Vec::new(),
        planned: 0,
        parts: Vec::new(),
        unreadable: false,
        mistakes: Mistakes::default(),
    };
    let head = reader.file(0, &mut vec![0])?;
    let Reader { sources, items, planned, parts, unreadable, mut mistakes, .. } = reader;
    if planned > MAX_ITEMS {
        let what = format!("the plan has {planned} items, and at most {MAX_ITEMS} are run");
        mistakes.add(|| Mistake::nowhere(what, "use repeats, or a loop over a shorter plan"));
    }
    if items.is_empty() && !unreadable && mistakes.iter().next().is_none() {
        mistakes.add(|| Mistake::nowhere("the plan has no items", "begin each item with a line [[item]]"));
    }
    let items = link(items, &sources, unreadable, &mut mistakes);
    // A good run has a result for each limit in each repeat.
    let results = items
        .iter()
        .fold(0_usize, |results, item| results.saturating_add(item.limits.len().saturating_mul(item.repeats as usize)));
    if results > MAX_RESULTS {
        let what = format!(
            "the plan asks for {results} results with all repeats and at most {MAX_RESULTS} have room in a record"
        );
        mistakes.add(|| {
            Mistake::nowhere(what, "lower repeats and run the plan in rounds: each round has a record of its own")
        });
    }
    let Head {
        name,
        version,
        description,
        on_fail,
        requires_plan,
        valid_days,
        resume,
        serial_number,
        requires_part,
        numbers,
    } = head;
    if requires_part && parts.is_empty() && !unreadable {
        let what = "the plan requires a part that it names, and names none";
        mistakes.add(|| Mistake::nowhere(what, "name parts by [part.NAME.limits], or remove requires_part"));
    }
    let parts = part::link(parts, &items, &sources, requires_part, &mut mistakes);
    mistakes.or(Plan {
        name,
        version,
        description,
        on_fail,
        requires_plan,
        valid_days,
        resume,
        serial_number,
        requires_part,
        numbers,
        items,
        parts,
        sources,
    })
}

impl Reader<'_> {
    /// Reads one file; `chain` holds the files that include it, with this file last.
    ///
    /// A syntax error in any file ends the reading; mistakes of meaning are collected.
    fn file(&mut self, index: usize, chain: &mut Vec<usize>) -> Result<Head, Mistakes> {
        let source = self.sources[index].clone();
        let tree = parse(&source)?;
        let walk = Walk::new(&source, std::mem::take(&mut self.mistakes));
        let root = TomlTable::new(&walk, &tree, 0..0);
        let head = head(&walk, &root);
        let includes = root.texts("include");
        let tables = root.tables("item");
        let has_parts = root.entry("part").is_some();
        if !root.has("item") && !root.has("include") {
            walk.mistake(root.span(), "the plan has no items", "begin each item with a line [[item]]");
        }
        let planned = tables.len();
        self.planned = self.planned.saturating_add(planned);
        // Too many are counted and not looked at: the plan is refused in any case, and to read them takes long.
        let read = if self.planned > MAX_ITEMS { 0 } else { planned };
        let own: Vec<RawItem> =
            tables.into_iter().take(read).filter_map(|table| item::read(&walk, table, (index, &source.name))).collect();
        self.unreadable |= own.len() < planned;
        root.finish();
        self.mistakes = walk.into_mistakes();
        for (include, span) in includes {
            self.include(&source, include, span, chain)?;
        }
        self.items.extend(own);
        if has_parts {
            // Only now the items that the tables of parts name are known.
            let walk = Walk::new(&source, std::mem::take(&mut self.mistakes));
            let root = TomlTable::new(&walk, &tree, 0..0);
            let known = Known { items: &self.items, unreadable: self.unreadable, source: index };
            self.parts.extend(part::read(&walk, &root, &known));
            self.mistakes = walk.into_mistakes();
        }
        Ok(head)
    }

    fn include(&mut self, by: &SourceText, include: &str, span: Span, chain: &mut Vec<usize>) -> Result<(), Mistakes> {
        let refused = |what: String, hint: &str| by.mistake(span.clone(), what, hint);
        let Some(name) = joined(&by.name, include) else {
            let what = format!("{} is not a path beside this plan", quoted(include));
            let hint = "write it relative to this file, with / between folders";
            self.unreadable = true;
            self.mistakes.add(|| refused(what, hint));
            return Ok(());
        };
        let known = self.sources.iter().position(|source| source.name == name);
        let problem = match known {
            Some(known) if chain.contains(&known) => {
                let from = chain.iter().position(|file| *file == known).unwrap_or(0);
                let files: Vec<String> =
                    chain[from..].iter().chain([&known]).map(|file| quoted(&self.sources[*file].name)).collect();
                Some((format!("the includes form a circle: {}", files.join(" > ")), "remove one of them"))
            }
            Some(_) => Some((format!("{} is included twice", quoted(&name)), "remove one of them")),
            None if self.sources.len() >= MAX_PLAN_FILES => {
                Some((format!("the plan has more than {MAX_PLAN_FILES} files"), "join some of them into one file"))
            }
            None if chain.len() > MAX_INCLUDE_DEPTH => {
                Some((format!("includes are nested more than {MAX_INCLUDE_DEPTH} deep"), "include it higher up"))
            }
            None => None,
        };
        if let Some((what, hint)) = problem {
            self.unreadable = true;
            self.mistakes.add(|| refused(what, hint));
            return Ok(());
        }
        let bytes = match (self.load)(&name) {
            Ok(bytes) => bytes,
            Err(UnreadInclude { why, try_this }) => {
                let what = format!("{} cannot be read: {}", quoted(&name), printable(&why));
                self.unreadable = true;
                self.mistakes.add(|| refused(what, try_this.unwrap_or(NO_SUCH_FILE)));
                return Ok(());
            }
        };
        let index = self.sources.len();
        self.sources.push(SourceText::new(&name, bytes, MAX_PLAN_BYTES)?);
        chain.push(index);
        // What stands at the head of an included plan is not used here: it serves when that plan runs by itself.
        self.file(index, chain)?;
        chain.pop();
        Ok(())
    }
}

fn head(walk: &Walk<'_>, root: &TomlTable<'_, '_>) -> Head {
    let name = root.required_text("name", "write name = \"functional\" at the top").map(|(name, span)| {
        check_name(walk, name, span);
        name.to_owned()
    });
    let version = root.required_text("version", "write version = \"1.0\" at the top").map(|(version, span)| {
        if version.chars().count() > NAME_CHARACTERS || version.chars().any(char::is_control) {
            walk.mistake(span, format!("{} cannot be used as a version", quoted(version)), "write it like \"1.0\"");
        }
        version.to_owned()
    });
    let on_fail = match root.text("on_fail") {
        None | Some(("continue", _)) => OnFail::Continue,
        Some(("stop", _)) => OnFail::Stop,
        Some((text, span)) => {
            let hint = "\"continue\" runs the remaining items, \"stop\" skips them";
            walk.mistake(span, format!("on_fail is {}", quoted(text)), hint);
            OnFail::Continue
        }
    };
    let description = root.text("description").map_or("", |(text, _)| text).to_owned();
    let name = name.unwrap_or_default();
    let requires_plan = required_plans(walk, root, &name);
    let valid_days = root.integer("valid_days", (1, MAX_VALID_DAYS), i64::from(DEFAULT_VALID_DAYS));
    let valid_days = u32::try_from(valid_days).unwrap_or(DEFAULT_VALID_DAYS);
    let resume = resume::read(root.table("resume"));
    let version = version.unwrap_or_default();
    let serial_number = serial_number::pattern(root, "serial_number", "SN-[0-9]{4}");
    let requires_part = root.flag("requires_part");
    let numbers = numbers::read(root);
    Head {
        name,
        version,
        description,
        on_fail,
        requires_plan,
        valid_days,
        resume,
        serial_number,
        requires_part,
        numbers,
    }
}

/// Names of the plans that the module must have passed before the plan `name`.
fn required_plans(walk: &Walk<'_>, root: &TomlTable<'_, '_>, name: &str) -> Vec<String> {
    let mut required: Vec<String> = Vec::new();
    for (index, (other, span)) in root.texts("requires_plan").into_iter().enumerate() {
        if index == MAX_REQUIRED_PLANS {
            walk.mistake(span, format!("more than {MAX_REQUIRED_PLANS} plans are required"), "name the last of them");
            break;
        }
        check_name(walk, other, span.clone());
        if other == name {
            walk.mistake(span, "the plan requires itself", "name another plan, or remove this name");
        } else if required.iter().any(|known| known == other) {
            walk.mistake(span, format!("{} is required twice", quoted(other)), "remove one of them");
        } else {
            required.push(other.to_owned());
        }
    }
    required
}

/// Orders the items by phase, gives each its requirements by position, and refuses doubled names.
fn link(mut raw: Vec<RawItem>, sources: &[SourceText], unreadable: bool, mistakes: &mut Mistakes) -> Vec<PlanItem> {
    // The sort is stable: within a phase the order of the files stays.
    raw.sort_by_key(|raw| raw.item.phase);
    let mut positions: HashMap<&str, usize> = HashMap::with_capacity(raw.len());
    for (position, RawItem { item, name_span, .. }) in raw.iter().enumerate() {
        match positions.entry(item.name.as_str()) {
            Entry::Vacant(vacant) => {
                vacant.insert(position);
            }
            Entry::Occupied(first) => mistakes.add(|| {
                let other = &raw[*first.get()];
                let place = sources[other.item.place.source].place(other.name_span.clone());
                let what = format!(
                    "the name {} appears twice, first at {}:{}",
                    quoted(&item.name),
                    printable(&place.file),
                    place.line
                );
                let hint = "give one of them a name of its own: name = \"...\"";
                sources[item.place.source].mistake(name_span.clone(), what, hint)
            }),
        }
    }
    check_questions(&raw, sources, mistakes);
    let mut first: HashMap<ItemId, usize> = HashMap::new();
    for (position, raw) in raw.iter().enumerate() {
        first.entry(raw.item.id).or_insert(position);
    }
    let linker = Linker { raw: &raw, positions: &positions, first: &first, sources, unreadable };
    let requires: Vec<Vec<usize>> = (0..raw.len()).map(|position| linker.requirements(position, mistakes)).collect();
    drop(positions);
    raw.into_iter().zip(requires).map(|(raw, requires)| PlanItem { requires, ..raw.item }).collect()
}

/// Refuses two questions of one name: an answer on the command line names its question alone.
fn check_questions(raw: &[RawItem], sources: &[SourceText], mistakes: &mut Mistakes) {
    let mut seen: HashMap<&str, ()> = HashMap::new();
    for RawItem { item, asked, .. } in raw {
        for Asked { question, name_span: span, .. } in asked {
            if seen.insert(&question.name, ()).is_some() {
                let what = format!("two questions have the name {}", quoted(&question.name));
                let hint = "give one of them another name: answers are filed under it";
                mistakes.add(|| sources[item.place.source].mistake(span.clone(), what, hint));
            }
        }
    }
}

/// The data to find items by their names.
struct Linker<'a> {
    raw: &'a [RawItem],
    positions: &'a HashMap<&'a str, usize>,
    /// Where the first item of each kind stands.
    first: &'a HashMap<ItemId, usize>,
    sources: &'a [SourceText],
    unreadable: bool,
}

impl Linker<'_> {
    /// Positions of the items that must be good before this one: those that it requires, and the one whose captures it
    /// uses.
    fn requirements(&self, position: usize, mistakes: &mut Mistakes) -> Vec<usize> {
        let raw = &self.raw[position];
        let mut found: Vec<usize> =
            raw.requires.iter().filter_map(|(name, span)| self.find(position, name, span, mistakes)).collect();
        if let Some((name, span)) = &raw.source
            && let Some(at) = self.find(position, name, span, mistakes)
        {
            self.check_source(position, at, span, mistakes);
            if !found.contains(&at) {
                found.push(at);
            }
        }
        self.check_needs(position, mistakes);
        found
    }

    /// Position of an item before this one.
    fn find(&self, position: usize, name: &str, span: &Span, mistakes: &mut Mistakes) -> Option<usize> {
        let at = self.positions.get(name).copied();
        if let Some(required) = at.filter(|at| *at < position) {
            return Some(required);
        }
        if at.is_none() && self.unreadable {
            return None;
        }
        mistakes.add(|| {
            let (what, hint) = match at {
                Some(at) if at == position => (format!("{} requires itself", quoted(name)), String::new()),
                Some(_) => (
                    format!("{} runs after the item that requires it", quoted(name)),
                    "move it up: items run in the order of the plan, setup first and teardown last".to_owned(),
                ),
                None => (
                    format!("no item has the name {}", quoted(name)),
                    did_you_mean(name, self.positions.keys().copied(), || {
                        "add that item before this one, or remove the name here".to_owned()
                    }),
                ),
            };
            self.source_of(position).mistake(span.clone(), what, hint)
        });
        None
    }

    /// Checks that the item whose captures are used makes captures of the right kind.
    fn check_source(&self, position: usize, at: usize, span: &Span, mistakes: &mut Mistakes) {
        let (item, other) = (&self.raw[position].item, &self.raw[at].item);
        let kinds = item.id.spec().params.iter().find_map(|param| match param.kind {
            ParamKind::Source { of } => Some(of),
            _ => None,
        });
        let kinds = kinds.unwrap_or_default();
        if !kinds.contains(&other.id) {
            let ids = kinds.iter().map(|id| id.as_str()).collect::<Vec<_>>().join(" or ");
            let what = format!("{} has no captures that {} can use", quoted(&other.name), item.id);
            mistakes
                .add(|| self.source_of(position).mistake(span.clone(), what, format!("name an item that is {ids}")));
        }
    }

    /// Checks that the calibration that the item needs is made before it.
    fn check_needs(&self, position: usize, mistakes: &mut Mistakes) {
        let item = &self.raw[position].item;
        for (need, when) in item.id.spec().needs {
            let there = self.first.get(need).is_some_and(|first| *first < position);
            if !there && !self.unreadable && item.params.switch_on(*when) {
                let what = format!("{} uses the results of {need}, and no {need} comes before it", quoted(&item.name));
                let hint = format!("put an item with id = \"{need}\" before it");
                let span = item.place.start..item.place.end;
                mistakes.add(|| self.source_of(position).mistake(span, what, hint));
            }
        }
    }

    fn source_of(&self, position: usize) -> &SourceText {
        &self.sources[self.raw[position].item.place.source]
    }
}

/// The name of an included file, relative to the folder of the file that includes it, without `.` and `..` inside.
///
/// `None` for an absolute path: a folder of plans must work after it is moved.
pub(super) fn joined(by: &str, include: &str) -> Option<String> {
    let unfit = include.is_empty() || include.len() > PATH_BYTES || include.contains('\\');
    if unfit || include.starts_with('/') || include.chars().any(char::is_control) {
        return None;
    }
    let folder = by.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut parts: Vec<&str> = Vec::new();
    for part in folder.split('/').chain(include.split('/')) {
        match part {
            "." => {}
            "" if !parts.is_empty() => {}
            ".." if parts.last().is_some_and(|last| !matches!(*last, "" | "..")) => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    // Without a folder the first part is empty and goes; with an absolute folder it must stay.
    if folder.is_empty() && !by.starts_with('/') && parts.first() == Some(&"") {
        parts.remove(0);
    }
    Some(parts.join("/"))
}
