//! Command line arguments of `records list`.

use chrono::NaiveDate;
use clap::Args;
use clap::builder::PossibleValuesParser;

/// What `--outcome` knows: the outcomes that a run can have, the states of a run without one, and why an outcome
/// counts for nothing.
const OUTCOMES: [&str; 16] = [
    "passed",
    "marginal",
    "failed",
    "errored",
    "aborted",
    "partial",
    "running",
    "interrupted",
    "unsealed",
    "newer",
    "unreadable",
    "changed",
    "closed_late",
    "not_in_chain",
    "rejudged",
    "unproven",
];

/// Which runs are listed, and in what form.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct ListArgs {
    /// Writes an array of JSON objects, a line each; docs/records.md describes the fields.
    #[arg(long, conflicts_with = "csv")]
    pub(crate) json: bool,
    /// Writes the same fields as a table for spreadsheets.
    #[arg(long)]
    pub(crate) csv: bool,
    /// Lists the runs of this day, by the date of their folders.
    #[arg(long, value_name = "DATE", value_parser = parse_day, conflicts_with_all = ["since", "until"])]
    pub(crate) day: Option<NaiveDate>,
    /// Lists the runs of this day and of later ones.
    #[arg(long, value_name = "DATE", value_parser = parse_day)]
    pub(crate) since: Option<NaiveDate>,
    /// Lists the runs of this day and of earlier ones.
    #[arg(long, value_name = "DATE", value_parser = parse_day)]
    pub(crate) until: Option<NaiveDate>,
    /// Lists the runs of this module.
    #[arg(long, value_name = "SN")]
    pub(crate) serial_number: Option<String>,
    /// Lists the runs of the plan with this name.
    #[arg(long, value_name = "NAME")]
    pub(crate) plan: Option<String>,
    /// Lists the runs that ended so, or that are in one of these states. "passed" and "marginal" are those alone
    /// that count: closed, held by the chain, and not judged again.
    #[arg(long, value_name = "A,B", value_delimiter = ',', value_parser = PossibleValuesParser::new(OUTCOMES))]
    pub(crate) outcome: Vec<String>,
}

fn parse_day(text: &str) -> Result<NaiveDate, String> {
    NaiveDate::parse_from_str(text, "%Y-%m-%d").map_err(|_| "this is not a date; write 2026-11-28".to_owned())
}
