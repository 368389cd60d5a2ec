//! `gnc-station records`: a look at what was tested.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_executive::event::BenchKind;
use gnc_executive::printable::printable;
use gnc_executive::record::RunRecord;
use gnc_executive::text;

use crate::cli::{RecordsCommand, complain, refuse};
use crate::store::{StoreError, reader};

/// Exit code of a verification that found something.
const NOT_AS_WRITTEN: u8 = 1;

pub(crate) fn run(what: &RecordsCommand, records: &Path) -> ExitCode {
    let done = match what {
        RecordsCommand::List => list(records),
        RecordsCommand::Show { run } => return show(&resolve(records, run)),
        RecordsCommand::Verify { runs } => verify(records, runs),
    };
    done.unwrap_or_else(|error| refuse(crate::runner::chain(&error), error.try_this()))
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
            Err(why) => format!("{:<12}{}", "unreadable", printable(why)),
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
        Err(why) => refuse(why, "`gnc-station records list` shows the runs that are there"),
    }
}

fn verify(records: &Path, runs: &[PathBuf]) -> Result<ExitCode, StoreError> {
    let folders: Vec<PathBuf> = if runs.is_empty() {
        reader::list(records)?.into_iter().map(|found| found.path).collect()
    } else {
        runs.iter().map(|run| resolve(records, run)).collect()
    };
    let mut bad = 0;
    let mut out = std::io::stdout().lock();
    for folder in &folders {
        let problems = reader::verify(folder);
        if problems.is_empty() {
            let _ = writeln!(out, "{}: as written", folder.display());
        } else {
            bad += 1;
            for problem in problems {
                let _ = writeln!(out, "{}: {}", folder.display(), printable(&problem));
            }
        }
    }
    let _ = writeln!(out, "{} of {} runs are as written", folders.len() - bad, folders.len());
    if bad > 0 {
        let try_this = "run the module again where a run was interrupted; restore what was changed from a backup";
        complain(format_args!("{bad} of the runs prove nothing"), try_this);
        return Ok(ExitCode::from(NOT_AS_WRITTEN));
    }
    Ok(ExitCode::SUCCESS)
}

/// A run's folder as the user named it: from here, or below the records folder.
pub(crate) fn resolve(records: &Path, run: &Path) -> PathBuf {
    if run.exists() { run.to_owned() } else { records.join(run) }
}
