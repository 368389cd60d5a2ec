//! The records, as the screen looks through them.

use std::path::{Path, PathBuf};

use chrono::Local;
use gnc_executive::event::BenchKind;
use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;
use gnc_records::store::reader::{self, ReadError, Verified};
use gnc_text::with_causes;

use crate::tui::model::Earlier;
use crate::tui::records::{Checked, Day, MAX_RUNS, Mark, RunLine, Runs, Unopened};
use crate::tui::update::Msg;

/// Runs that are opened to learn how long a plan takes; if none of them is of it, nobody knows.
const MAX_LOOKED_AT: usize = 100;

/// Says which is the newest run of a module today.
pub(super) fn look_up(records: &Path, serial_number: String) -> Msg {
    let run = earlier(records, &serial_number);
    Msg::Earlier { serial_number, run }
}

/// The newest run of a module today.
pub(super) fn earlier(records: &Path, serial_number: &str) -> Option<Earlier> {
    let today = Local::now().format("%Y-%m-%d").to_string();
    let runs = reader::of_module(records, &today, serial_number);
    let newest = runs.iter().filter_map(|found| found.run.as_ref().ok()).max_by_key(|run| run.started);
    newest.map(|run| Earlier { at: run.started, outcome: (!run.interrupted).then_some(run.outcome) })
}

/// Days with records, newest first.
pub(super) fn days(records: &Path) -> Result<Vec<Day>, String> {
    if !records.exists() {
        return Ok(Vec::new());
    }
    let days = reader::days(records).map_err(|error| with_causes(&error))?;
    Ok(days.into_iter().rev().map(|(name, serial_numbers)| Day { name, serial_numbers }).collect())
}

/// Runs of a day, by serial number and time.
pub(super) fn runs(records: &Path, day: String) -> Result<Runs, String> {
    let (found, cut) = reader::of_day(records, &day, MAX_RUNS).map_err(|error| with_causes(&error))?;
    let mut lines: Vec<RunLine> = found.into_iter().map(line).collect();
    lines.sort_by(|a, b| a.serial_number.cmp(&b.serial_number).then(a.at.cmp(&b.at)));
    Ok(Runs { day, lines, cut })
}

fn line(found: reader::FoundRun) -> RunLine {
    let mark = match &found.run {
        Ok(run) => mark(run, found.sealed),
        Err(error) if error.is_newer() => Mark::Newer,
        Err(_) => Mark::Unreadable,
    };
    let folder = |path: Option<&Path>| {
        path.and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    };
    match found.run {
        Ok(run) => RunLine {
            path: found.path,
            at: Some(run.started),
            simulated: run.bench.kind == BenchKind::Simulated,
            selection: run.selection.is_some(),
            serial_number: run.serial_number,
            plan: run.plan.name,
            mark,
            elapsed_s: run.elapsed_s,
        },
        Err(_) => RunLine {
            serial_number: folder(found.path.parent()),
            plan: folder(Some(&found.path)),
            path: found.path,
            at: None,
            mark,
            simulated: false,
            selection: false,
            elapsed_s: 0.0,
        },
    }
}

fn mark(run: &RunRecord, sealed: bool) -> Mark {
    match run.interrupted {
        true => Mark::Interrupted,
        false if !sealed => Mark::Unsealed,
        false => Mark::Outcome(run.outcome),
    }
}

/// Opens a run.
pub(super) fn open(path: PathBuf) -> Result<Box<(PathBuf, RunState, Mark)>, Unopened> {
    let state = reader::fold(&path).map_err(|error| unopened(&error))?;
    let run = RunRecord::from_state(&state).ok_or_else(|| unopened(&ReadError::Empty))?;
    let mark = mark(&run, reader::is_sealed(&path));
    Ok(Box::new((path, state, mark)))
}

fn unopened(error: &ReadError) -> Unopened {
    match error.unknown() {
        Some(unknown) => Unopened::Newer(unknown.to_string()),
        None => Unopened::Unreadable(with_causes(error)),
    }
}

pub(super) fn verify(path: PathBuf) -> Msg {
    let Verified { problems, newer } = reader::check(&path);
    let newer = newer.as_ref().and_then(ReadError::unknown).map(ToString::to_string);
    Msg::Verified { path, checked: Checked { problems, newer } }
}

/// The fold of a run whose events did not all reach the screen.
pub(super) fn refold(path: &Path) -> Msg {
    Msg::Refolded(reader::fold(path).map(Box::new).map_err(|error| with_causes(&error)))
}

/// Seconds that the newest good and whole run of this plan took on this kind of bench.
pub(super) fn last_whole_run_s(records: &Path, plan_sha256: &str, kind: BenchKind) -> Option<f64> {
    let newest = reader::newest(records, MAX_LOOKED_AT);
    newest
        .filter_map(|path| reader::read(&path).ok())
        .find(|run| {
            run.plan.sha256 == plan_sha256
                && run.bench.kind == kind
                && run.selection.is_none()
                && !run.interrupted
                && run.outcome.is_good()
        })
        .map(|run| run.elapsed_s)
}
