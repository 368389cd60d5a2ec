//! `gnc-station records`: lists, shows and verifies runs.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_executive::event::BenchKind;
use gnc_executive::record::RunRecord;
use gnc_executive::text;
use gnc_records::store::{PublicKey, StationKey, StoreError, chain, reader};
use gnc_text::printable;

use crate::args::RecordsCommand;
use crate::refusal::{CommandRefusal, complain, refuse};

/// Exit code of a verification that found something.
const NOT_AS_WRITTEN: u8 = 1;

pub(crate) fn run(what: &RecordsCommand, records: &Path) -> ExitCode {
    let done = match what {
        RecordsCommand::List => list(records),
        RecordsCommand::Show { run } => resolve(records, run).map(|folders| match folders.last() {
            Some(newest) => show(newest),
            None => no_such(run),
        }),
        RecordsCommand::Verify { runs, key } => match key.as_deref().map(PublicKey::read).transpose() {
            Ok(key) => verify(records, runs, key.as_ref()),
            Err(error) => return refuse(gnc_text::with_causes(&error), error.try_this()),
        },
        RecordsCommand::Key { file } => return make_key(file),
    };
    done.unwrap_or_else(|error| refuse(gnc_text::with_causes(&error), error.try_this()))
}

fn make_key(file: &Path) -> ExitCode {
    match StationKey::create(file) {
        Ok(public) => {
            let mut out = std::io::stdout().lock();
            let _ = writeln!(
                out,
                "{}: name this private key as key under [station] in the bench file, and keep it secret",
                file.display()
            );
            let _ = writeln!(out, "{}: give this public key to the people who verify records", public.display());
            ExitCode::SUCCESS
        }
        Err(error) => refuse(gnc_text::with_causes(&error), error.try_this()),
    }
}

fn list(records: &Path) -> Result<ExitCode, StoreError> {
    let mut out = std::io::stdout().lock();
    let runs = reader::list(records)?;
    if runs.is_empty() {
        let _ = writeln!(out, "no run is recorded in {}", records.display());
    }
    for found in runs {
        let place = found.path.strip_prefix(records).unwrap_or(&found.path).display().to_string();
        let line = match &found.run {
            Ok(run) => summary(run, found.sealed),
            Err(error) => {
                let word = if error.is_newer() { "newer" } else { "unreadable" };
                format!("{word:<12}{}", printable(&gnc_text::with_causes(error)))
            }
        };
        let _ = writeln!(out, "{line}  {place}");
    }
    Ok(ExitCode::SUCCESS)
}

fn summary(run: &RunRecord, sealed: bool) -> String {
    let outcome = match run.interrupted {
        true => "interrupted",
        false if !sealed => "unsealed",
        false => run.outcome.as_str(),
    };
    let mut remarks = String::new();
    if run.selection.is_some() {
        remarks.push_str(" selection");
    }
    if run.other_module.is_some() {
        remarks.push_str(" other module");
    }
    if run.bench.kind == BenchKind::Simulated {
        remarks.push_str(" simulated");
    }
    let serial_number = printable(&run.serial_number);
    format!("{outcome:<12}{}  {serial_number:<16} {:<12}{remarks:<20}", run.started.format("%F %T"), run.plan.name)
}

fn show(folder: &Path) -> ExitCode {
    match reader::read(folder) {
        Ok(run) => {
            let _ = std::io::stdout().write_all(text::log_txt(&run).as_bytes());
            ExitCode::SUCCESS
        }
        Err(error) => refuse(gnc_text::with_causes(&error), error.try_this()),
    }
}

fn verify(records: &Path, runs: &[PathBuf], key: Option<&PublicKey>) -> Result<ExitCode, StoreError> {
    let folders: Vec<PathBuf> = if runs.is_empty() {
        reader::list(records)?.into_iter().map(|found| found.path).collect()
    } else {
        let mut folders = Vec::new();
        for run in runs {
            let named = resolve(records, run)?;
            if named.is_empty() {
                return Ok(no_such(run));
            }
            folders.extend(named);
        }
        folders
    };
    let (mut bad, mut newer) = (0, 0);
    let mut out = std::io::stdout().lock();
    for folder in &folders {
        let mut found = reader::check(folder);
        found.problems.extend(key.and_then(|key| reader::verify_signature(folder, key)));
        let (whole, place) = (found.problems.is_empty(), folder.display());
        let _ = match &found.newer {
            Some(why) if whole => {
                writeln!(out, "{place}: {why}: its digests agree, but this version cannot compare its journal")
            }
            Some(why) => writeln!(out, "{place}: {why}"),
            None if whole => writeln!(out, "{place}: as written"),
            None => Ok(()),
        };
        for problem in &found.problems {
            let _ = writeln!(out, "{place}: {}", printable(problem));
        }
        bad += usize::from(!whole);
        newer += usize::from(whole && found.newer.is_some());
    }
    let _ = writeln!(out, "{} of {} runs are as written", folders.len() - bad - newer, folders.len());
    if runs.is_empty() {
        bad += along_the_chain(records, &mut out)?;
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
    Ok(ExitCode::SUCCESS)
}

/// Prints what the chain of closed runs shows, and returns the number of its problems.
fn along_the_chain(records: &Path, out: &mut impl std::io::Write) -> Result<usize, StoreError> {
    let chain::ChainCheck { runs, first, problems } = chain::verify(records)?;
    if problems.is_empty() && runs > 0 {
        let elsewhere = if first > 1 {
            format!(" from run {first} on; earlier runs are not in this folder")
        } else {
            String::new()
        };
        let _ = writeln!(out, "the chain of {runs} closed runs is whole{elsewhere}");
    }
    for problem in &problems {
        let _ = writeln!(out, "chain: {}", printable(problem));
    }
    Ok(problems.len())
}

/// The runs that the user named, oldest first: by a folder, from here or below the records folder, or by a serial
/// number.
pub(crate) fn resolve(records: &Path, named: &Path) -> Result<Vec<PathBuf>, StoreError> {
    if let Some(folder) = [named.to_owned(), records.join(named)].into_iter().find(|folder| reader::is_run(folder)) {
        return Ok(vec![folder]);
    }
    let of_module = |found: &reader::FoundRun| named.to_str().is_some_and(|named| found.is_of(named));
    Ok(reader::list(records)?.into_iter().filter(of_module).map(|found| found.path).collect())
}

/// The one run that the user named.
///
/// # Errors
/// Returns the exit code, after a message to the user: no run has this name, several have it, or the records cannot be
/// read.
pub(crate) fn one(records: &Path, named: &Path) -> Result<PathBuf, ExitCode> {
    match resolve(records, named) {
        Err(error) => Err(refuse(gnc_text::with_causes(&error), error.try_this())),
        Ok(mut runs) if runs.len() <= 1 => runs.pop().ok_or_else(|| no_such(named)),
        Ok(runs) => {
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
    let mut runs = resolve(records, named)
        .map_err(|error| CommandRefusal::new(gnc_text::with_causes(&error), error.try_this()))?;
    let shown = gnc_text::quoted(&named.to_string_lossy());
    let what = match runs.len() {
        0 => format!("there is no run {shown}"),
        1 => return Ok(runs.remove(0)),
        more => format!("{shown} names {more} runs"),
    };
    Err(CommandRefusal::new(what, "name one by its folder; `gnc-station records list` shows them"))
}

pub(crate) fn no_such(named: &Path) -> ExitCode {
    let what = format!("there is no run {}", printable(&named.to_string_lossy()));
    refuse(what, "name a run's folder or a serial number; `gnc-station records list` shows the runs")
}
