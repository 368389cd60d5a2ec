//! Checks the chain from the first line to the last.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::before::day_and_time;
use super::entry::{ChainEntry, Place};
use super::read::{MAX_COUNTER_BYTES, name_in};
use super::snapshot::Snapshot;
use super::{COUNTER, NOTHING, begin, contradictions, empty, matching, places, signed, times};
use crate::store::{DIGESTS, PublicKey, StoreError, Unread, goes_on, reader};

/// What to do about what stands in the place of a chain.
const NO_CHAIN_FILE: &str = "a station did not put that there: move it away, and bring the file back from a backup";

/// What to do about what stands in the place of the counter.
const NO_COUNTER_FILE: &str =
    "a station did not put that there: move it away; the next start makes COUNTER again from the chain";

/// What to do without the counter: a tail that was cut off looks the same.
const NO_COUNTER: &str = "give a copy of COUNTER with --counter FILE or number and link of the newest paper with --head: they show whether the newest runs are there; the next start makes COUNTER again";

/// What the chain is compared with.
#[derive(Debug, Clone, Copy, Default)]
pub struct Against<'a> {
    /// Public keys of the stations that write here. Without one, no signature is checked.
    pub keys: &'a [PublicKey],
    /// What was kept elsewhere.
    pub heads: &'a [Head],
}

/// Number and link of a line, kept outside of the records folder: on a paper, or in a copy of the counter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Where it was kept, for people.
    pub kept: String,
    /// The line.
    pub place: Place,
}

/// The result of a check of the chain.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct ChainCheck {
    /// Closed runs in the chain.
    pub runs: usize,
    /// Number of the first line in the chain. If it is not 1, earlier days were moved elsewhere.
    pub first: u64,
    /// What was changed, a sentence each.
    pub problems: Vec<String>,
    /// What could not be read: nothing is known of it.
    pub unread: Vec<Unread>,
    /// Folders beside the runs that file servers and file managers make, a sentence each.
    pub litter: Vec<String>,
    /// What a sudden end or a disk error left, a sentence each; the next start mends it.
    pub incomplete: Vec<String>,
    /// What a reader should know, and is no change.
    pub notes: Vec<String>,
    /// Runs in the chain that were closed late.
    pub late: usize,
    /// Lines with a signature.
    pub signed: usize,
}

impl ChainCheck {
    /// Whether nothing was checked: there is no line, and nothing speaks of one.
    #[must_use]
    pub fn is_of_nothing(&self) -> bool {
        self.first == 0 && self.problems.is_empty() && self.unread.is_empty() && self.incomplete.is_empty()
    }
}

