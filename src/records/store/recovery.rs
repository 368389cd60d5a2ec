//! What a start does about what an earlier one left: a kill, a power cut or a disk error may have come at any place of a run
//! and of its closing. It mends the chain, takes away folders of runs that never began, seals interrupted runs, and closes late
//! those that ended. Each thing is said in a line, also what it leaves ([`super::staying`]).

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use chrono::{DateTime, FixedOffset};
use gnc_executive::event::{BenchKind, ProgramVersion};
use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;

use super::begun::was_never_begun;
use super::captured;
use super::chain::{self, Before, Beginning, Begun, ChainStanding, Scribe, SignedBy};
use super::closing::{clear_away, close, named_early};
use super::contents::{Contents, PlanFiles};
use super::cut_off::{self, CutOffFile};
use super::late::{self, Closed};
use super::lock::{Holder, holder};
use super::reader::ReadError;
use super::staying::{IS_READ, StayingRuns, Stays, cannot, lost_its_journal, not_closed};
use super::{
    DIGESTS, JOURNAL, RunFolder, SIGNATURE, StationKey, StoreError, as_written, folder, goes_on, on, pending, reader,
};

/// Number of newest runs that are searched for interrupted ones: a station that died starts again before a thousand
/// other runs.
const LOOKED_AT: usize = 1000;

/// Longest time that a start seals runs. A person waits for it with a module in the socket.
const SEAL_FOR: Duration = Duration::from_secs(10);

/// The time that a start has for runs of earlier ones.
pub(super) struct Until {
    at: Instant,
    /// Runs for which it had none.
    left: usize,
}

impl Until {
    fn new(time: Duration) -> Self {
        Self { at: Instant::now() + time, left: 0 }
    }

    /// Whether there is time for one more run; counts those that are left for the next start.
    pub(super) fn has_time(&mut self) -> bool {
        let has_time = Instant::now() < self.at;
        self.left += usize::from(!has_time);
        has_time
    }
}

/// Who closes what an earlier start left behind, and when.
#[derive(Debug, Clone, Copy)]
pub struct Sealer<'a> {
    /// The station. It closes only what a station of this name left.
    pub station: &'a str,
    /// Its bench. What was left on a simulated bench is closed from one, and the same of the others.
    pub kind: BenchKind,
    /// The program.
    pub program: &'a ProgramVersion,
    /// The time by the clock of the computer.
    pub at: DateTime<FixedOffset>,
    /// Signs what is closed.
    pub key: Option<&'a StationKey>,
}

impl Sealer<'_> {
    /// Writes lines of the chain.
    pub(super) fn scribe(&self) -> Scribe<'_> {
        Scribe { station: self.station, at: self.at, key: self.key, late: None }
    }
}

/// Seals the interrupted runs, and closes late the runs of this station that ended and missed the chain. Returns a line
/// about each.
#[must_use]
pub fn seal_interrupted(records: &Path, sealer: &Sealer<'_>) -> Vec<String> {
    seal_within(records, sealer, SEAL_FOR)
}

