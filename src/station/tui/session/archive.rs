//! Reads the records for the screen.

use std::path::{Path, PathBuf};

use chrono::{DateTime, FixedOffset, Local, NaiveDateTime};
use gnc_executive::event::{BenchKind, OtherModule};
use gnc_executive::record::RunRecord;
use gnc_executive::standing::Standing;
use gnc_executive::state::RunState;
use gnc_records::standing::{Face, Seals};
use gnc_records::store;
use gnc_records::store::as_written::Verified;
use gnc_records::store::head::RunHead;
use gnc_records::store::reader::{self, ReadError};
use gnc_text::with_causes;

use super::files::Held;
use crate::setup;
use crate::tui::records::{Checked, Day, MAX_RUNS, RunLine, Runs, Unopened};
use crate::tui::update::Msg;

/// Largest number of runs that are opened to find out how long a plan takes. If none is of this plan, the time is
/// unknown.
const MAX_LOOKED_AT: usize = 100;

/// What the records say of a module by the plan on the screen; `None` while no plan or no bench is held.
pub(super) fn standing(held: &Held, records: &Path, serial_number: &str) -> Option<Result<Standing, String>> {
    let (plan, bench) = (&held.plan.as_ref()?.plan, held.bench.as_ref()?);
    let standing = setup::standing(records, serial_number, plan, bench.bench.kind, bench.trusted_keys());
    Some(standing.map_err(|error| with_causes(&error)))
}

/// Days with records, newest first.
pub(super) fn days(records: &Path) -> Result<Vec<Day>, String> {
    if !records.exists() {
        return Ok(Vec::new());
    }
    let days = reader::days(records).map_err(|error| with_causes(&error))?;
    Ok(days.into_iter().rev().map(|(name, serial_numbers)| Day { name, serial_numbers }).collect())
}

/// Runs of a day, by serial number, those of a module as they were closed.
pub(super) fn runs(records: &Path, day: String) -> Result<Runs, String> {
    let (found, cut) = reader::of_day(records, &day, MAX_RUNS).map_err(|error| with_causes(&error))?;
    let mut seals = Seals::new(records);
    let line = |found| line(found, &mut seals);
    let mut lines: Vec<RunLine> = found.rev().map(line).collect();
    // It keeps the order of those that are alike.
    lines.sort_by(|a, b| a.serial_number.cmp(&b.serial_number));
    Ok(Runs { day, lines, cut })
}

fn line(found: reader::FoundRun, seals: &mut Seals<'_>) -> RunLine {
    let face = face(&found, seals);
    let folder = |path: Option<&Path>| {
        path.and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    };
    match found.run {
        Ok(run) => RunLine {
            path: found.path,
            at: Some(run.started),
            simulated: run.bench.kind == BenchKind::Simulated,
            unproven: run.bench.kind == BenchKind::Unproven,
            selection: run.selection.is_some(),
            rejudged: run.recomputed.is_some(),
            serial_number: match run.other_module {
                Some(OtherModule { scanned, found, .. }) => format!("{found} / {scanned}"),
                None => run.serial_number,
            },
            plan: run.plan.name,
            face,
            elapsed_s: run.elapsed_s,
        },
        Err(_) => RunLine {
            serial_number: {
                let folder = folder(found.path.parent());
                store::number_of(&folder).unwrap_or(folder)
            },
            plan: folder(Some(&found.path)),
            at: named_time(&found.path),
            path: found.path,
            face,
            simulated: false,
            unproven: false,
            selection: false,
            rejudged: false,
            elapsed_s: 0.0,
        },
    }
}

/// When a run began, by the names of its day and its folder.
fn named_time(run: &Path) -> Option<DateTime<FixedOffset>> {
    let name = |path: &Path| Some(path.file_name()?.to_str()?.to_owned());
    let (day, run) = (name(run.ancestors().nth(2)?)?, name(run)?);
    let time = NaiveDateTime::parse_from_str(&format!("{day} {}", run.get(..6)?), "%Y-%m-%d %H%M%S").ok()?;
    Some(time.and_local_timezone(Local).earliest()?.fixed_offset())
}

/// What the run is called. Why a chain cannot be read, `records verify` tells.
fn face(found: &reader::FoundRun, seals: &mut Seals<'_>) -> Face {
    seals.face(found).unwrap_or(Face::Unreadable)
}

/// Opens a run.
pub(super) fn open(path: PathBuf) -> Result<Box<(PathBuf, RunState, Face)>, Unopened> {
    let state = reader::fold(&path).map_err(|error| unopened(&error))?;
    let run = RunRecord::from_state(&state).ok_or_else(|| unopened(&ReadError::Empty))?;
    let (sealed, running) = (reader::is_sealed(&path), store::goes_on(&path));
    let found = reader::FoundRun { path, run: Ok(run), sealed, running: running && !sealed };
    let records = found.path.ancestors().nth(3).unwrap_or(&found.path);
    let face = face(&found, &mut Seals::new(records));
    Ok(Box::new((found.path, state, face)))
}

fn unopened(error: &ReadError) -> Unopened {
    match error.unknown() {
        Some(unknown) => Unopened::Newer(unknown.to_string()),
        None => Unopened::Unreadable(with_causes(error)),
    }
}