/// All lines of a records folder.
#[derive(Debug, Default)]
pub struct ChainBook {
    pub(super) records: PathBuf,
    /// By their numbers.
    pub(super) lines: Vec<ChainEntry>,
    /// Where among the lines runs were closed, by their names.
    closes: HashMap<String, usize>,
    /// The same, by the names under which they began.
    closes_of_begun: HashMap<String, usize>,
    /// Where among the lines runs began, by their names.
    pub(super) begins: HashMap<String, usize>,
    pub(super) counted: Option<Place>,
    /// What cannot be read, or stands in the wrong place.
    pub(super) broken: Vec<String>,
    /// Those of these sentences that tell of a chain or a counter that is not there or is none, each with what to do.
    pub(super) without: Vec<(String, &'static str)>,
    /// Chains and the counter, as far as they could not be read.
    pub(super) unreadable: Vec<Unread>,
    /// What a sudden end left of chains and counter.
    torn: Vec<String>,
    /// Days whose chain cannot be read: what it says is not known.
    pub(super) unread: HashSet<String>,
    /// Days with lines that cannot be read.
    broken_days: HashSet<String>,
}

/// Checks the chain from the first line to the last.
///
/// # Errors
/// The folder cannot be read.
pub fn verify(records: &Path) -> Result<ChainCheck, StoreError> {
    verify_against(records, &Against::default()).map(|(checked, _)| checked)
}

/// As [`verify`], and compares the chain with keys, and with what was kept elsewhere. Returns the chain as well.
///
/// # Errors
/// The folder cannot be read.
pub fn verify_against(records: &Path, against: &Against<'_>) -> Result<(ChainCheck, ChainBook), StoreError> {
    // Before the chain is read: a run that is closed meanwhile stands in the chain and not here.
    let closed = closed(records)?;
    let places::Strays { problems: strays, litter, notes, unread } = places::strays(records);
    let empty = empty::empty(records);
    let book = ChainBook::read(records)?;
    let mut checked = ChainCheck {
        runs: book.lines.iter().filter(|line| line.is_close()).count(),
        late: book.lines.iter().filter(|line| line.late.is_some()).count(),
        first: book.lines.first().map_or(0, |line| line.number),
        problems: strays,
        unread,
        litter,
        incomplete: book.torn.clone(),
        notes,
        signed: 0,
    };
    checked.problems.extend(book.broken.iter().cloned());
    checked.unread.extend(book.unreadable.iter().cloned());
    book.order(&mut checked.problems);
    book.beginning(against, &mut checked.problems);
    matching::check(&book, &mut checked);
    book.without_line(&closed, !against.keys.is_empty(), &mut checked);
    book.counter(&mut checked);
    book.empty_folders(&empty, &mut checked);
    checked.problems.extend(book.unlike(against.heads));
    times::check(&book, &mut checked.notes);
    signed::check(&book, against, &mut checked);
    contradictions::check(&book, &book.lines.iter().collect::<Vec<_>>(), &mut checked.problems);
    if against.keys.is_empty() {
        checked.notes.extend(contradictions::between_signed(&book));
    }
    Ok((checked, book))
}

impl ChainBook {
    /// Reads all lines as they are at one moment. Stations that write meanwhile do not wait for it, and what they write is not in it.
    ///
    /// # Errors
    /// The records folder cannot be read.
    pub fn read(records: &Path) -> Result<Self, StoreError> {
        let mut book = Self { records: records.to_owned(), ..Self::default() };
        let snapshot = Snapshot::take(records)?;
        for day in snapshot.days() {
            match snapshot.chain_of(day) {
                Err(error) => {
                    book.leave_out(error, |_| NO_CHAIN_FILE);
                    book.unread.insert(day.to_owned());
                }
                Ok(None) => {}
                Ok(Some(chain)) => {
                    let shown = gnc_text::shown_path(&chain.path);
                    book.broken.extend(match chain.edited.len() {
                        0 => None,
                        1 => Some(format!(
                            "{shown}: 1 line is as it was written but for its end: an editor saved the file; restore it from a backup"
                        )),
                        edited => Some(format!(
                            "{shown}: {edited} lines are as they were written but for their ends: an editor saved the file; restore it from a backup"
                        )),
                    });
                    book.broken.extend(match chain.broken {
                        0 => None,
                        1 => Some(format!("{shown}: 1 line does not belong to a chain")),
                        broken => Some(format!("{shown}: {broken} lines do not belong to a chain")),
                    });
                    if chain.broken > 0 {
                        book.broken_days.insert(day.to_owned());
                    }
                    // A station adds each line behind the others.
                    if chain.lines.windows(2).any(|pair| pair[1].number < pair[0].number) {
                        book.broken.push(format!(
                            "{}: the lines do not stand in the order in which a station wrote them",
                            gnc_text::shown_path(&chain.path)
                        ));
                    }
                    if chain.is_torn {
                        book.torn.push(format!(
                            "the chain of {day} ends with half a line: its station ended, or could not write; the next start removes it"
                        ));
                    }
                    let lines: Vec<ChainEntry> = chain.lines.into_iter().chain(chain.edited).collect();
                    for line in lines.iter().filter(|line| line.day() != day) {
                        book.broken.push(format!(
                            "line {} of the chain ({}): it stands in the chain of {day}",
                            line.number, line.run
                        ));
                    }
                    book.lines.extend(lines);
                }
            }
        }
        book.lines.sort_by_key(|line| line.number);
        for (at, line) in book.lines.iter().enumerate() {
            if line.is_close() {
                book.closes.entry(line.run.clone()).or_insert(at);
                book.closes_of_begun.entry(line.began_as().to_owned()).or_insert(at);
            } else {
                book.begins.entry(line.run.clone()).or_insert(at);
            }
        }
        match snapshot.counted {
            Ok(counted) => {
                if counted.is_none() && !book.lines.is_empty() {
                    book.without.push((counter_is_missing(), NO_COUNTER));
                }
                book.counted = counted;
                book.broken.extend(has_other_ends(records).then(|| {
                    format!("{COUNTER} is as it was written but for its end: an editor saved the file; restore it from a backup")
                }));
            }
            // Nothing is written there but in one step, so only a disk that lost what it had leaves this.
            Err(_) if is_blank(records) => book.torn.push(format!(
                "{COUNTER} is empty: its station ended, or could not write; the next start makes it again from the chain"
            )),
            Err(error) => book.leave_out(error, |error| if is_no_file(error) { NO_COUNTER_FILE } else { NO_COUNTER }),
        }
        Ok(book)
    }

