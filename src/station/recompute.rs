//! `gnc-station recompute RUN`: works out all figures and verdicts of a run once more, from its raw record and its plan
//! alone.

mod again;
mod differences;
mod limits;
mod passports;
mod source;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_executive::event::{BenchKind, EarlierRun, Event, PlanInfo};
use gnc_executive::plan::Plan;
use gnc_executive::state::RunState;
use gnc_files::Reach;
use gnc_records::store::{JOURNAL, RecordWriter, RunFolder, StationKey, StoreError, as_written, chain, digest};
use gnc_text::{printable, with_causes};

use crate::progress::Progress;
use crate::records::RecordsArgs;
use crate::refusal::{complain, refuse};
use crate::wording::Lines;
use crate::{exit_code, files, records};
use again::{Again, Record};
use source::{RecordedRun, RunError};

/// Exit code when something differs from the record.
const DIFFERS: u8 = 1;

/// The part of `--help` about exit codes.
pub(crate) const EXIT_CODES: &str = "\
Exit codes without --plan:
  0  all results are the same, bit for bit
  1  a result differs, or the record is not as it was written
  2  the run cannot be recomputed
Exit codes with --plan: those of a run, by the verdict under that plan; 2 if the record is not as it was written.";

/// Judges a run again; with another plan into a new folder beside it.
/// `key` signs that folder; without it the key of the bench file does.
pub(crate) fn run(run: &Path, within: &RecordsArgs, plan: Option<(&Path, Reach)>, key: Option<&Path>) -> ExitCode {
    let folder = match records::one(within, run) {
        Ok(folder) => folder,
        Err(refused) => return refused,
    };
    records::tell_size(&folder);
    let progress = Progress::begin("the run is worked out again");
    let done = match plan {
        None => same(&folder),
        Some((plan, reach)) => match within.key(key) {
            Ok(key) => other(&folder, plan, reach, key),
            Err(refusal) => return refuse(refusal.what, &refusal.try_this),
        },
    };
    drop(progress);
    done.unwrap_or_else(|error| refuse(with_causes(&error), error.try_this()))
}

fn same(folder: &Path) -> Result<ExitCode, RunError> {
    // The digests show every changed sample, even if no figure depends on it.
    let found = as_written::check(folder);
    let is_changed = !found.problems.is_empty() || !found.unread.is_empty();
    let problems = found.into_sentences();
    let run = RecordedRun::read(folder)?;
    let plan = run.recorded_plan()?;
    let again = again::judge(&run, &plan, None)?;
    let papers = passports::check(folder, &fold(&again.events)?)?;
    let same = again.differences.is_empty() && papers.differences.is_empty();
    let mut out = Lines::to_stdout();
    for problem in &problems {
        out.say_of(&out.wording.text("record"), printable(problem));
    }
    for line in again.differences.iter().chain(&papers.differences) {
        out.say(printable(line));
    }
    let record = match (is_changed, problems.is_empty()) {
        (true, _) => Record::Changed,
        (false, false) => Record::Open,
        (false, true) => Record::AsWritten,
    };
    out.say_of(&gnc_text::shown_path(folder), again.summary(same, record, &papers.summary));
    let (what, try_this) = match record {
        Record::AsWritten if same => return Ok(ExitCode::SUCCESS),
        Record::AsWritten => (
            "the recomputed results differ from the record",
            "compare the version of this program with that in the record; report this if they are the same",
        ),
        Record::Changed => {
            ("the record was changed and nothing shows what was measured", RunError::NotAsWritten.try_this())
        }
        Record::Open => (
            "the record is not closed and nothing shows whether it was changed",
            "start a run of that station: it mends what is left and says what; then recompute again",
        ),
    };
    complain(what, try_this);
    Ok(ExitCode::from(DIFFERS))
}

fn other(folder: &Path, path: &Path, reach: Reach, key: Option<StationKey>) -> Result<ExitCode, RunError> {
    let plan = files::plan_to_judge(path, reach).map_err(|refusal| RunError::Plan { what: refusal.what })?;
    let run = RecordedRun::read(folder)?;
    // A judgement of changed samples would be sealed as if they were the module's.
    let problems = as_written::verify(folder);
    if !problems.is_empty() {
        let mut out = Lines::to_stdout();
        for problem in &problems {
            out.say_of(&out.wording.text("record"), printable(problem));
        }
        return Err(RunError::NotAsWritten);
    }
    let of = EarlierRun {
        run: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        journal_sha256: digest::of_file(&folder.join(JOURNAL))?,
    };
    let plan = plan.plan();
    // A simulated run is never evidence, and is not signed.
    let key = key.filter(|_| run.header.bench.kind != BenchKind::Simulated);
    // A new judgement does not make another station's samples those of this one.
    let is_foreign = key.as_ref().is_some_and(|key| as_written::verify_signature(folder, &[key.public()]).is_some());
    let key = key.filter(|_| !is_foreign);
    // Among signed runs one without a signature would be a finding for ever.
    if key.is_none() && run.header.bench.kind != BenchKind::Simulated && chain::is_signed_beside(folder)? {
        return Err(match is_foreign {
            _ if !as_written::is_signed(folder) => RunError::Unsigned,
            true => RunError::ForeignKey,
            false => RunError::NoKey,
        });
    }
    let again = again::judge(&run, plan, Some(of))?;
    let path = file(folder, plan, &again, key)?;
    let mut out = Lines::to_stdout();
    if is_foreign {
        out.say("this key did not sign the run, so the judgement of it is not signed either");
    }
    for line in &again.differences {
        out.say(printable(line));
    }
    out.say(format_args!(
        "{}, re-judged by {} {}: {}",
        gnc_text::shown_path(folder),
        plan.name,
        plan.version,
        again.verdict
    ));
    out.say(format_args!("record: {}", gnc_text::shown_path(&path)));
    Ok(exit_code::of(again.verdict, exit_code::Strictness::Lenient))
}

/// Files the new judgement beside the run.
fn file(folder: &Path, plan: &Plan, again: &Again, key: Option<StationKey>) -> Result<PathBuf, RunError> {
    let beside = RunFolder::beside(folder, "recomputed")?.signed_with(key);
    let path = beside.path().to_owned();
    let runtime = crate::threads::beside();
    let runtime =
        runtime.map_err(|source| StoreError::File { what: "start a thread for", path: path.clone(), source })?;
    runtime.block_on(write(RecordWriter::start(beside, plan, Vec::new())?, &again.events))?;
    Ok(path)
}

async fn write(writer: RecordWriter, events: &[Event]) -> Result<(), StoreError> {
    let state = writer.state();
    for event in events {
        let place = writer.place().await?;
        state.lock().unwrap_or_else(std::sync::PoisonError::into_inner).apply(event).map_err(StoreError::OutOfOrder)?;
        place.write(event.clone(), false).synced().await?;
    }
    writer.close().await
}

/// A plan as a record names it.
fn info(plan: &Plan) -> PlanInfo {
    PlanInfo { name: plan.name.clone(), version: plan.version.clone(), sha256: digest::of_plan(plan.files()) }
}

/// Folds events into the state of a run, which has the outcome.
fn fold(events: &[Event]) -> Result<RunState, RunError> {
    let mut state = RunState::new();
    for event in events {
        state.apply(event).map_err(|source| RunError::OutOfOrder { source })?;
    }
    Ok(state)
}