fn seal_within(records: &Path, sealer: &Sealer<'_>, time: Duration) -> Vec<String> {
    // The first run of a station creates the folder.
    if !records.exists() {
        return Vec::new();
    }
    let mut lines = match chain::mend(records) {
        Ok(lines) => lines,
        Err(error) => {
            let why = gnc_text::with_causes(&error);
            return vec![format!("the chain of closed runs cannot be mended: {why}; {}", error.try_this())];
        }
    };
    let (never_begun, mut runs): (Vec<_>, Vec<_>) =
        reader::newest(records, LOOKED_AT).partition(|run| was_never_begun(run));
    let name = |run: &Path| gnc_text::shown_path(run.strip_prefix(records).unwrap_or(run)).to_string();
    let mut staying = StayingRuns::default();
    runs.retain(|run| {
        let has_journal = run.join(JOURNAL).is_file();
        if !has_journal && began_and_is_open(run) {
            staying.add_line(not_closed(&name(run), lost_its_journal()));
        }
        has_journal
    });
    runs.reverse();
    for run in &never_begun {
        match take_away(records, run) {
            Some(Taken::Away(line)) => lines.push(line),
            Some(Taken::Not(line)) => staying.add_line(line),
            None => {}
        }
    }
    chain::remove_empty(records);
    let (closed, open): (Vec<_>, Vec<_>) = runs.into_iter().partition(|run| run.join(DIGESTS).exists());
    let sealed_before = closed.len();
    let waiting: Vec<_> = closed.iter().filter(|run| !pending::waiting(run).is_empty()).cloned().collect();
    lines.extend(waiting.iter().filter_map(|run| match name_files(run, &name(run)) {
        Ok(what) => what,
        Err(error) => Some(format!(
            "{} was closed, and its files cannot get their names: {}; {}",
            name(run),
            gnc_text::with_causes(&error),
            error.try_this()
        )),
    }));
    // The chain as it is before this start writes into it.
    let known = chain::unknown(records, closed).and_then(|unknown| {
        let is_any = !unknown.is_empty() || !open.is_empty();
        Ok((unknown, if is_any { Some(Before::read(records)?) } else { None }))
    });
    let (unknown, before) = match known {
        Ok((unknown, Some(before))) => (unknown, before),
        Ok((_, None)) => {
            lines.extend(staying.into_lines(sealer.station));
            return lines;
        }
        Err(error) => {
            lines.push(format!("the interrupted runs {}", cannot(&error)));
            lines.extend(staying.into_lines(sealer.station));
            return lines;
        }
    };
    let mut until = Until::new(time);
    let mut ended = Vec::new();
    // Those without an end come first: of sealed ones without a line there may be many, from before the chain.
    for run in sure(records, open, &before, &mut lines).into_iter().filter(|_| until.has_time()) {
        let early = named_early(&run);
        match seal(records, &run, &before, sealer) {
            Ok(Left::Sealed((what, now))) => {
                lines.push(format!("{} {what}", name(&run)));
                lines.extend(of_early(records, &now, &early));
                lines.extend(strangers(records, &now));
            }
            Ok(Left::Ended) => ended.push(run),
            Ok(Left::Open(stays)) => {
                staying.add(name(&run), stays, |run, why| format!("{run} was interrupted and {why}"));
            }
            Ok(Left::Alone) => {}
            Err(error) => lines.push(format!("{} was interrupted and {}", name(&run), cannot(&error))),
        }
    }
    for run in sure(records, unknown, &before, &mut lines).into_iter().filter(|_| until.has_time()) {
        match put_into_chain(records, &run, &before, sealer) {
            Ok(Left::Sealed(())) => {
                lines.push(format!(
                    "{} was interrupted while the station sealed it; the sealing is complete now",
                    name(&run)
                ));
                lines.extend(strangers(records, &run));
            }
            Ok(Left::Ended) => ended.push(run),
            Ok(Left::Open(stays)) => staying.add(name(&run), stays, |run, why| {
                format!("{run} was interrupted while the station sealed it and {why}")
            }),
            Ok(Left::Alone) => {}
            Err(error) => {
                lines.push(format!(
                    "{} was interrupted while the station sealed it and {}",
                    name(&run),
                    cannot(&error)
                ));
            }
        }
    }
    let others = sealed_before + ended.iter().filter(|run| !reader::is_sealed(run)).count();
    lines.extend(late::without_chain(&mut ended, &before, name));
    for (run, closed) in late::close(records, ended, &before, others, sealer, &mut until) {
        match closed {
            Ok(Closed::Late(late)) => {
                lines.push(format!("{} {}", name(&run), late.what));
                lines.extend(of_early(records, &late.now, &late.early));
                lines.extend(strangers(records, &late.now));
            }
            Ok(Closed::Open(stays)) => {
                staying.add(name(&run), stays, |run, why| format!("{run} ended, was not closed and {why}"));
            }
            Err(error) => lines.push(format!("{} ended, was not closed and {}", name(&run), cannot(&error))),
        }
    }
    lines.extend(staying.into_lines(sealer.station));
    if until.left > 0 {
        lines.push(format!(
            "{} runs more have no end or were not closed, and this start has no time for them; each next start goes on with them",
            until.left
        ));
    }
    lines
}

