//! `gnc-station records verify`: compares runs with their digests, their journals and the chain.

use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_records::store::as_written::{self, Verified};
use gnc_records::store::chain::{Against, ChainBook, ChainCheck, Head, LateCloses, Place, verify_against};
use gnc_records::store::located::located;
use gnc_records::store::reader::{self, ReadError};
use gnc_records::store::{DIGESTS, PublicKey, Unread, may_begin};
use gnc_text::printable;

use self::findings::{Findings, PROVE_NOTHING};
use super::{RecordsArgs, no_such, resolve_in, store_refusal};
use crate::progress::Progress;
use crate::refusal::{CommandRefusal, complain, refuse};
use crate::wording::Lines;

mod findings;

/// Exit code of a verification that found something.
const NOT_AS_WRITTEN: u8 = 1;

/// Exit code of a verification that found no change, but what a sudden end left: the next start mends it.
const INCOMPLETE: u8 = 3;

/// What to say of a closed run that was copied alone, or whose chain was taken away.
const NO_CHAIN: &str = "no chain stands beside it: its number, time and place are not proved";

/// What to say of a closed run that was copied alone, if the key signed its digests.
const SIGNED_ALONE: &str = "the key signed its files; no chain stands beside it: its number and its place are not proved, and nothing shows what came after it";

/// Longest copy of `COUNTER` that is read: it is one line, and people may have written beside it.
const MAX_COUNTER_BYTES: u64 = 4096;

/// Verifies the named runs, or all, with public keys and what was kept elsewhere.
pub(super) fn run(
    records: &RecordsArgs,
    runs: &[PathBuf],
    keys: &[PathBuf],
    counters: &[PathBuf],
    heads: &[String],
) -> Result<ExitCode, CommandRefusal> {
    let read = |key: &PathBuf| {
        PublicKey::read(key).map_err(|error| CommandRefusal::new(gnc_text::with_causes(&error), error.try_this()))
    };
    let keys = keys.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let copies = counters.iter().map(|file| copy_of_counter(file));
    // A person types it from paper.
    let papers = heads.iter().map(|text| head(&text.to_ascii_lowercase(), "--head"));
    let heads = copies.chain(papers).collect::<Result<Vec<_>, _>>()?;
    verify(records, runs, &Against { keys: &keys, heads: &heads })
}

/// What a copy of `COUNTER` says.
fn copy_of_counter(file: &Path) -> Result<Head, CommandRefusal> {
    let shown = gnc_text::shown_path(file);
    let text = gnc_files::text(file, MAX_COUNTER_BYTES).map_err(|error| {
        CommandRefusal::new(format!("cannot read {}: {error}", printable(&shown)), "name a copy of COUNTER")
    })?;
    head(&text, &shown)
}

fn head(text: &str, kept: &str) -> Result<Head, CommandRefusal> {
    let place = Place::parse(text.trim()).ok_or_else(|| {
        CommandRefusal::new(
            format!("{} does not hold the number and link of a line: {}", printable(kept), gnc_text::quoted(text)),
            "write the number, a space and the 64 digits of the link, as report, passport and COUNTER have them",
        )
    })?;
    Ok(Head { kept: kept.to_owned(), place })
}

/// The chain of the records folder in which a run stands. It is read anew only for another folder.
#[derive(Default)]
struct Books {
    book: Option<(PathBuf, ChainBook)>,
}

impl Books {
    fn of(&mut self, run: &Path) -> Option<(PathBuf, &ChainBook)> {
        let run = located(run).ok()?;
        let records = run.ancestors().nth(3)?.to_owned();
        if self.book.as_ref().is_none_or(|(known, _)| *known != records) {
            // What is no records folder has no chain.
            let book = ChainBook::read(&records).unwrap_or_default();
            self.book = Some((records, book));
        }
        self.book.as_ref().map(|(_, book)| (run, book))
    }
}

/// What could not be read. Each file and folder is told once, and nothing of what stands below.
#[derive(Default)]
struct UnreadTold {
    told: HashSet<PathBuf>,
    /// Runs in which something could not be read, and nothing else was found.
    runs: usize,
    lacks_rights: bool,
}

