//! Tilt from an accelerometer.

use std::path::PathBuf;

use clap::Args;
use gnc_config::{SourceText, TomlTable};
use gnc_metrology::tilt;
use gnc_plot::{Panel, Series};
use serde_json::json;

use super::gate::GateColumns;
use super::report::FigureReport;
use super::table::{self, ReadingOptions, TableError, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

/// Largest budget, bytes; a usual one has about 1 kB.
const MOST_BYTES: usize = 1 << 20;

/// Range of a contribution: above a thousand g the unit is a mistake.
const MOST_MG: (f64, f64) = (0.0, 1e6);

/// Labels of a flip.
const SIDES: [&str; 2] = ["+", "-"];

#[derive(Debug, Args)]
pub(super) struct FlipArgs {
    /// Columns position,a; position is + or -, many rows of each are averaged
    file: PathBuf,
    /// Gravity in the unit of the record
    #[arg(long, value_name = "G", default_value_t = 1.0)]
    gravity: f64,
    #[command(flatten)]
    gate: GateColumns,
}

impl FlipArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let names = self.gate.behind(&["a"]);
        let wanted = Wanted { numbers: &names, label: Some(("position", &SIDES)), ..Wanted::default() };
        let mut columns = table::RecordTable::open(&self.file, reading)?.read(&wanted, None)?;
        let gated = self.gate.positions(&["a"], &mut columns, None)?;
        let labels: Vec<&str> = columns.labels.iter().map(|c| SIDES[usize::from(*c)]).collect();
        let f = tilt::flip_rows(&labels, &columns.numbers[0], self.gravity)?;
        let mut report = FigureReport::new("flip");
        report
            .record(&columns)
            .put("equation", "", "actual = (out - offset) / gain")
            .put("offset", "bias as output: at zero input, unit of the record", f.offset)
            .put("gain", "unit of the record per unit of gravity", f.gain)
            .put("bias", "offset / gain: measured less true, unit of gravity", f.bias())
            .put("sd", "noise of the rows and steps of the output", json!({ "offset": f.offset_sd, "gain": f.gain_sd }))
            .put("gate", "rows", gated.json());
        let up = |code: u8| if code == 0 { self.gravity } else { -self.gravity };
        let rows = || columns.labels.iter().zip(&columns.numbers[0]);
        let line = [-1.0, 1.0].map(|s| (s * self.gravity, f.offset + s * f.gain * self.gravity));
        let fit = vec![Series::dots("rows", rows().map(|(l, a)| (up(*l), *a))), Series::line("fit", line)];
        let residuals = rows().enumerate().map(|(i, (l, a))| (i as f64 + 1.0, f.actual(*a) - up(*l)));
        let panels = vec![
            Panel::new("Flip", "actual", "output", fit),
            Panel::new("Residuals", "row", "(out - offset) / gain - actual", vec![Series::dots("rows", residuals)]),
        ];
        Ok(ComputeOutcome { report, panels })
    }
}

#[derive(Debug, Args)]
pub(super) struct TiltTemperature {
    /// Columns temperature,offset; three rows: cold, ambient (25 +- 5 degC), hot
    file: PathBuf,
}