    /// Notes why a chain or the counter is not in this book.
    fn leave_out(&mut self, error: StoreError, try_this: impl FnOnce(&StoreError) -> &'static str) {
        match Unread::of(error) {
            Ok(unread) => self.unreadable.push(unread),
            Err(error) => {
                let what = gnc_text::with_causes(&error);
                self.without.push((what.clone(), try_this(&error)));
                self.broken.push(what);
            }
        }
    }

    /// What to do, if these findings tell no more than that a chain or the counter is not there or is none.
    #[must_use]
    pub fn try_this<'a>(&self, mut findings: impl Iterator<Item = &'a String>) -> Option<&'static str> {
        let of =
            |finding: &String| self.without.iter().find(|(what, _)| what == finding).map(|(_, try_this)| *try_this);
        let first = of(findings.next()?)?;
        findings.all(|finding| of(finding).is_some()).then_some(first)
    }

    /// Whether this folder has no chain at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty() && self.counted.is_none() && self.broken.is_empty() && self.unreadable.is_empty()
    }

    /// What to say of a run with digests that began by the chain and was not closed by it: its station ended meanwhile. `None` for
    /// other runs; one that was slipped in has no line of its beginning.
    #[must_use]
    pub fn broke_off(&self, run: &Path) -> Option<String> {
        let name = name_in(&self.records, run);
        (self.begins.contains_key(&name) && self.close_of(&name).is_none()).then(|| self.closing_broke_off(&name))
    }

    /// What is wrong with a run without digests, by the lines that name it: it was closed, or its journal does not begin as it did.
    /// `None`: no line speaks against it. A run that never began has no line, and one that goes on has that of its beginning.
    #[must_use]
    pub fn unlike_an_open_run(&self, run: &Path) -> Option<String> {
        let name = name_in(&self.records, run);
        if let Some(close) = self.close_of(&name) {
            // Its station may give the files their names at this moment.
            return (!reader::is_sealed(run)).then(|| {
                format!("line {} of the chain ({name}): the run was closed, and its {DIGESTS} is missing", close.number)
            });
        }
        let began = self.lines.get(*self.begins.get(&name)?)?;
        // A journal that cannot be read was told with its run.
        matching::unlike_its_beginning(self, began).ok().flatten()
    }

    /// What is wrong with a run whose folder is held as a station holds it: no line says that it began, and a station writes that line
    /// before anything is tested. The caller has seen that the run holds more than its beginning, before this book was read.
    #[must_use]
    pub fn lacks_beginning(&self, run: &Path) -> Option<String> {
        let name = name_in(&self.records, run);
        (!self.has_begun(&name)).then(|| {
            format!(
                "{name} is held as a run that goes on, and no line of the chain says that it began: it was put there"
            )
        })
    }

    /// Whether a line says that a run began, under its name or the one under which it was moved.
    fn has_begun(&self, name: &str) -> bool {
        let run = self.records.join(name);
        let is_moved = || {
            let digest = begin::of_first_line(&self.records, &run);
            let begins = self.lines.iter().filter(|line| !line.is_close() && line.day() == day_and_time(name).0);
            digest.is_ok_and(|digest| begins.map(|line| &line.digest).any(|of_line| *of_line == digest))
        };
        self.begins.contains_key(name) || reader::is_unassigned(&run) && is_moved()
    }

    /// The line of a closed run.
    pub(super) fn close_of(&self, run: &str) -> Option<&ChainEntry> {
        self.lines.get(*self.closes.get(run)?)
    }

    /// The line of a closed run by the name under which it began.
    pub(super) fn close_of_begun(&self, run: &str) -> Option<&ChainEntry> {
        self.lines.get(*self.closes_of_begun.get(run)?)
    }

    /// Whether each line follows from the one before.
    pub(super) fn order(&self, problems: &mut Vec<String>) {
        if let Some(first) = self.lines.first()
            && first.number <= 1
            && (first.number == 0 || first.before != NOTHING)
        {
            problems.push(format!(
                "line {} of the chain ({}): it is the first one, and says that another one stood before it",
                first.number, first.run
            ));
        }
        for pair in self.lines.windows(2) {
            let (before, after) = (&pair[0], &pair[1]);
            let next = before.number.saturating_add(1);
            if after.number > next {
                // They may stand in a chain that cannot be read, which is said.
                if self.unread.is_empty() {
                    problems.push(missing_between(before, after));
                }
            } else if after.number != next || after.before != before.link {
                problems.push(format!(
                    "the chain is broken between line {} ({}) and line {} ({})",
                    before.number, before.run, after.number, after.run
                ));
            }
        }
    }

    /// Whether the lines before the first one, if there were any, are witnessed: their days were moved elsewhere, and not taken away.
    /// Who asks with nothing learns from where on the chain is there.
    fn beginning(&self, against: &Against<'_>, problems: &mut Vec<String>) {
        let asks = !against.keys.is_empty() || !against.heads.is_empty();
        let Some(first) = self.lines.first().filter(|first| asks && first.number > 1) else { return };
        // They may stand in a chain that cannot be read, which is said.
        if !self.unread.is_empty() {
            return;
        }
        if !against.heads.iter().any(|head| is_before(first, &head.place)) {
            problems.push(format!(
                "the chain begins at line {} ({}), and nothing witnesses line {} before it: the oldest runs are missing; if they were moved elsewhere, give number and link of that line with --head",
                first.number,
                first.run,
                first.number.saturating_sub(1)
            ));
        }
    }

    /// Reports closed runs without a line. Versions before the chain wrote none, so runs that are older than the first line have
    /// none, and nothing shows when they were added.
    fn without_line(&self, closed: &[(String, bool)], has_key: bool, checked: &mut ChainCheck) {
        if self.is_empty() {
            if !closed.is_empty() {
                checked.problems.push(match closed.len() {
                    1 => format!(
                        "1 run is closed, and there is no chain: {COUNTER} and all chains are missing, or a version before the chain wrote this run"
                    ),
                    runs => format!(
                        "{runs} runs are closed, and there is no chain: {COUNTER} and all chains are missing, or a version before the chain wrote these runs"
                    ),
                });
            }
            return;
        }
        // Also on the day of the first line a run may be from before it.
        let first = self.lines.first().map(|line| day_and_time(&line.run)).unwrap_or_default();
        let is_known = |name: &String| self.closes.contains_key(name) || self.unread.contains(day_and_time(name).0);
        let (later, before): (Vec<_>, Vec<_>) =
            closed.iter().filter(|(name, _)| !is_known(name)).partition(|(name, _)| day_and_time(name) >= first);
        for (name, is_held) in later {
            // A run that was slipped in has no line of its beginning.
            if self.has_begun(name) {
                // Or its station closed it when it was looked at.
                if !*is_held {
                    checked.incomplete.push(self.closing_broke_off(name));
                }
                continue;
            }
            checked.problems.push(format!(
                "{name} is not in the chain: its station ended, or could not write, before that and closes it late at its next start, or it was slipped in"
            ));
        }
        if has_key {
            checked.problems.extend(before.iter().map(|(name, _)| {
                format!(
                    "{name} is not in the chain and is older than its first line: a version before the chain wrote it, or it was slipped in"
                )
            }));
        } else if let Some((first, _)) = before.first() {
            checked.notes.push(match before.len() {
                1 => format!(
                    "1 closed run is older than the first line of the chain, so nothing shows when it was added; it is {first}"
                ),
                runs => format!(
                    "{runs} closed runs are older than the first line of the chain, so nothing shows when they were added; the first is {first}"
                ),
            });
        }
    }

    /// What to say of a run with digests that began and has no line that closed it. A start writes none where it may be one of
    /// those that cannot be read, or that are missing behind its beginning.
    fn closing_broke_off(&self, name: &str) -> String {
        if self.broken_days.contains(day_and_time(name).0) {
            return format!(
                "{name} is not in the chain: a line of its day cannot be read; restore the chain from a backup"
            );
        }
        let behind = self.begins.get(name).and_then(|at| self.lines.get(*at..)).unwrap_or_default();
        if behind.windows(2).any(|pair| pair[1].number > pair[0].number.saturating_add(1)) {
            return format!(
                "{name} is not in the chain: lines behind its beginning are missing; restore the chain from a backup"
            );
        }
        format!(
            "{name} is not in the chain: its station ended, or could not write, while it closed the run; the next start goes on"
        )
    }

    /// Compares the end of the chain with the counter.
    pub(super) fn counter(&self, checked: &mut ChainCheck) {
        let last = self.lines.last();
        let Some(counted) = &self.counted else {
            // What is there and cannot be read was said.
            if last.is_some() && self.records.join(COUNTER).try_exists().is_ok_and(|exists| !exists) {
                checked.problems.push(counter_is_missing());
            }
            return;
        };
        let ends = last.map_or(0, |last| last.number);
        if ends < counted.number && !self.unread.is_empty() {
            // Its line may stand in a chain that cannot be read, which is said.
        } else if ends < counted.number {
            checked.problems.push(format!(
                "{COUNTER} counts {} lines, but the chain ends at line {ends}: the newest runs are missing",
                counted.number
            ));
        } else if self.lines.iter().any(|line| line.number == counted.number && line.link != counted.link) {
            checked
                .problems
                .push(format!("line {} of the chain is not the one that {COUNTER} remembers", counted.number));
        } else if ends > counted.number {
            // A line counts when it is on disk, and the counter follows it.
            checked.incomplete.push(format!(
                "{COUNTER} counts {} lines, but the chain has {ends}: its station ended, or could not write, between the two; the next start mends it",
                counted.number
            ));
        }
    }

    /// What was kept elsewhere and is not what the chain says.
    #[must_use]
    pub fn unlike(&self, heads: &[Head]) -> Vec<String> {
        let mut problems = Vec::new();
        let [first, last] = [self.lines.first(), self.lines.last()].map(|line| line.map_or(0, |line| line.number));
        for Head { kept, place } in heads {
            let mut found = self.lines.iter().filter(|line| line.number == place.number);
            let number = place.number;
            match found.next() {
                Some(line) if line.link == place.link => {}
                Some(_) => problems.push(format!(
                    "line {number} of the chain is not the one that {kept} witnesses: the chain was made anew"
                )),
                // It may stand in a chain that cannot be read, which is said.
                None if !self.unread.is_empty() => {}
                // The days up to this line were moved elsewhere, and the rest follows from it.
                None if self.lines.first().is_some_and(|first| is_before(first, place)) => {}
                None if number > last => problems.push(format!(
                    "{kept} witnesses line {number}, but the chain ends at line {last}: the newest runs are missing"
                )),
                None if number < first => problems.push(format!(
                    "{kept} witnesses line {number}, which is not in this folder: the chain begins at line {first}"
                )),
                None => problems
                    .push(format!("{kept} witnesses line {number}, which is missing among the lines of the chain")),
            }
        }
        problems
    }
}

