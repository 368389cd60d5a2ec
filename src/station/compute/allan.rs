//! Allan deviations.

use std::path::PathBuf;

use clap::Args;
use gnc_analysis::figures::fit_json;
use gnc_metrology::allan::{self, Analysis, Coefficient, DeviationKind, Input, MissingCoefficient, Taus};
use gnc_plot::{Mark, Panel, Series};
use serde_json::{Value, json};

use super::gate::GateColumns;
use super::record::{OutputTriad, Record};
use super::report::FigureReport;
use super::table::{ReadingOptions, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

/// Which deviation.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Dev {
    Adev,
    Oadev,
    Mdev,
    Hdev,
    Ohdev,
    Totdev,
}

impl From<Dev> for DeviationKind {
    fn from(dev: Dev) -> Self {
        match dev {
            Dev::Adev => Self::Adev,
            Dev::Oadev => Self::Oadev,
            Dev::Mdev => Self::Mdev,
            Dev::Hdev => Self::Hdev,
            Dev::Ohdev => Self::Ohdev,
            Dev::Totdev => Self::Totdev,
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct AllanArgs {
    /// Table with a header row
    file: PathBuf,
    /// Sample rate, Hz; by default that of the time column or of the raw capture
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Column to analyse
    #[arg(long, value_name = "NAME")]
    column: String,
    /// Which deviation
    #[arg(long, value_enum, default_value = "oadev")]
    dev: Dev,
    /// Averaging times: octave, decade, all, or seconds separated by commas
    #[arg(long, default_value = "octave", value_parser = taus)]
    taus: Taus,
    /// The column holds angles (phases) instead of rates
    #[arg(long)]
    phase: bool,
    #[command(flatten)]
    gate: GateColumns,
}

/// Deviation of one term, from its coefficient and the averaging time.
type Curve = fn(f64, f64) -> f64;

fn taus(text: &str) -> Result<Taus, String> {
    match text {
        "octave" => Ok(Taus::Octave),
        "decade" => Ok(Taus::Decade),
        "all" => Ok(Taus::All),
        list => list
            .split(',')
            .map(|t| t.trim().parse().map_err(|_| format!("`{t}` is not octave, decade, all or a time in s")))
            .collect::<Result<_, _>>()
            .map(Taus::Seconds),
    }
}

impl AllanArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let names = self.gate.behind(&[&self.column]);
        let wanted = Wanted { numbers: &names, rate_hz: self.rate, time: TimeUse::Rate, ..Wanted::default() };
        let mut columns = Record::open(&self.file, OutputTriad::Gyro, reading)?.read(&wanted)?;
        let rate_hz = columns.rate_hz()?;
        let gated = self.gate.series(&self.column, &mut columns, !self.phase)?;
        let values = columns.numbers.swap_remove(0);
        let input = if self.phase { Input::Phase } else { Input::Rate };
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let analysis = allan::analyse(&values, input, rate_hz, self.dev.into(), &self.taus, threads)?;
        let rows = analysis
            .points
            .iter()
            .map(|p| {
                let noise = p.noise.map_or(Value::Null, |n| json!(n.to_string()));
                vec![json!(p.tau_s), json!(p.dev), json!(p.n), json!(p.edf), noise, json!(p.low), json!(p.high)]
            })
            .collect();
        let c = &analysis.coefficients;
        let named = [
            ("Q", "u s", c.q),
            ("N", "u sqrt(s)", c.n),
            ("B", "u", c.b),
            ("K", "u / sqrt(s)", c.k),
            ("R", "u / s", c.r),
        ];
        let reasons: serde_json::Map<String, Value> =
            named.iter().filter_map(|(k, _, c)| Some(((*k).to_owned(), c.err()?.to_string().into()))).collect();
        let mut report = FigureReport::new("allan");
        report
            .record(&columns)
            .put("deviation", "", format!("{:?}", self.dev).to_lowercase())
            .put("samples", "", values.len())
            .rows("points", &["tau_s", "dev", "n", "edf", "noise", "low", "high"], rows)
            .named(
                "coefficients",
                &["value", "low", "high", "unit u of the rate"],
                named.iter().map(|(k, unit, c)| (*k, *unit, c.map_or(Value::Null, interval))).collect(),
            )
            .put("reasons", "", Value::Object(reasons))
            .put("B_upper_bound", "smallest upper end of a 95 % interval / 0.664", json!(c.b_upper_bound));
        told(&mut report, &analysis);
        report.put("interval", "", "68.3 %").put("gate", "rows", gated.json());
        let points = || analysis.points.iter().map(|p| (p.tau_s, p.dev));
        let bars = analysis.points.iter().map(|p| (p.low, p.high)).collect();
        let mut series = vec![Series::new("deviation, 68.3 %", Mark::Bars(bars), points())];
        let slopes: [(&str, Result<Coefficient, MissingCoefficient>, Curve); 5] = [
            ("Q, slope -1", c.q, |c, t| 3.0_f64.sqrt() * c / t),
            ("N, slope -1/2", c.n, |c, t| c / t.sqrt()),
            ("B, flat", c.b, |c, _| 0.664_282 * c),
            ("K, slope +1/2", c.k, |c, t| c * (t / 3.0).sqrt()),
            ("R, slope +1", c.r, |c, t| c * t / 2.0_f64.sqrt()),
        ];
        for (name, c, curve) in slopes {
            if let Ok(c) = c {
                series.push(Series::line(name, points().map(|(t, _)| (t, curve(c.value, t)))));
            }
        }
        let title = format!("{} of {}", format!("{:?}", self.dev).to_lowercase(), self.column);
        let panel = Panel::new(title, "averaging time, s", "deviation", series).log();
        Ok(ComputeOutcome { report, panels: vec![panel] })
    }
}

fn interval(c: Coefficient) -> Value {
    json!({ "value": c.value, "low": c.low, "high": c.high })
}

/// Adds how well the fit holds, and N once more from the spectrum.
fn told(report: &mut FigureReport, analysis: &Analysis) {
    let fit = analysis.fit.as_ref().map_or(Value::Null, fit_json);
    let spectrum = analysis.plateau.as_ref().map_or(Value::Null, |plateau| {
        let n = plateau.n();
        json!({
            "value": n.value, "low": n.low, "high": n.high, "from_hz": plateau.from_hz, "to_hz": plateau.to_hz,
        })
    });
    let compared = match (analysis.coefficients.n, analysis.plateau) {
        (Err(MissingCoefficient::Contradicted { .. }), _) => "contradict each other",
        (Ok(_), Some(_)) => "agree",
        _ => "not compared",
    };
    report.put("fit", "", fit).put("N_psd", "u sqrt(s), by the plateau of the spectrum", spectrum);
    report.put("N_and_N_psd", "", compared);
}
