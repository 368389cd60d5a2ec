//! Scale factor of one sensor from its output at many rates.

use std::path::PathBuf;

use clap::Args;
use gnc_metrology::scale_factor::{self, Asymmetry, LackOfFit, Largest, RateRows, ScaleFactorOptions};
use gnc_plot::{Panel, Series};
use serde_json::{Value, json};

use super::gate::GateColumns;
use super::report::FigureReport;
use super::table::{Columns, ReadingOptions, RecordTable, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

/// Relative figures are given in parts per million.
const PPM: f64 = 1e6;

/// A table is not set to more points than this: then the points are samples with measured rates.
const MANY_POINTS: usize = 100;

#[derive(Debug, Args)]
pub(super) struct ScaleFactorArgs {
    /// Columns rate,x: one row per rate, or a block of rows per rate, which is averaged; optional columns cycle, point
    file: PathBuf,
    /// Column of the output
    #[arg(long, value_name = "NAME", default_value = "x")]
    column: String,
    /// Column of the input: the rate of the table, or the specific force
    #[arg(long, value_name = "NAME", default_value = "rate")]
    input: String,
    /// End of the input range to which the nonlinearity refers, in the unit of the input; without it the largest input
    #[arg(long, value_name = "RATE")]
    full_scale: Option<f64>,
    /// Largest distance of a point from the line, percent of the full scale
    #[arg(long, value_name = "PERCENT", default_value_t = 100.0 * scale_factor::RESIDUAL_LIMIT)]
    residual: f64,
    #[command(flatten)]
    gate: GateColumns,
}

impl ScaleFactorArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        // Means at settled rates are cut out of a longer record, so the times between them have no meaning.
        let table = RecordTable::open(&self.file, reading)?;
        let (has_cycle, has_point) = (table.has("cycle"), table.has("point"));
        let mut names = vec![self.column.as_str(), self.input.as_str()];
        names.extend(has_cycle.then_some("cycle"));
        names.extend(has_point.then_some("point"));
        let names = self.gate.behind(&names);
        let mut read = table.read(&Wanted { numbers: &names, time: TimeUse::Free, ..Wanted::default() }, None)?;
        let point = 2 + usize::from(has_cycle);
        // Numbered points may have measured rates, which differ from row to row.
        let mut by = vec![if has_point { point } else { 1 }];
        by.extend(has_cycle.then_some(2));
        let gated = self.gate.levels(&names[..1], &mut read, &by)?;
        let columns = &read.numbers;
        let rows = RateRows {
            rates: &columns[1],
            outputs: &columns[0],
            cycles: has_cycle.then(|| columns[2].as_slice()),
            points: has_point.then(|| columns[point].as_slice()),
        };
        let points = rows.means()?;
        let options = ScaleFactorOptions { full_scale: self.full_scale, residual: self.residual / 100.0 };
        let found = scale_factor::fit(&points, &options)?;
        let mut report = self.report(&read, &found);
        report.put("gate", "rows", gated.json());
        if points.len() > MANY_POINTS && points.iter().all(|p| p.rows == 1) {
            report.put("note", "", "every row has its own rate: number the points in a column `point` to average them");
        }
        Ok(ComputeOutcome { report, panels: self.panels(&found) })
    }

    fn report(&self, columns: &Columns, c: &scale_factor::ScaleFactor) -> FigureReport {
        let (k, offset) = (c.scale_factor, c.offset);
        let mut report = FigureReport::new("scale-factor");
        report
            .record(columns)
            .put("equation", "", scale_factor::EQUATION)
            .put("scale_factor", format!("unit of {} per unit of {}", self.column, self.input), k.value)
            .put("offset", format!("unit of {}: the bias as an output, measured less true", self.column), offset.value)
            .put("bias", format!("offset / scale_factor, unit of {}", self.input), offset.value / k.value)
            .put(
                "sd",
                "standard uncertainty, type A, units as above",
                json!({ "scale_factor": k.sd, "offset": offset.sd }),
            )
            .put("dof", if c.cycles.len() > 1 { "cycles - 1" } else { "points - 2" }, k.dof)
            .put(
                "expanded",
                "95 %, Student t, units as above",
                json!({ "scale_factor": k.expanded(), "offset": offset.expanded() }),
            )
            .put("expanded_ppm", "of the scale factor, relative", k.expanded() / k.value.abs() * PPM)
            .put("label", "", "an error that all rates share goes into scale_factor in full, and no figure shows it")
            .put("residual_rms", format!("unit of {}", self.column), c.residual_rms)
            .put("full_scale", format!("unit of {}, to which nonlinearity_full_scale refers", self.input), c.full_scale)
            .put(
                "nonlinearity_full_scale",
                "largest residual / (scale_factor full_scale) (GJB 2426A)",
                largest(&c.nonlinearity_full_scale),
            )
            .put(
                "nonlinearity_output",
                "largest residual / (scale_factor rate), each at its own rate (IEEE 528)",
                largest(&c.nonlinearity_output),
            );
        put(&mut report, "asymmetry", "K of each sense alone", c.asymmetry.as_ref().map(asymmetry));
        put(
            &mut report,
            "repeatability",
            "of K over the cycles (n - 1), 95 % interval by chi-square",
            c.repeatability.as_ref().map(|r| {
                json!({
                    "cycles": r.runs, "sd": r.sd, "sd_low": r.sd_low, "sd_high": r.sd_high,
                    "relative_ppm": r.sd / k.value.abs() * PPM,
                })
            }),
        );
        put(
            &mut report,
            "lack_of_fit",
            "F test of the line by repeated points",
            c.lack_of_fit.as_ref().map(lack_of_fit),
        );
        let points = c.curve.iter().map(|p| {
            let of_output = p.of_output.map(|v| v * PPM);
            let line = p.output - p.residual;
            let figures = [p.rate, p.output, line, p.residual, p.of_full_scale * PPM].map(|v| json!(v));
            figures.into_iter().chain([json!(of_output), json!(p.visits)]).collect()
        });
        let cycles = c.cycles.iter().map(|cycle| {
            vec![json!(cycle.number), json!(cycle.points), json!(cycle.scale_factor), json!(cycle.offset)]
        });
        let suspects = c
            .suspects
            .iter()
            .map(|s| vec![json!(s.point.rate), json!(s.point.cycle), json!(s.point.row), json!(s.studentised)]);
        report
            .rows(
                "points",
                &["rate", "output", "line", "residual", "of_full_scale_ppm", "of_output_ppm", "visits"],
                points.collect(),
            )
            .rows("cycles", &["cycle", "points", "scale_factor", "offset"], cycles.collect());
        if c.suspects.is_empty() {
            report.put("suspects", "no point stands out", json!([]));
        } else {
            report.rows("suspects", &["rate", "cycle", "row", "studentised_residual"], suspects.collect());
        }
        report
    }

    fn panels(&self, c: &scale_factor::ScaleFactor) -> Vec<Panel> {
        let ends = [c.curve.first(), c.curve.last()].into_iter().flatten();
        let line = ends.map(|p| (p.rate, c.offset.value + c.scale_factor.value * p.rate)).collect::<Vec<_>>();
        let fit = vec![
            Series::dots("points", c.curve.iter().map(|p| (p.rate, p.output)).collect::<Vec<_>>()),
            Series::line("line", line),
        ];
        let residuals = c.curve.iter().map(|p| (p.rate, p.of_full_scale * PPM)).collect::<Vec<_>>();
        vec![
            Panel::new("Scale factor", self.input.clone(), self.column.clone(), fit),
            Panel::new("Residuals", self.input.clone(), "ppm of full scale", vec![Series::dots("points", residuals)]),
        ]
    }
}