impl UnreadTold {
    /// `true`: there is something of which nothing is known, whether it was told before or not.
    fn say<W: io::Write>(&mut self, unread: &[Unread], out: &mut Lines<W>) -> bool {
        for one in unread {
            self.lacks_rights |= one.lacks_rights;
            if !one.path.ancestors().any(|path| self.told.contains(path)) {
                self.told.insert(one.path.clone());
                out.say(printable(&one.why));
            }
        }
        !unread.is_empty()
    }

    /// What helps, if there is something.
    fn try_this(&self) -> Option<&'static str> {
        match (self.told.is_empty(), self.lacks_rights) {
            (true, _) => None,
            (false, true) => {
                Some("run it as the station's user, or give this user the right to read them; then verify again")
            }
            (false, false) => {
                Some("look at the disk, its mount and the limit of open files (`ulimit -n`); then verify again")
            }
        }
    }
}

fn verify(records: &RecordsArgs, runs: &[PathBuf], against: &Against<'_>) -> Result<ExitCode, CommandRefusal> {
    let mut out = Lines::to_stdout();
    let progress = Progress::begin("runs are compared with what was written");
    let all = if runs.is_empty() { Some(records.find()?) } else { None };
    let mut named: Vec<ChainCheck> = Vec::new();
    let folders = match &all {
        Some(place) => reader::paths(&place.path).map_err(|error| store_refusal(&error))?,
        None => {
            let mut folders = Vec::new();
            for run in runs {
                let (mut found, place) = resolve_in(records, run)?;
                if let Some((place, number)) = place.as_ref().zip(run.to_str()) {
                    found.extend(reader::moved_among(&place.path, number));
                }
                let told = place.as_ref().and_then(|place| of_named(&place.path, run));
                if found.is_empty() && told.is_none() {
                    return Ok(no_such(run, place.as_ref()));
                }
                folders.extend(found);
                named.extend(told);
            }
            folders
        }
    };
    let (mut bad, mut newer, mut running, mut never_begun, mut incomplete) = (0, 0, 0, 0, 0);
    let (mut littered, mut unproved) = (0, 0);
    let (mut bad_starts, mut cut_off) = (0, 0);
    let mut all_findings = Findings::default();
    let mut unread = UnreadTold::default();
    let mut late_closes = LateCloses::default();
    let mut books = Books::default();
    // The whole chain is told behind the runs.
    let chain = match &all {
        Some(place) => {
            // Runs are looked up by their whole paths.
            let path = place.path.canonicalize().unwrap_or_else(|_| place.path.clone());
            let (checked, book) = verify_against(&path, against).map_err(|error| store_refusal(&error))?;
            books.book = Some((path, book));
            Some(checked)
        }
        None => None,
    };
    progress.total(folders.len());
    for folder in &folders {
        progress.step(1);
        let mut found = as_written::check(folder);
        let place = gnc_text::shown_path(folder);
        let against_it = against_the_chain(folder, &found, &mut books);
        if let Some(what) = against_it.or_else(|| planted(folder, &found, &mut books)) {
            bad += 1;
            out.say_of(&place.to_string(), printable(&what));
            continue;
        }
        if found.running {
            running += 1;
            out.say(format_args!("{place}: running: its record can be verified when the run has ended"));
            continue;
        }
        if found.never_begun {
            never_begun += 1;
            if let Some(what) = books.of(folder).and_then(|(run, book)| book.unlike_a_cut_off_run(&run)) {
                bad_starts += 1;
                out.say_of(&place.to_string(), printable(&what));
            } else {
                cut_off += 1;
                out.say(format_args!("{place}: {}", ReadError::NeverBegun));
            }
            continue;
        }
        let is_unread = unread.say(&found.unread, &mut out);
        if let Some(what) = found.incomplete.take() {
            // Of what was changed as well, the next start mends nothing.
            bad += usize::from(!found.problems.is_empty());
            incomplete += usize::from(found.problems.is_empty() && !is_unread);
            unread.runs += usize::from(found.problems.is_empty() && is_unread);
            for what in [what].iter().chain(&found.problems) {
                out.say_of(&place.to_string(), printable(what));
            }
            continue;
        }
        let of_folder = found.problems.len();
        let mut unsigned = None;
        let mut began_signed = false;
        let (mut broke_off, mut of_lines) = (None, Vec::new());
        if let Some((run, book)) = books.of(folder) {
            if !against.keys.is_empty() && !as_written::is_signed(folder) {
                unsigned = book.why_unsigned(&run);
            }
            began_signed = book.began_signed(&run);
            if all.is_none() && reader::is_sealed(folder) {
                broke_off = book.broke_off(&run);
                if broke_off.is_none() {
                    let checked = book.of_run(&run, against);
                    of_lines = checked.unread;
                    found.problems.extend(checked.problems);
                }
            }
        }
        if let Some(what) = broke_off.or(found.unnamed.take()).filter(|_| found.problems.is_empty()) {
            incomplete += usize::from(!is_unread);
            unread.runs += usize::from(is_unread);
            out.say_of(&place.to_string(), printable(&what));
            continue;
        }
        if unsigned.is_none() {
            match as_written::signature(folder, against.keys) {
                Ok(problem) => found.problems.extend(problem),
                Err(signature) => of_lines.push(signature),
            }
            // A station that got its key later did not sign what it had captured before.
            let signs = if began_signed { against.keys } else { &[] };
            found.problems.extend(as_written::verify_captured(folder, signs));
        }
        // Where no run is named, the chain is told behind the runs.
        let is_alone =
            all.is_none() && reader::is_sealed(folder) && books.of(folder).is_none_or(|(_, book)| book.is_empty());
        // Each signed run got a line of the chain. One that was sent alone stands in no day, and the key signed its digests.
        let is_in_a_day = is_alone && reader::stands_in_a_day(folder);
        let is_signed = !against.keys.is_empty() && as_written::is_signed(folder);
        let lost_its_chain = is_in_a_day && is_signed;
        found.problems.extend(lost_its_chain.then(|| NO_CHAIN.to_owned()));
        let is_unread = unread.say(&of_lines, &mut out) || is_unread;
        let whole = found.problems.is_empty() && !is_unread;
        // A chain that cannot be read is told with the chain.
        let late = late_closes.of(folder).ok().flatten();
        let is_unknown = is_unread && found.problems.is_empty();
        // Of files that cannot be read it is not known whether they were changed.
        if let Some(late) = late.as_ref().filter(|_| !is_unknown) {
            let now =
                if whole { "its files are as the journal left them" } else { "its files were changed after that" };
            out.say(format_args!("{place}: {}; {now}", printable(&late.in_words())));
        }
        match &found.newer {
            Some(why) if whole => {
                out.say(format_args!("{place}: {why}: its digests agree, but this version cannot compare its journal"));
            }
            Some(why) => out.say(format_args!("{place}: {why}")),
            None if whole && late.is_none() && unsigned.is_none() => out.say(format_args!("{place}: as written")),
            None => {}
        }
        if let Some(why) = unsigned.filter(|_| whole) {
            out.say(format_args!("{place}: as written; {why}"));
        }
        if is_alone && !lost_its_chain {
            let told = if is_signed && whole { SIGNED_ALONE } else { NO_CHAIN };
            out.say_of(&place.to_string(), printable(told));
            unproved += usize::from(whole && !is_signed);
        }
        for problem in &found.problems {
            out.say_of(&place.to_string(), printable(problem));
        }
        bad += usize::from(!found.problems.is_empty());
        if let Some((_, book)) = books.of(folder).filter(|_| !found.problems.is_empty()) {
            let is_unsigned = of_folder == 0 && !as_written::is_signed(folder);
            all_findings.add(book, of_folder, &found.problems, is_unsigned);
        }
        unread.runs += usize::from(is_unknown);
        littered += usize::from(found.only_litter && !is_unread && found.problems.len() == of_folder);
        newer += usize::from(whole && found.newer.is_some());
    }
    drop(progress);
    let ended = folders.len() - running - never_begun;
    let whole = ended - bad - newer - incomplete - unread.runs;
    if let (Some(place), Some(checked)) = (&all, &chain)
        && ended + running == 0
        && checked.is_of_nothing()
    {
        return Ok(refuse(
            format_args!("there is no run to verify in {}", gnc_text::shown_path(&place.path)),
            "name the folder with --records DIR, or the bench file that names it with --bench FILE",
        ));
    }
    out.say(format_args!("{whole} of {ended} runs are as written"));
    // These are no runs.
    bad += bad_starts;
    incomplete += cut_off;
    if let Some(checked) = &chain {
        unread.say(&checked.unread, &mut out);
        bad += along_the_chain(checked, &mut out) + checked.litter.len();
        if let Some((_, book)) = &books.book {
            all_findings.add_chain(book, checked);
        }
        littered += checked.litter.len();
        incomplete += checked.incomplete.len();
    } else if let Some((_, book)) = folders.last().and_then(|folder| books.of(folder)) {
        for problem in book.unlike(against.heads) {
            bad += 1;
            out.say_of(&out.wording.text("chain"), printable(&problem));
        }
    }
    let mut told = HashSet::new();
    for checked in &named {
        unread.say(&checked.unread, &mut out);
        for what in checked.incomplete.iter().chain(&checked.problems).filter(|what| told.insert(what.as_str())) {
            out.say_of(&out.wording.text("chain"), printable(what));
        }
        for what in checked.litter.iter().chain(&checked.notes).filter(|what| told.insert(what.as_str())) {
            out.say_of(&out.wording.text("chain"), printable(what));
        }
        bad += checked.problems.len() + checked.litter.len();
        if let Some((_, book)) = &books.book {
            all_findings.add_chain(book, checked);
        }
        littered += checked.litter.len();
        incomplete += checked.incomplete.len();
    }
    let signed = chain.as_ref().map_or(0, |checked| checked.signed);
    if signed > 0 && against.keys.is_empty() {
        match records.public_key() {
            Some(key) => out.say(format_args!(
                "{signed} lines of the chain are signed, and no signature was checked: `--key {}` does it",
                gnc_text::shown_path(&key)
            )),
            None => out.say(format_args!(
                "{signed} lines of the chain are signed, and no signature was checked: give the public key with --key FILE"
            )),
        }
    }
    if bad > 0 && bad == littered {
        let try_this = "remove them, and verify again; keep file managers away from the folder, or work on a copy";
        complain("files were added that no station writes; all files that a station wrote are as they were", try_this);
        return Ok(ExitCode::from(NOT_AS_WRITTEN));
    }
    if let Some((what, try_this)) = all_findings.closing(bad) {
        complain(what, try_this);
        return Ok(ExitCode::from(NOT_AS_WRITTEN));
    }
    if bad > 0 {
        let try_this = "test the module of an interrupted run again; restore changed files from a backup";
        complain(PROVE_NOTHING, try_this);
        return Ok(ExitCode::from(NOT_AS_WRITTEN));
    }
    // A start mends nothing that it cannot read, and a change may be there.
    if let Some(try_this) = unread.try_this() {
        return Ok(refuse(
            "some of these records cannot be read, so nothing shows whether they are as they were written",
            try_this,
        ));
    }
    if incomplete > 0 {
        complain(
            "these records are incomplete: a station ended, or could not write, before they were closed",
            "start a run of that station: it mends what is left and says what; then verify again",
        );
        return Ok(ExitCode::from(INCOMPLETE));
    }
    if newer > 0 {
        let what = format!(
            "a newer version of the station wrote {newer} of these records: this version found nothing wrong, but cannot check all of them"
        );
        return Ok(refuse(what, "verify them with that version, or a later one"));
    }
    if unproved > 0 {
        return Ok(refuse(
            "the files of a run that was named agree with each other, and nothing shows that a station wrote them",
            "give the public key of its station with --key FILE, or verify the run in its records folder",
        ));
    }
    // Who verifies all runs of a station that works gets no alarm; who names a run wants to know about that one.
    if running > 0 && all.is_none() {
        let what = match running {
            1 => "1 of these runs goes on".to_owned(),
            running => format!("{running} of these runs go on"),
        };
        return Ok(refuse(what, "verify them when they have ended"));
    }
    Ok(ExitCode::SUCCESS)
}