/// The runs that the chain lacks for sure. Says once why others are left; of a run that goes on there is nothing to say.
fn sure(records: &Path, mut runs: Vec<PathBuf>, before: &Before, lines: &mut Vec<String>) -> Vec<PathBuf> {
    runs.retain(|run| {
        let why = before.unsure_of(records, run);
        let is_sure = why.is_none();
        lines.extend(why.filter(|why| !lines.contains(why) && !goes_on(run)));
        is_sure
    });
    runs
}

/// What to say of files in the folder of a run that was closed now and that no station wrote.
fn strangers(records: &Path, run: &Path) -> Option<String> {
    let (what, hint) = as_written::of_strangers(run)?;
    Some(format!("{}: {what}; {hint}", gnc_text::shown_path(run.strip_prefix(records).unwrap_or(run))))
}

/// What to say of files that had the names of those that a closing makes, and that are made anew.
fn of_early(records: &Path, run: &Path, early: &[&str]) -> Option<String> {
    let run = gnc_text::shown_path(run.strip_prefix(records).unwrap_or(run));
    (!early.is_empty()).then(|| {
        format!(
            "{run} held files that a station makes only when it closes a run ({}) and they are removed; unless an earlier version of the station left them find out who put them there",
            early.join(" ")
        )
    })
}

/// Whether a run began by the chain and no line closes it.
fn began_and_is_open(run: &Path) -> bool {
    chain::is_named(run).is_ok_and(|is_named| is_named) && chain::is_closed(run).is_ok_and(|is_closed| !is_closed)
}

/// Takes the lock of a journal, or says who has it.
pub(super) fn held(run: &Path) -> Result<Holder, StoreError> {
    let path = run.join(JOURNAL);
    let journal = on(gnc_files::own(&path), "read", &path)?;
    on(holder(journal), "lock", &path)
}

/// Gives the files of a run that is closed their names, if its station did not come so far.
fn name_files(run: &Path, name: &impl std::fmt::Display) -> Result<Option<String>, StoreError> {
    let _held = match held(run)? {
        Holder::Own(held) => held,
        Holder::Station => return Ok(None),
        Holder::Readers => return Ok(Some(format!("{name} was closed and {IS_READ}"))),
    };
    // One without a line, or with other digests than its line has, is no matter of names.
    if !chain::is_closed(run)? || !matches!(chain::standing(run)?, ChainStanding::Held | ChainStanding::Late) {
        return Ok(None);
    }
    if pending::waiting(run).is_empty() {
        return Ok(None);
    }
    let others = pending::name_left(run)?;
    Ok(Some(match others.first() {
        None => format!(
            "{name} was closed, and its station ended, or could not write, before all of its files had their names; they \
             have them now"
        ),
        Some(other) => format!(
            "{name} was closed, and its station ended, or could not write, before all of its files had their names; {other} \
             is left as it is, since it is not what the run was closed with"
        ),
    }))
}

/// What became of the folder of a run that never began.
enum Taken {
    /// It is gone: what to say.
    Away(String),
    /// It stays: what to say.
    Not(String),
}

/// Takes away the folder of a run that never began, unless a station holds it.
fn take_away(records: &Path, run: &Path) -> Option<Taken> {
    let name = gnc_text::shown_path(run.strip_prefix(records).unwrap_or(run));
    // A folder that a person made is none of a run, and a station that begins a run in it would hold its lock.
    let of_run = run.file_name().is_some_and(|name| folder::is_name_of_run(&name.to_string_lossy()));
    if !of_run {
        return None;
    }
    let _held = match File::open(run).and_then(holder) {
        Ok(Holder::Own(held)) => held,
        Ok(Holder::Readers) => return Some(Taken::Not(format!("{name} was cut off at its start and {IS_READ}"))),
        Ok(Holder::Station) => return None,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
        Err(error) => {
            return Some(Taken::Not(format!(
                "{name} was cut off at its start, and its folder cannot be removed: {error}"
            )));
        }
    };
    if !was_never_begun(run) {
        return None;
    }
    // A run that the chain names, and that lost its journal, is not taken away.
    match (chain::is_named(run), chain::is_closed(run)) {
        (Ok(false), _) => {}
        (Ok(true), Ok(false)) => {
            return Some(Taken::Not(not_closed(&name.to_string(), lost_its_journal())));
        }
        (Ok(true), Ok(true)) => return Some(Taken::Not(format!("{name} was closed and {}", lost_its_journal()))),
        (Err(error), _) | (_, Err(error)) => {
            return Some(Taken::Not(format!("{name} was cut off at its start and {}", cannot(&error))));
        }
    }
    if let Err(error) = fs::remove_dir_all(run) {
        return Some(Taken::Not(format!("{name} was cut off at its start, and its folder cannot be removed: {error}")));
    }
    // These fail where other runs are.
    let _ = run.ancestors().skip(1).take(2).map(fs::remove_dir).take_while(Result::is_ok).count();
    Some(Taken::Away(format!(
        "{name} was cut off at its start, before its first event: nothing was tested; its folder is removed"
    )))
}

