//! `gnc-station records`: lists, shows and verifies runs.

mod list;
mod place;
mod verify;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_executive::record::RunRecord;
use gnc_executive::standing::Seal;
use gnc_executive::text;
use gnc_records::standing::{Face, Seals};
use gnc_records::store::chain::LateCloses;
use gnc_records::store::digest::FileDigests;
use gnc_records::store::located::located;
use gnc_records::store::reader::{self, FoundRun, Wanted};
use gnc_records::store::{JOURNAL, StationKey, StoreError, chain, goes_on};
use gnc_text::{exact, printable};

use crate::args::{RecordsCommand, RunArgs};
use crate::outputs::may_write;
use crate::progress::Progress;
use crate::refusal::{CommandRefusal, complain, refuse};
use crate::wording::{Lines, Wording, padded};
pub(crate) use place::RecordsArgs;
use place::RecordsPlace;
pub(crate) use verify::check_one;

pub(crate) fn run(what: &RecordsCommand, records: &RecordsArgs) -> ExitCode {
    let done = match what {
        RecordsCommand::List(args) => records.find().map(|place| list::list(&place, args)),
        RecordsCommand::Show { run } => {
            let progress = Progress::begin("the run is read");
            resolve_in(records, run).map(|(folders, place)| match folders.last() {
                Some(newest) => show(newest, progress),
                None => no_such(run, place.as_ref()),
            })
        }
        RecordsCommand::Verify { runs, key, counter, head } => verify::run(records, runs, key, counter, head),
        RecordsCommand::Key { file } => return make_key(file),
    };
    done.unwrap_or_else(|refusal| refuse(refusal.what, &refusal.try_this))
}

fn make_key(file: &Path) -> ExitCode {
    if let Err(refused) = may_write(file, "FILE") {
        return refuse(refused.what, &refused.try_this);
    }
    match StationKey::create(file) {
        Ok(public) => {
            let mut out = Lines::to_stdout();
            out.say(format_args!(
                "{}: name this private key as key under [station] in the bench file, and keep it secret",
                gnc_text::shown_path(file)
            ));
            out.say(format_args!(
                "{}: give this public key to the people who verify records",
                gnc_text::shown_path(&public)
            ));
            ExitCode::SUCCESS
        }
        Err(error) => refuse(gnc_text::with_causes(&error), error.try_this()),
    }
}

/// The line of a run, with the word for its outcome or state, and how its record is kept.
fn summary(wording: &Wording, word: &str, run: &RunRecord, kept: Seal) -> String {
    let mut remarks = text::caveats(run);
    if let Seal::Flawed(flaw) = kept {
        remarks.push(flaw.words().unwrap_or_default());
    }
    let remarks: String = remarks.iter().map(|remark| format!(" {}", wording.text(remark))).collect();
    let word = state(wording, word);
    let (serial_number, plan) = (exact(&run.serial_number), exact(&run.plan.name));
    let (serial_number, plan, remarks) = (padded(&serial_number, 16), padded(&plan, 12), padded(&remarks, 20));
    format!("{word}{}  {serial_number} {plan}{remarks}", run.started.format("%F %T"))
}

/// The word of a list for an outcome or a state, as wide as its column.
fn state(wording: &Wording, word: &str) -> String {
    padded(&wording.text(word), 11) + " "
}

fn show(folder: &Path, progress: Progress) -> ExitCode {
    match reader::read(folder) {
        Ok(run) => {
            let mut out = Lines::to_stdout();
            out.wording.keep_names_of(&run);
            // The journal cannot tell it. Who wants to know why the chain cannot be read verifies the run.
            let late = LateCloses::default().of(folder).ok().flatten();
            let lacks = || LateCloses::default().lacks(folder).is_ok_and(|lacks| lacks);
            let is_closed = run.interrupted || goes_on(folder) || reader::is_sealed(folder) && !lacks();
            let face = face(folder, &run);
            let is_changed = face == Some(Face::Changed);
            let is_proved = late.is_none()
                && is_closed
                && !is_changed
                && !matches!(face, Some(Face::NotInChain(_) | Face::Unreadable));
            let run = if is_proved { run } else { run.not_closed() };
            let place = chain::place_of(folder).ok().flatten();
            let digest = FileDigests::read(folder).ok().map(|(sums, _)| sums.of_record());
            // No line of it comes between those of the run.
            drop(progress);
            if is_changed {
                out.say("CHANGED: this record is not as it was closed and nothing that it says is proved");
                out.say("");
            }
            if let Some(late) = &late {
                out.say(format_args!("CLOSED LATE: {}\n", printable(&late.in_words())));
            }
            out.say(text::log_txt(&run).trim_end_matches('\n'));
            if let Some(late) = &late {
                out.say(format_args!("\nCLOSED LATE: {}", printable(&late.in_words())));
            }
            if is_changed {
                out.say("");
                out.say("CHANGED: this record is not as it was closed and nothing that it says is proved");
            } else if is_closed && matches!(face, Some(Face::NotInChain(_))) {
                out.say("");
                out.say("NOT IN THE CHAIN: nothing proves that this record is as it was closed");
            }
            if !is_closed && !is_changed {
                out.say("");
                out.say("NOT CLOSED: its station ended, or could not write, before the run was in the chain; it is not a pass");
            }
            if let Some(place) = place {
                out.say(format_args!("\nChain: {place}"));
            }
            if let Some(digest) = digest {
                out.say(format_args!("Record: SHA-256 {digest}"));
            }
            ExitCode::SUCCESS
        }
        Err(error) => {
            drop(progress);
            refuse(gnc_text::with_causes(&error), error.try_this())
        }
    }
}