/// A figure, or `null` with its reason.
fn put(report: &mut FigureReport, key: &'static str, unit: &str, value: Result<Value, &scale_factor::MissingFigure>) {
    match value {
        Ok(value) => report.put(key, unit, value),
        Err(why) => report.absent(key, why.to_string()),
    };
}

fn largest(found: &Largest) -> Value {
    let ends = found.interval.map(|(low, high)| (low * PPM, high * PPM)).unzip();
    let mut value = json!({ "ppm": found.value * PPM, "at_rate": found.rate, "low_ppm": ends.0, "high_ppm": ends.1 });
    if found.interval.is_none() {
        value["interval_absent"] = json!("it needs the same repeated points in every cycle");
    }
    value
}

fn asymmetry(found: &Asymmetry) -> Value {
    let estimate = found.uncertainty.map(|(sd, dof)| scale_factor::Estimate { value: found.relative, sd, dof });
    let mut value = json!({
        "ppm": found.relative * PPM, "positive": found.positive, "negative": found.negative,
        "expanded_ppm": estimate.map(|e| e.expanded() * PPM), "dof": estimate.map(|e| e.dof),
    });
    if estimate.is_none() {
        value["expanded_absent"] = json!(scale_factor::MissingFigure::NoResidual.to_string());
    }
    value
}

fn lack_of_fit(found: &LackOfFit) -> Value {
    json!({ "f": found.f, "p": found.p, "dof": found.dof, "pure_dof": found.pure_dof, "pure_sd": found.pure_sd })
}