/// What a start does about a run that an earlier one left.
enum Left<T> {
    /// It has sealed the run.
    Sealed(T),
    /// The run has an end, so it can only be closed late.
    Ended,
    /// The run stays as it is; says why.
    Open(Stays),
    /// The run goes on, or another station has just sealed it: there is nothing to say.
    Alone,
}

/// Appends a sealed run to the chain if a kill came between its digests and the chain. A run that ended is not appended
/// here: it may have been inserted later.
fn put_into_chain(records: &Path, run: &Path, before: &Before, by: &Sealer<'_>) -> Result<Left<()>, StoreError> {
    let _held = match held(run)? {
        Holder::Own(held) => held,
        Holder::Station => return Ok(Left::Alone),
        Holder::Readers => return Ok(Left::Open(Stays::is_read())),
    };
    let state = match with_header(run) {
        Ok(state) => state,
        Err(error) => return Ok(Left::Open(Stays::is_unreadable(run, &error))),
    };
    if !state.is_interrupted() {
        return Ok(Left::Ended);
    }
    // Another station may have appended it meanwhile.
    if chain::unknown(records, vec![run.to_owned()])?.is_empty() {
        return Ok(Left::Alone);
    }
    if let Some(stays) = Stays::is_changed(&as_written::changes(run)) {
        return Ok(Left::Open(stays));
    }
    let is_signed = match may_close(records, run, &state, before, by)? {
        Ok(began) => began.is_some_and(|began| began.is_signed()),
        Err(stays) => return Ok(Left::Open(stays)),
    };
    if let Some(why) = unlike_signature(run, is_signed, by.key) {
        return Ok(Left::Open(Stays::Because(why)));
    }
    // Digests that were not signed when they were made stay so, and their line too.
    let scribe = Scribe { key: by.key.filter(|_| as_written::is_signed(run)), ..by.scribe() };
    // An earlier version wrote no line when the run began.
    chain::begin(run, &scribe)?;
    chain::append_as(run, &scribe)?;
    // What the digests do not name was put there.
    pending::name_left(run)?;
    Ok(Left::Sealed(()))
}

/// Seals a run without an end. Returns what was done, and where the folder is now.
fn seal(records: &Path, run: &Path, before: &Before, by: &Sealer<'_>) -> Result<Left<(String, PathBuf)>, StoreError> {
    let _held = match held(run)? {
        Holder::Own(held) => held,
        Holder::Station => return Ok(Left::Alone),
        Holder::Readers => return Ok(Left::Open(Stays::is_read())),
    };
    // Another station may have sealed it meanwhile.
    if run.join(DIGESTS).exists() {
        return Ok(Left::Alone);
    }
    let state = match with_header(run) {
        Ok(state) => state,
        Err(error) => return Ok(Left::Open(Stays::is_unreadable(run, &error))),
    };
    let Some(record) = RunRecord::from_state(&state) else { return Ok(Left::Alone) };
    if !record.interrupted {
        return Ok(Left::Ended);
    }
    let is_by_other = match may_close(records, run, &state, before, by)? {
        Ok(began) => began.is_some_and(|began| began.signed_by(by.key) == SignedBy::Other),
        Err(stays) => return Ok(Left::Open(stays)),
    };
    let plan = PlanFiles::found(run, &state)?;
    clear_away(run)?;
    let folder = RunFolder::existing(run).signed_with(by.key.cloned());
    let cut_off = cut_off::complete(&folder)?.files;
    let began = chain::begin(run, &by.scribe())?;
    let mut what = captured::unlike(run)?;
    what.extend(is_by_other.then(|| "another key signed the line of its beginning".to_owned()));
    let said = in_words(&state, &record, &cut_off, &what);
    let contents = Contents { state: &Mutex::new(state), plan: &plan, cut_off: &cut_off, made: &[] };
    close(&folder, &contents, &by.scribe(), Some(&began))?;
    Ok(Left::Sealed((said, folder.path().to_owned())))
}