/// A run compared with its digests, its journal and the chain. Signatures are not looked at.
pub(crate) fn check_one(run: &Path) -> Verified {
    let mut found = as_written::check(run);
    let mut books = Books::default();
    if let Some(what) = against_the_chain(run, &found, &mut books).or_else(|| planted(run, &found, &mut books)) {
        return Verified { problems: vec![what], ..Verified::default() };
    }
    let Some((run, book)) = books.of(run).filter(|(run, _)| !found.running && reader::is_sealed(run)) else {
        return found;
    };
    match book.broke_off(&run) {
        Some(what) => found.incomplete = Some(what),
        None => {
            let checked = book.of_run(&run, &Against::default());
            found.problems.extend(checked.problems);
            found.unread.extend(checked.unread);
        }
    }
    found
}

/// What the chain says of a module or a run that the user named, beside the folders that are there.
fn of_named(records: &Path, named: &Path) -> Option<ChainCheck> {
    // Runs are looked up by their whole paths.
    let path = records.canonicalize().ok()?;
    let name = located(named).ok().and_then(|whole| Some(whole.strip_prefix(&path).ok()?.to_owned()));
    let name = name.unwrap_or_else(|| named.to_owned());
    ChainBook::read(&path).ok()?.of_named(name.to_str()?.trim_end_matches('/'))
}

