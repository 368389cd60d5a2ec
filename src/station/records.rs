//! `gnc-station records`: lists, shows and verifies runs.

mod list;
mod place;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_executive::record::RunRecord;
use gnc_executive::standing::Seal;
use gnc_executive::text;
use gnc_records::store::chain::LateCloses;
use gnc_records::store::reader::{self, ReadError, Wanted};
use gnc_records::store::{PublicKey, StationKey, StoreError, chain};
use gnc_text::{exact, printable};

use crate::args::RecordsCommand;
use crate::refusal::{CommandRefusal, complain, refuse};
use crate::wording::{Lines, Wording, padded};
pub(crate) use place::RecordsArgs;
use place::RecordsPlace;

/// Exit code of a verification that found something.
const NOT_AS_WRITTEN: u8 = 1;

pub(crate) fn run(what: &RecordsCommand, records: &RecordsArgs) -> ExitCode {
    let done = match what {
        RecordsCommand::List(args) => records.find().map(|place| list::list(&place, args)),
        RecordsCommand::Show { run } => resolve_in(records, run).map(|(folders, place)| match folders.last() {
            Some(newest) => show(newest),
            None => no_such(run, place.as_ref()),
        }),
        RecordsCommand::Verify { runs, key } => match key.as_deref().map(PublicKey::read).transpose() {
            Ok(key) => verify(records, runs, key.as_ref()),
            Err(error) => return refuse(gnc_text::with_causes(&error), error.try_this()),
        },
        RecordsCommand::Key { file } => return make_key(file),
    };
    done.unwrap_or_else(|refusal| refuse(refusal.what, &refusal.try_this))
}

fn make_key(file: &Path) -> ExitCode {
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

fn show(folder: &Path) -> ExitCode {
    match reader::read(folder) {
        Ok(run) => {
            let mut out = Lines::to_stdout();
            out.wording.keep_names_of(&run);
            out.say(text::log_txt(&run).trim_end_matches('\n'));
            // The journal cannot tell it. Whoever wants to know why the chain cannot be read verifies the run.
            if let Ok(Some(late)) = LateCloses::default().of(folder) {
                out.say(format_args!("\nCLOSED LATE: {}", printable(&late.in_words())));
            }
            ExitCode::SUCCESS
        }
        Err(error) => refuse(gnc_text::with_causes(&error), error.try_this()),
    }
}

fn verify(records: &RecordsArgs, runs: &[PathBuf], key: Option<&PublicKey>) -> Result<ExitCode, CommandRefusal> {
    let mut out = Lines::to_stdout();
    let all = if runs.is_empty() { Some(records.find()?) } else { None };
    let folders = match &all {
        Some(place) => reader::paths(&place.path).map_err(|error| store_refusal(&error))?,
        None => {
            let mut folders = Vec::new();
            for run in runs {
                let (named, place) = resolve_in(records, run)?;
                if named.is_empty() {
                    return Ok(no_such(run, place.as_ref()));
                }
                folders.extend(named);
            }
            folders
        }
    };
    let (mut bad, mut newer, mut running, mut never_begun) = (0, 0, 0, 0);
    let mut late_closes = LateCloses::default();
    for folder in &folders {
        let mut found = reader::check(folder);
        let place = gnc_text::shown_path(folder);
        if found.running {
            running += 1;
            out.say(format_args!("{place}: running: its record can be verified when the run has ended"));
            continue;
        }
        if found.never_begun {
            never_begun += 1;
            out.say(format_args!("{place}: {}", ReadError::NeverBegun));
            continue;
        }
        found.problems.extend(key.and_then(|key| reader::verify_signature(folder, key)));
        let whole = found.problems.is_empty();
        let late = late_closes.of(folder).map_err(|error| store_refusal(&error))?;
        if let Some(late) = &late {
            let now =
                if whole { "its files are as the journal left them" } else { "its files were changed after that" };
            out.say(format_args!("{place}: {}; {now}", printable(&late.in_words())));
        }
        match &found.newer {
            Some(why) if whole => {
                out.say(format_args!("{place}: {why}: its digests agree, but this version cannot compare its journal"));
            }
            Some(why) => out.say(format_args!("{place}: {why}")),
            None if whole && late.is_none() => out.say(format_args!("{place}: as written")),
            None => {}
        }
        for problem in &found.problems {
            out.say_of(&place.to_string(), printable(problem));
        }
        bad += usize::from(!whole);
        newer += usize::from(whole && found.newer.is_some());
    }
    let (whole, ended) = (folders.len() - bad - newer - running - never_begun, folders.len() - running - never_begun);
    out.say(format_args!("{whole} of {ended} runs are as written"));
    if let Some(place) = &all {
        bad += along_the_chain(&place.path, &mut out).map_err(|error| store_refusal(&error))?;
    }
    if bad > 0 {
        let try_this = "test the module of an interrupted run again; restore changed files from a backup";
        complain("these records are not as they were written, so they prove nothing", try_this);
        return Ok(ExitCode::from(NOT_AS_WRITTEN));
    }
    if newer > 0 {
        let what = format!(
            "a newer version of the station wrote {newer} of these records: this version found nothing wrong, but cannot check all of them"
        );
        return Ok(refuse(what, "verify them with that version, or a later one"));
    }
    // Who verifies all runs of a station that works gets no alarm; who names a run wants to know about that one.
    if running > 0 && all.is_none() {
        return Ok(refuse(format_args!("{running} of these runs go on"), "verify them when they have ended"));
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints what the chain of closed runs shows, and returns the number of its problems.
fn along_the_chain<W: std::io::Write>(records: &Path, out: &mut Lines<W>) -> Result<usize, StoreError> {
    let chain::ChainCheck { runs, first, problems, late } = chain::verify(records)?;
    if problems.is_empty() && runs > 0 {
        let elsewhere = if first > 1 {
            format!(" from run {first} on; earlier runs are not in this folder")
        } else {
            String::new()
        };
        out.say(format_args!("the chain of {runs} closed runs is whole{elsewhere}"));
    }
    match late {
        0 => {}
        1 => out.say("1 run of the chain was closed late and never counts as a pass"),
        late => out.say(format_args!("{late} runs of the chain were closed late and never count as a pass")),
    }
    for problem in &problems {
        out.say_of(&out.wording.text("chain"), printable(problem));
    }
    Ok(problems.len())
}

/// The runs that the user named, oldest first: by a folder, from here or below the records folder, or by a serial
/// number.
pub(crate) fn resolve(records: &Path, named: &Path) -> Result<Vec<PathBuf>, StoreError> {
    if let Some(folder) = [named.to_owned(), records.join(named)].into_iter().find(|folder| reader::is_run(folder)) {
        return Ok(vec![folder]);
    }
    let Some(serial_number) = named.to_str() else { return Ok(Vec::new()) };
    let wanted = Wanted { serial_number: Some(serial_number), ..Wanted::default() };
    Ok(reader::wanted(records, wanted)?.map(|found| found.path).collect())
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

fn no_such(named: &Path, place: Option<&RecordsPlace>) -> ExitCode {
    let within = place.map(|place| format!(" in {}", place.in_words())).unwrap_or_default();
    let what = format!("there is no run {}{within}", printable(&named.to_string_lossy()));
    refuse(what, "name a run's folder or a serial number; `gnc-station records list` shows the runs")
}