/// Whether a start may close a run that an earlier one left, and the line of its beginning; or why it may not. An earlier
/// version wrote no such line, and a run that was cut off before it holds no test.
pub(super) fn may_close(
    records: &Path,
    run: &Path,
    state: &RunState,
    before: &Before,
    by: &Sealer<'_>,
) -> Result<Result<Option<Begun>, Stays>, StoreError> {
    let Some(header) = state.header() else { return Ok(Ok(None)) };
    if header.station != by.station {
        return Ok(Err(Stays::OfStation(header.station.clone())));
    }
    let because = |why: &str| Ok(Err(Stays::Because(why.to_owned())));
    match (header.bench.kind == BenchKind::Simulated, by.kind == BenchKind::Simulated) {
        (true, false) => return because("is left to the next start of its station with a simulated bench"),
        (false, true) => return because("is left to the next start of its station with a bench that is not simulated"),
        _ => {}
    }
    match before.beginnings().of(records, run)? {
        Beginning::NeverWritten => Ok(Ok(None)),
        Beginning::Missing if chain::has_one_event(run)? => Ok(Ok(None)),
        Beginning::Missing => {
            because("is left as it is: no line of the chain says that it began, so a person may have put it there")
        }
        Beginning::Written(begun) => match begun.signed_by(by.key) {
            SignedBy::This => Ok(Ok(Some(*begun))),
            // The key was exchanged. Nothing of an interrupted run counts, and `--resume` asks for the key of its beginning.
            SignedBy::Other if by.key.is_some() && state.is_interrupted() => Ok(Ok(Some(*begun))),
            SignedBy::Other => {
                let station = gnc_text::printable(&header.station);
                because(&format!(
                    "is left to the station {station} with the key that signed the line of its beginning: start it once with that key"
                ))
            }
            SignedBy::None => because(
                "is left as it is: the line of its beginning is not signed, and earlier ones of its station are; a start without a key closes it",
            ),
        },
    }
}

/// The state of a run whose journal has its first event.
fn with_header(run: &Path) -> Result<RunState, ReadError> {
    reader::fold(run).and_then(|state| if state.header().is_some() { Ok(state) } else { Err(ReadError::Empty) })
}

/// Why a run with digests is left: its station would have signed them, or another key did.
pub(super) fn unlike_signature(run: &Path, is_signed: bool, key: Option<&StationKey>) -> Option<String> {
    let public: Vec<_> = key.map(StationKey::public).into_iter().collect();
    let is_like = match (as_written::is_signed(run), key) {
        (true, Some(_)) => as_written::verify_signature(run, &public).is_none(),
        (has_signature, _) => has_signature == is_signed && !has_signature,
    };
    (!is_like).then(|| format!("is left as it is: {SIGNATURE} is missing, or is not of the key of this start"))
}

fn in_words(state: &RunState, record: &RunRecord, cut_off: &[CutOffFile], unlike: &[String]) -> String {
    let running = state.rows().iter().filter(|row| row.running().is_some());
    let running: Vec<&str> = running.map(|row| row.planned.name.as_str()).collect();
    let during = if running.is_empty() { String::new() } else { format!(" during {}", running.join(", ")) };
    let last = state.last().map_or_else(String::new, |last| format!(" after {}", last.at.format("%F %T")));
    let serial_number = &record.serial_number;
    let files = cut_off.iter().map(CutOffFile::in_short).chain(unlike.iter().cloned());
    let ended: String = files.map(|file| format!("{file}; ")).collect();
    format!("was interrupted{during}{last}; {ended}it is sealed as interrupted; test {serial_number} again")
}

#[cfg(test)]
pub(super) mod tests;