/// What the chain says against a run whose folder is held: a run that began has its line before it holds more than its beginning. The chain
/// is read again, since a station may have begun the run meanwhile.
fn planted(run: &Path, found: &Verified, books: &mut Books) -> Option<String> {
    if !found.running || may_begin(run) {
        return None;
    }
    let look = |books: &mut Books| books.of(run).and_then(|(run, book)| book.lacks_beginning(&run));
    look(books)?;
    books.book = None;
    look(books)
}

/// What the chain says against a run that seems to go on, to be closed by the next start, or never to have begun: it names the run as one
/// that was closed, or that began with another journal. The run is looked at again, since a station may have begun or closed it meanwhile.
fn against_the_chain(run: &Path, found: &Verified, books: &mut Books) -> Option<String> {
    // It has no digests, though something else may be wrong with it as well.
    let is_unsealed = || {
        let digests = run.join(DIGESTS).symlink_metadata();
        digests.is_err_and(|error| error.kind() == io::ErrorKind::NotFound)
    };
    let is_open = |found: &Verified| {
        found.running
            || found.never_begun
            || found.incomplete.is_some()
            || !(found.problems.is_empty() && found.unread.is_empty()) && is_unsealed()
    };
    if !is_open(found) {
        return None;
    }
    let mut look = || books.of(run).and_then(|(run, book)| book.unlike_an_open_run(&run));
    look()?;
    is_open(&as_written::check(run)).then(look).flatten()
}

/// Prints what the chain of closed runs shows, and returns the number of its problems.
fn along_the_chain<W: std::io::Write>(checked: &ChainCheck, out: &mut Lines<W>) -> usize {
    let ChainCheck { runs, first, problems, unread, incomplete, notes, late, litter, signed: _ } = checked;
    if problems.is_empty() && unread.is_empty() && incomplete.is_empty() && *runs > 0 {
        let elsewhere = if *first > 1 {
            format!(" from line {first} on; earlier lines are not in this folder")
        } else {
            String::new()
        };
        match runs {
            1 => out.say(format_args!("the chain of 1 closed run is whole{elsewhere}")),
            runs => out.say(format_args!("the chain of {runs} closed runs is whole{elsewhere}")),
        }
    }
    match late {
        0 => {}
        1 => out.say("1 run of the chain was closed late and never counts as a pass"),
        late => out.say(format_args!("{late} runs of the chain were closed late and never count as a pass")),
    }
    for said in notes.iter().chain(incomplete).chain(litter).chain(problems) {
        out.say_of(&out.wording.text("chain"), printable(said));
    }
    problems.len()
}