impl TiltTemperature {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let wanted = Wanted { numbers: &["temperature", "offset"], time: TimeUse::Free, ..Wanted::default() };
        let columns = table::RecordTable::open(&self.file, reading)?.read(&wanted, None)?;
        let points: Vec<(f64, f64)> =
            columns.numbers[0].iter().copied().zip(columns.numbers[1].iter().copied()).collect();
        let c = tilt::temperature_rows(&columns.numbers[0], &columns.numbers[1])?;
        let [cold, _, hot] = c.temperatures_c;
        let mut report = FigureReport::new("tilt-temperature");
        report
            .record(&columns)
            .put("equation", "", "offset = a t^2 + b t + c, t in degC")
            .put("a", "per K^2", c.a)
            .put("b", "per K", c.b)
            .put("c", "at 0 degC", c.c)
            .put("ambient_offset", "step 1", c.ambient_offset)
            .put("slope", "step 2, per K", c.slope)
            .put("cold_remainder", "step 3", c.cold_remainder)
            .put("temperatures_c", "", json!(c.temperatures_c))
            .put(
                "uncertainty_factor",
                "20 K outside, relative to a point",
                json!({ "below": c.uncertainty_factor(cold - 20.0), "above": c.uncertainty_factor(hot + 20.0) }),
            );
        let curve = (0..=100).map(|k| cold + (hot - cold) * f64::from(k) / 100.0).map(|t| (t, c.offset(t)));
        let panel = Panel::new(
            "Offset over temperature",
            "degC",
            "offset",
            vec![Series::dots("points", points), Series::line("parabola", curve)],
        );
        Ok(ComputeOutcome { report, panels: vec![panel] })
    }
}

#[derive(Debug, Args)]
pub(super) struct TiltBudget {
    /// TOML: range_deg, and [[contribution]] with name, before_mg, after_mg
    file: PathBuf,
}

/// A budget as its file has it: contributions, and the range of tilt.
fn budget(root: &TomlTable<'_, '_>) -> (Vec<tilt::TiltContribution>, f64) {
    let number = |table: &TomlTable<'_, '_>, key: &'static str, (low, high): (f64, f64)| {
        let entry = table.required(key, &format!("it may be {low} to {high}"))?;
        entry.number((low, high))
    };
    let contribution = |table: &TomlTable<'_, '_>| {
        let name = table.required_text("name", "write what contributes: name = \"zero-g offset\"");
        tilt::TiltContribution {
            name: name.map(|(name, _)| name.to_owned()).unwrap_or_default(),
            before_mg: number(table, "before_mg", MOST_MG).unwrap_or_default(),
            after_mg: number(table, "after_mg", MOST_MG).unwrap_or_default(),
        }
    };
    if !root.has("contribution") {
        root.mistake("the budget has no contributions", "begin each with a line [[contribution]]");
    }
    let range_deg = number(root, "range_deg", (0.0, 89.0)).unwrap_or_default();
    (root.tables("contribution").into_iter().map(|table| table.read(contribution)).collect(), range_deg)
}

impl TiltBudget {
    pub(super) fn compute(&self) -> Result<ComputeOutcome, ComputeError> {
        let unreadable = |source| TableError::Io { path: self.file.clone(), source };
        let bytes = gnc_files::read_beginning(&self.file, MOST_BYTES as u64 + 1).map_err(unreadable)?;
        let source = SourceText::new(&gnc_text::shown_path(&self.file), bytes, MOST_BYTES)?;
        let (lines, range_deg) = gnc_config::read(&source, budget)?;
        let (before, after) = tilt::budget(&lines, range_deg)?;
        let total = |t: &tilt::Total| {
            json!({
                "sum_mg": t.sum_mg,
                "rss_mg": t.rss_mg,
                "tilt_at_zero_deg": t.tilt_at_zero_deg,
                "tilt_at_range_deg": t.tilt_at_range_deg,
            })
        };
        let rows = lines.iter().map(|c| vec![json!(c.name), json!(c.before_mg), json!(c.after_mg)]).collect();
        let mut report = FigureReport::new("tilt-budget");
        report
            .rows("contributions", &["name", "before_mg", "after_mg"], rows)
            .put("range_deg", "+-", range_deg)
            .put("before", "", total(&before))
            .put("after", "", total(&after));
        let curve = |mg: f64| {
            (-90..=90)
                .map(f64::from)
                .filter(move |t| t.abs() <= range_deg)
                .map(move |t| (t, tilt::tilt_error_deg(t, mg)))
        };
        let series = vec![Series::line("before", curve(before.sum_mg)), Series::line("after", curve(after.sum_mg))];
        Ok(ComputeOutcome {
            report,
            panels: vec![Panel::new("Tilt error of the linear sum", "tilt, deg", "error, deg", series)],
        })
    }
}