/// The word of a list for a run.
#[cfg(test)]
pub(crate) fn listed(records: &Path, run: &Path) -> &'static str {
    let found = reader::list(records).expect("records").into_iter().find(|found| found.path == run).expect("the run");
    list::word_of(&found, &mut Seals::new(records))
}

/// What a run is called, however its folder is named; `None` if its chain cannot be read.
pub(crate) fn face(folder: &Path, run: &RunRecord) -> Option<Face> {
    let path = located(folder).ok()?;
    let sealed = reader::is_sealed(&path);
    let running = !sealed && goes_on(&path);
    let records = path.ancestors().nth(3)?.to_owned();
    let found = FoundRun { path, run: Ok(run.clone()), sealed, running };
    Seals::new(&records).face(&found).ok()
}

/// The runs that the user named, oldest first: by a folder, from here or below the records folder, or by a serial
/// number.
pub(crate) fn resolve(records: &Path, named: &Path) -> Result<Vec<PathBuf>, StoreError> {
    if let Some(folder) = [named.to_owned(), records.join(named)].into_iter().find(|folder| reader::is_run(folder)) {
        return Ok(vec![folder]);
    }
    let Some(serial_number) = named.to_str() else { return Ok(Vec::new()) };
    let wanted = Wanted { serial_number: Some(serial_number), ..Wanted::default() };
    let runs: Vec<PathBuf> = reader::wanted(records, wanted)?.map(|found| found.path).collect();
    // What cannot be read is not called missing.
    match reader::unread(records, wanted)?.pop() {
        Some(error) if runs.is_empty() => Err(error),
        _ => Ok(runs),
    }
}

/// The runs that the user named, and the records folder in which they were looked for. A path to a run needs no such
/// folder, and no bench file.
fn resolve_in(records: &RecordsArgs, named: &Path) -> Result<(Vec<PathBuf>, Option<RecordsPlace>), CommandRefusal> {
    if reader::is_run(named) {
        return Ok((vec![named.to_owned()], None));
    }
    let place = records.find()?;
    let runs = resolve(&place.path, named).map_err(|error| store_refusal(&error))?;
    Ok((runs, Some(place)))
}

fn store_refusal(error: &StoreError) -> CommandRefusal {
    CommandRefusal::new(gnc_text::with_causes(error), error.try_this())
}

/// The one run that the user named.
///
/// # Errors
/// Returns the exit code, after a message to the user: no run has this name, several have it, or the records cannot be
/// read.
pub(crate) fn one(records: &RecordsArgs, named: &Path) -> Result<PathBuf, ExitCode> {
    match resolve_in(records, named) {
        Err(refusal) => Err(refuse(refusal.what, &refusal.try_this)),
        Ok((mut runs, place)) if runs.len() <= 1 => runs.pop().ok_or_else(|| no_such(named, place.as_ref())),
        Ok((runs, _)) => {
            let what = format!("there are {} runs of {}", runs.len(), printable(&named.to_string_lossy()));
            Err(refuse(what, "name one by its folder; `gnc-station records list` shows them"))
        }
    }
}

/// The one run to take up again.
///
/// # Errors
/// No run has this name, several have it, or the folder cannot be read.
pub(crate) fn to_resume(records: &Path, named: &Path) -> Result<PathBuf, CommandRefusal> {
    let mut runs = resolve(records, named).map_err(|error| store_refusal(&error))?;
    let shown = gnc_text::quoted(&named.to_string_lossy());
    let what = match runs.len() {
        0 => format!("there is no run {shown}"),
        1 => return Ok(runs.remove(0)),
        more => format!("{shown} names {more} runs"),
    };
    Err(CommandRefusal::new(what, "name one by its folder; `gnc-station records list` shows them"))
}

/// Journal of a run on whose events the work takes much memory, bytes. A journal of 106 MB takes 0.95 GB.
const LARGE_JOURNAL: u64 = 100_000_000;

/// Says that the work on a run may take much memory.
pub(crate) fn tell_size(folder: &Path) {
    let bytes = folder.join(JOURNAL).metadata().map_or(0, |journal| journal.len());
    if bytes > LARGE_JOURNAL {
        complain(
            format_args!(
                "the journal of this run has {} MB and the work on it may take more than 1 GB of memory",
                bytes / 1_000_000
            ),
            "take a computer with more memory if this one has less",
        );
    }
}

/// Whether the run to take up again is of this module. An earlier version took numbers with signs that are refused today, and its
/// interrupted runs can be taken up all the same.
pub(crate) fn resumes(records: &Path, named: &Path, serial_number: &str) -> bool {
    let run = to_resume(records, named).ok().and_then(|folder| reader::read(&folder).ok());
    run.is_some_and(|run| run.serial_number == serial_number)
}

/// Whether the command line takes up a run of this module.
pub(crate) fn is_resumed(args: &RunArgs, serial_number: &str) -> bool {
    args.resume.as_deref().is_some_and(|run| resumes(&crate::setup::records_folder(args), run, serial_number))
}

fn no_such(named: &Path, place: Option<&RecordsPlace>) -> ExitCode {
    let within = place.map(|place| format!(" in {}", place.in_words())).unwrap_or_default();
    let what = format!("there is no run {}{within}", printable(&named.to_string_lossy()));
    refuse(what, "name a run's folder or a serial number; `gnc-station records list` shows the runs")
}
