//! `gnc-station records list`: the runs of the records folder, for people, programs and spreadsheets.

mod table;

use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

use chrono::NaiveDate;
use clap::Args;
use clap::builder::PossibleValuesParser;
use gnc_executive::outcome::Outcome;
use gnc_records::store::reader::{self, Found, FoundRun, Wanted};
use gnc_text::printable;

use super::place::RecordsPlace;
use crate::refusal::refuse;
use table::Line;

/// What `--outcome` knows: the outcomes that a run can have, and the states of a run without one.
const OUTCOMES: [&str; 10] =
    ["passed", "marginal", "failed", "errored", "aborted", "running", "interrupted", "unsealed", "newer", "unreadable"];

/// Which runs are listed, and in what form.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct ListArgs {
    /// Writes an array of JSON objects, a line each; docs/records.md describes the fields.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Writes the same fields as a table for spreadsheets.
    #[arg(long)]
    csv: bool,
    /// Lists the runs of this day, by the date of their folders.
    #[arg(long, value_name = "DATE", value_parser = parse_day, conflicts_with_all = ["since", "until"])]
    day: Option<NaiveDate>,
    /// Lists the runs of this day and of later ones.
    #[arg(long, value_name = "DATE", value_parser = parse_day)]
    since: Option<NaiveDate>,
    /// Lists the runs of this day and of earlier ones.
    #[arg(long, value_name = "DATE", value_parser = parse_day)]
    until: Option<NaiveDate>,
    /// Lists the runs of this module.
    #[arg(long, value_name = "SN")]
    serial_number: Option<String>,
    /// Lists the runs of the plan with this name.
    #[arg(long, value_name = "NAME")]
    plan: Option<String>,
    /// Lists the runs that ended so, or that are in one of these states.
    #[arg(long, value_name = "A,B", value_delimiter = ',', value_parser = PossibleValuesParser::new(OUTCOMES))]
    outcome: Vec<String>,
}

fn parse_day(text: &str) -> Result<NaiveDate, String> {
    NaiveDate::parse_from_str(text, "%Y-%m-%d").map_err(|_| "this is not a date; write 2026-11-28".to_owned())
}

impl ListArgs {
    fn wanted(&self) -> Wanted<'_> {
        Wanted {
            since: self.day.or(self.since),
            until: self.day.or(self.until),
            serial_number: self.serial_number.as_deref().map(str::trim),
        }
    }

    fn has(&self, found: &FoundRun) -> bool {
        let plan = |plan: &String| found.run.as_ref().is_ok_and(|run| run.plan.name == *plan);
        let word = word(found);
        self.plan.as_ref().is_none_or(plan) && (self.outcome.is_empty() || self.outcome.iter().any(|one| one == word))
    }

    fn wants_all(&self) -> bool {
        let Self { json: _, csv: _, day, since, until, serial_number, plan, outcome } = self;
        let days = day.or(*since).or(*until);
        days.is_none() && serial_number.is_none() && plan.is_none() && outcome.is_empty()
    }
}

/// The outcome of a run that is closed.
pub(super) fn outcome(found: &FoundRun) -> Option<Outcome> {
    found.run.as_ref().ok().filter(|_| found.state() == Found::Closed).map(|run| run.outcome)
}

/// The outcome of a closed run, else the state of its folder.
pub(super) fn word(found: &FoundRun) -> &'static str {
    outcome(found).map_or_else(|| found.state().as_str(), Outcome::as_str)
}

/// Lists runs, oldest first.
pub(super) fn list(place: &RecordsPlace, args: &ListArgs) -> ExitCode {
    let records = &place.path;
    let runs = match reader::list_wanted(records, args.wanted()) {
        Ok(runs) => runs,
        Err(error) => return refuse(gnc_text::with_causes(&error), error.try_this()),
    };
    let runs: Vec<FoundRun> = runs.into_iter().filter(|found| args.has(found)).collect();
    let out = io::stdout().lock();
    let written = if args.json {
        as_json(out, records, &runs)
    } else if args.csv {
        table::csv(out, runs.iter().map(|found| Line::of(found, records)))
    } else {
        for_people(out, place, args, &runs)
    };
    match written {
        Ok(()) => ExitCode::SUCCESS,
        // The reader has seen enough.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => refuse(format_args!("the list cannot be written: {error}"), "check where the output goes"),
    }
}

fn as_json(mut out: impl Write, records: &Path, runs: &[FoundRun]) -> io::Result<()> {
    write!(out, "[")?;
    for (index, found) in runs.iter().enumerate() {
        writeln!(out, "{}", if index > 0 { "," } else { "" })?;
        serde_json::to_writer(&mut out, &Line::of(found, records))?;
    }
    writeln!(out, "\n]")?;
    out.flush()
}

fn for_people(mut out: impl Write, place: &RecordsPlace, args: &ListArgs, runs: &[FoundRun]) -> io::Result<()> {
    if runs.is_empty() {
        let such = if args.wants_all() { "no run" } else { "no such run" };
        writeln!(out, "{such} is recorded in {}", place.in_words())?;
    }
    for found in runs {
        let line = match &found.run {
            Ok(run) => super::summary(word(found), run),
            Err(_) if found.running => word(found).to_owned(),
            Err(error) => format!("{:<12}{}", word(found), printable(&gnc_text::with_causes(error))),
        };
        writeln!(out, "{line}  {}", printable(&found.place(&place.path)))?;
    }
    out.flush()
}