/// What to say of lines that are missing between two others.
fn missing_between(before: &ChainEntry, after: &ChainEntry) -> String {
    let (first, last) = (before.number.saturating_add(1), after.number.saturating_sub(1));
    let ((one, run), (other, its_run)) = ((before.number, &before.run), (after.number, &after.run));
    if first == last {
        format!(
            "line {first} of the chain is missing, between line {one} ({run}) and line {other} ({its_run}): a day was moved away, or the line was removed"
        )
    } else {
        format!(
            "lines {first} to {last} of the chain are missing, between line {one} ({run}) and line {other} ({its_run}): a day was moved away, or lines were removed"
        )
    }
}

/// Whether a line says that it follows the one at this place.
fn is_before(line: &ChainEntry, place: &Place) -> bool {
    line.number.checked_sub(1) == Some(place.number) && line.before == place.link
}

fn counter_is_missing() -> String {
    format!("{COUNTER} is missing, so the number of runs is not known")
}

/// Whether what stands there is no file: a folder, a link, a pipe.
fn is_no_file(error: &StoreError) -> bool {
    matches!(error, StoreError::File { source, .. } if gnc_files::is_refused(source).is_some())
}

/// Whether the line of the counter ends as an editor of Windows ends it.
fn has_other_ends(records: &Path) -> bool {
    let bytes = gnc_files::read_below(records, Path::new(COUNTER), MAX_COUNTER_BYTES);
    bytes.is_ok_and(|bytes| bytes.contains(&b'\r'))
}

/// Whether the counter is empty, or holds zeros alone.
fn is_blank(records: &Path) -> bool {
    let bytes = gnc_files::read_below(records, Path::new(COUNTER), MAX_COUNTER_BYTES);
    bytes.is_ok_and(|bytes| bytes.iter().all(|byte| *byte == 0 || byte.is_ascii_whitespace()))
}

/// `DATE/SERIAL/TIME-PLAN` of all runs with digests, each with whether its folder is held: a station may be closing it.
fn closed(records: &Path) -> Result<Vec<(String, bool)>, StoreError> {
    let closed = reader::paths(records)?.into_iter().filter(|run| reader::is_sealed(run));
    Ok(closed.map(|run| (name_in(records, &run), goes_on(&run))).collect())
}
