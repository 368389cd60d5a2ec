//! Repeatability of a figure over runs.

use std::path::PathBuf;

use clap::Args;
use gnc_metrology::{Refusal, quantisation, series, stability, stats};
use gnc_plot::{Panel, Series};
use serde_json::json;

use super::gate::GateColumns;
use super::report::FigureReport;
use super::table::{Columns, ReadingOptions, RecordTable, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

#[derive(Debug, Args)]
pub(super) struct RepeatabilityArgs {
    /// Columns run,x: the rows of a run are averaged; without a column run every row is a run
    file: PathBuf,
    /// Column of the figure
    #[arg(long, value_name = "NAME", default_value = "x")]
    column: String,
    #[command(flatten)]
    gate: GateColumns,
}

/// Rows of one run.
struct Run {
    number: f64,
    values: Vec<f64>,
}

impl RepeatabilityArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        // Any time may pass between runs.
        let table = RecordTable::open(&self.file, reading)?;
        let has_run = table.has("run");
        let mut names = vec![self.column.as_str()];
        names.extend(has_run.then_some("run"));
        let names = self.gate.behind(&names);
        let mut columns = table.read(&Wanted { numbers: &names, time: TimeUse::Free, ..Wanted::default() }, None)?;
        // A dead run is reported as such before the gate counts its rows.
        alive(&self.column, &self.runs(&columns, has_run)?)?;
        // Without runs every row is a run of its own, so the gate has no neighbours to compare.
        let gated = if has_run { Some(self.gate.levels(&names[..1], &mut columns, &[1])?) } else { None };
        let runs = self.runs(&columns, has_run)?;
        let means: Vec<f64> = runs.iter().map(|run| stats::mean(&run.values)).collect();
        let stretches: Vec<&[f64]> = runs.iter().map(|run| run.values.as_slice()).collect();
        let figures = [means.as_slice()];
        let are_rows = stretches.iter().all(|values| values.len() == 1);
        // Figures of one row each are values of the output; together they show its steps.
        let resolution_sd = quantisation::mean_error_sd(if are_rows { &figures } else { &stretches });
        let found = stability::repeatability(&means, resolution_sd)?;
        let unit = format!("unit of {}", self.column);
        let mut report = FigureReport::new("repeatability");
        report
            .record(&columns)
            .put("runs", "", found.runs)
            .put("mean", unit.clone(), found.mean)
            .put(
                "mean_sd",
                "standard uncertainty of the mean: sd / sqrt(runs) and the steps of the output",
                found.mean_sd(),
            )
            .put("mean_expanded", "95 %, Student t", found.mean_expanded())
            .put("sd", format!("n - 1, {unit}"), found.sd)
            .put("sd_low", "95 %, chi-square", found.sd_low)
            .put("sd_high", "", found.sd_high)
            .put("dof", "runs - 1", found.runs - 1)
            .put(
                "resolution_of_a_mean",
                "standard uncertainty of a figure from the steps of the output",
                found.resolution_sd,
            );
        match &gated {
            Some(gated) => report.put("gate", "rows", gated.json()),
            None => report.absent("gate", "every row is a run, so no row has neighbours to compare with"),
        };
        if found.mean == 0.0 {
            report.absent("relative", "the mean is zero");
        } else {
            report.put("relative", "sd / |mean|", found.sd / found.mean.abs());
        }
        if runs.iter().all(|run| run.values.len() > 1) {
            let variance = |run: &Run| stats::white_sd(&run.values).powi(2) / run.values.len() as f64;
            let noise = (runs.iter().map(variance).sum::<f64>() / runs.len() as f64).sqrt();
            report.put("noise_of_a_mean", "what white noise within the runs adds to sd", noise);
        } else {
            report.absent("noise_of_a_mean", "a run of one row does not show its noise");
        }
        let suspects = stability::suspects(&means, resolution_sd);
        if suspects.is_empty() {
            report.put("suspects", "no run stands out", json!([]));
        } else {
            let of = |(place, studentised): &(usize, f64)| {
                vec![json!(runs[*place].number), json!(means[*place]), json!(studentised)]
            };
            report.rows("suspects", &["run", "mean", "studentised_residual"], suspects.iter().map(of).collect());
        }
        let rows = runs
            .iter()
            .zip(&means)
            .map(|(run, mean)| vec![json!(run.number), json!(run.values.len()), json!(mean), json!(mean - found.mean)]);
        report.rows("means", &["run", "rows", "mean", "deviation"], rows.collect());
        let dots = runs.iter().zip(&means).map(|(run, mean)| (run.number, *mean)).collect::<Vec<_>>();
        let title = format!("Means of {}", self.column);
        let panel = Panel::new(title, "run", unit, vec![Series::dots("runs", dots)]);
        Ok(ComputeOutcome { report, panels: vec![panel] })
    }
}

impl RepeatabilityArgs {
    fn runs(&self, columns: &Columns, has_run: bool) -> Result<Vec<Run>, Refusal> {
        let values = &columns.numbers[0];
        series::finite(&self.column, values)?;
        let Some(numbers) = columns.numbers.get(1).filter(|_| has_run) else {
            let alone = |(i, v): (usize, &f64)| Run { number: i as f64 + 1.0, values: vec![*v] };
            return Ok(values.iter().enumerate().map(alone).collect());
        };
        series::finite("run", numbers)?;
        Ok(runs(numbers, values))
    }
}

/// The rows of each run, in the order in which the runs begin.
fn runs(numbers: &[f64], values: &[f64]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (number, value) in numbers.iter().zip(values) {
        // Rows of a run mostly follow each other.
        match runs.iter_mut().rev().find(|run| run.number == *number) {
            Some(run) => run.values.push(*value),
            None => runs.push(Run { number: *number, values: vec![*value] }),
        }
    }
    runs
}

/// Refuses a run that shows one value throughout while another run is noisy.
fn alive(column: &str, runs: &[Run]) -> Result<(), Refusal> {
    let still = |run: &Run| run.values.iter().all(|v| *v == run.values[0]);
    let stretches: Vec<&[f64]> = runs.iter().map(|run| run.values.as_slice()).collect();
    match runs.iter().find(|run| still(run) && quantisation::is_stuck(&stretches, run.values.len())) {
        Some(run) => Err(Refusal::Stuck {
            channel: column.to_owned(),
            place: format!("run {}", run.number),
            value: run.values[0],
            samples: run.values.len(),
        }),
        None => Ok(()),
    }
}