pub(super) fn verify(path: PathBuf) -> Msg {
    let Verified { problems, unread, newer, running, never_begun, incomplete, unnamed, only_litter: _ } =
        crate::records::check_one(&path);
    let mut open: Vec<String> = unread.into_iter().map(|unread| unread.why).collect();
    open.extend(incomplete);
    open.extend(unnamed);
    open.extend(never_begun.then(|| ReadError::NeverBegun.to_string()));
    open.extend(running.then(|| "the run goes on, so it cannot be verified yet".to_owned()));
    let newer = newer.as_ref().and_then(ReadError::unknown).map(ToString::to_string);
    Msg::Verified { path, checked: Checked { problems, open, newer } }
}

/// Folds the record of a run again, since some of its events did not reach the screen.
pub(super) fn refold(folder: PathBuf) -> Msg {
    let state = reader::fold(&folder).map(Box::new).map_err(|error| with_causes(&error));
    Msg::Refolded { folder, state }
}

/// Seconds that the newest good and whole run of this plan took on this kind of bench.
pub(super) fn last_whole_run_s(records: &Path, plan_sha256: &str, kind: BenchKind) -> Option<f64> {
    let newest = reader::newest(records, MAX_LOOKED_AT).filter_map(|path| RunHead::read(&path));
    let mut good = newest.filter(|run| run.verdict.passes_module() && run.bench == kind && !run.rejudged);
    good.find(|run| run.plan_sha256 == plan_sha256).map(|run| run.elapsed_s)
}

#[cfg(test)]
mod faces;

#[cfg(test)]
mod tests {
    use gnc_executive::event::Event;
    use gnc_executive::outcome::Outcome;
    use gnc_executive::plan::Plan;
    use gnc_executive::verdict::Verdict;
    use gnc_records::store::{RecordWriter, RunFolder};

    use super::*;

    /// The record of a run is edited after it was closed: the list and the open run say so, and not how its journal ended.
    #[test]
    fn a_record_that_was_edited_is_marked() {
        let place = tempfile::tempdir().expect("a folder");
        let records = place.path();
        let text = "name = \"functional\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nlimits.wrong_reads = \"<= 0\"\n";
        let plan = Plan::read("functional.toml", text.into(), &mut |_| Err(String::new())).expect("a plan");
        let header = serde_json::json!({
            "schema": "gnc-events/1", "serial_number": "A", "operator": null, "station": "s",
            "program": { "name": "p", "version": "1" }, "bench": { "kind": "real" }, "selection": null, "loop": null,
            "plan": { "name": "functional", "version": "1", "sha256": "aa" },
        });
        let time = "2026-11-23T08:00:00+08:00";
        let folder = RunFolder::create(records, time.parse().expect("a time"), "A", "functional").expect("a folder");
        let run = folder.path().to_owned();
        let writer = RecordWriter::without_thread(folder, &plan, Vec::new()).expect("a record");
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        runtime.block_on(async {
            for event in [
                serde_json::json!({ "seq": 0, "at": time, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] }),
                serde_json::json!({ "seq": 1, "at": time, "elapsed_us": 5, "kind": "run_ended", "outcome": "passed" }),
            ] {
                let event: Event = serde_json::from_value(event).expect("an event");
                writer.state().lock().expect("a state").apply(&event).expect("in order");
                writer.place().await.expect("a place").write(event, true).synced().await.expect("on disk");
            }
            writer.close().await.expect("closed");
        });
        let faces = || {
            let listed = runs(records, "2026-11-23".to_owned()).expect("a day").lines[0].face;
            (listed, open(run.clone()).expect("a run").2)
        };
        let passed = Face::Ended(Verdict::Module(Outcome::Passed));
        assert_eq!(faces(), (passed, passed));
        let path = run.join("run.json");
        let record = std::fs::read_to_string(&path).expect("a record");
        std::fs::write(&path, record.replace("\"A\"", "\"B\"")).expect("a record");
        assert_eq!(faces(), (Face::Changed, Face::Changed));
    }

    /// Only the head of each record is read: here is no journal, and the items are no JSON.
    #[test]
    fn the_time_of_a_plan_takes_no_whole_record() {
        let records = tempfile::tempdir().expect("a folder");
        let run = |time: &str, sha256: &str, outcome: &str, elapsed_s: f64| {
            let run = records.path().join(format!("2026-11-28/SN-1/{time}-functional"));
            std::fs::create_dir_all(&run).expect("a folder");
            let head = format!(
                "{{\n  \"outcome\": \"{outcome}\",\n  \"interrupted\": false,\n  \"serial_number\": \"SN-1\",\n  \"plan\": {{ \"name\": \"functional\", \
                 \"version\": \"1\", \"sha256\": \"{sha256}\" }},\n  \"bench\": {{ \"kind\": \"real\" }},\n  \"selection\": null,\n  \
                 \"elapsed_s\": {elapsed_s},\n  \"items\": [ and no more"
            );
            std::fs::write(run.join("run.json"), head).expect("a record");
        };
        run("100000", "aa", "passed", 60.5);
        run("110000", "aa", "failed", 1.5);
        run("120000", "bb", "passed", 2.5);
        assert_eq!(last_whole_run_s(records.path(), "aa", BenchKind::Real), Some(60.5));
        assert_eq!(last_whole_run_s(records.path(), "aa", BenchKind::Simulated), None);
    }
}
