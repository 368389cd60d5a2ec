//! Bias elimination on a record of several power cycles.

use std::path::PathBuf;

use clap::Args;
use gnc_metrology::zero_bias::{BiasModel, Eliminator, Kalman, StillDetector, Stored, ZeroBiasSettings};
use gnc_metrology::{series, stats};
use gnc_plot::{Panel, Series};
use serde_json::{Value, json};

use super::gate::GateColumns;
use super::report::FigureReport;
use super::table::{ReadingOptions, RecordTable, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

#[derive(Debug, Args)]
pub(super) struct ZeroBias {
    /// Column of rates; optional columns: cycle (number of the power cycle), still (0 = still)
    file: PathBuf,
    /// Sample rate, Hz; by default that of the time column or of the raw capture
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Column of rates
    #[arg(long, value_name = "NAME", default_value = "w")]
    column: String,
    /// Number of samples over which the measured bias replaces the stored one
    #[arg(long, default_value_t = ZeroBiasSettings::default().fusion)]
    fusion: usize,
    /// Number of still samples in a block
    #[arg(long, default_value_t = ZeroBiasSettings::default().block)]
    block: usize,
    /// Number of blocks in the ring
    #[arg(long, default_value_t = ZeroBiasSettings::default().ring)]
    ring: usize,
    /// Number of stored biases
    #[arg(long, default_value_t = ZeroBiasSettings::default().slots)]
    slots: usize,
    /// Number of consecutive still samples before a bias is stored
    #[arg(long, default_value_t = ZeroBiasSettings::default().rest)]
    rest: usize,
    /// Change of the bias from one power-on to the next, unit of the record (for the inverse-variance fusion)
    #[arg(long, value_name = "SD", requires = "instability")]
    repeatability: Option<f64>,
    /// Allan coefficient B, unit of the record (for the inverse-variance fusion)
    #[arg(long, value_name = "B", requires = "repeatability")]
    instability: Option<f64>,
    #[command(flatten)]
    gate: GateColumns,
}

impl ZeroBias {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let settings = ZeroBiasSettings {
            fusion: self.fusion,
            block: self.block,
            ring: self.ring,
            slots: self.slots,
            rest: self.rest,
        };
        settings.check()?;
        let table = RecordTable::open(&self.file, reading)?;
        let (has_cycle, has_still) = (table.has("cycle"), table.has("still"));
        let mut names = vec![self.column.as_str()];
        names.extend(has_cycle.then_some("cycle"));
        names.extend(has_still.then_some("still"));
        // Time starts anew with each power cycle.
        let anew = has_cycle.then_some(1);
        let names = self.gate.behind(&names);
        let wanted = Wanted { numbers: &names, rate_hz: self.rate, time: TimeUse::Rate, anew, ..Wanted::default() };
        let mut columns = table.read(&wanted, None)?;
        let rate_hz = series::positive("rate (Hz)", columns.rate_hz()?)?;
        series::finite(&self.column, &columns.numbers[0])?;
        let cycles = series::stretches(columns.numbers[0].len(), |a, b| {
            !has_cycle || columns.numbers[1][a] == columns.numbers[1][b]
        });
        let gated = self.gate.stretches_of_series(&self.column, &mut columns, &cycles, false)?;
        let rates = &columns.numbers[0];
        let cycle_of = |i: usize| if has_cycle { columns.numbers[1][i] } else { 0.0 };
        let mut steps: Vec<f64> = rates.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        // The median of |difference| of normal noise is 0.954 of its standard deviation; motion does not change the
        // median.
        let noise = series::positive("noise of a sample", stats::median(&mut steps) / 0.953_87)?;
        let model = self.repeatability.zip(self.instability).map(|(repeatability, b)| BiasModel {
            repeatability,
            n: noise / rate_hz.sqrt(),
            b,
            rate_hz,
        });

        let (mut stored, mut stored_by_kalman) = (Stored::default(), Stored::default());
        let mut rows = Vec::new();
        let (mut corrected, mut biases) = (Vec::new(), Vec::new());
        let mut start = 0;
        while start < rates.len() {
            let end = (start..rates.len()).find(|&i| cycle_of(i) != cycle_of(start)).unwrap_or(rates.len());
            let mut eliminator = Eliminator::new(settings, stored.clone())?;
            let mut kalman = model.as_ref().map(|m| Kalman::new(m, &stored_by_kalman)).transpose()?;
            let mut detector = StillDetector::new(settings.block.max(10), noise)?;
            let (mut before, mut after, mut by_kalman) = (Vec::new(), Vec::new(), Vec::new());
            let mut writes = 0;
            for (i, &rate) in rates.iter().enumerate().take(end).skip(start) {
                let detected = detector.step(rate);
                let still = if has_still { columns.numbers[1 + usize::from(has_cycle)][i] == 0.0 } else { detected };
                let out = eliminator.step(rate, still);
                if let Some(new) = out.store {
                    stored = new;
                    writes += 1;
                }
                let fused = kalman.as_mut().map(|k| k.step(rate, still));
                if still {
                    corrected.push((i as f64 / rate_hz, out.rate));
                    before.push(rate);
                    if i - start >= settings.fusion {
                        after.push(out.rate);
                        by_kalman.extend(fused);
                    }
                }
                biases.push((i as f64 / rate_hz, out.bias));
            }
            if let Some(kalman) = kalman.filter(|k| k.sd().is_finite()) {
                stored_by_kalman.push(kalman.bias(), settings.slots);
            }
            let mean = |v: &[f64]| if v.is_empty() { Value::Null } else { json!(stats::mean(v)) };
            rows.push(vec![
                json!(cycle_of(start)),
                json!(end - start),
                json!(before.len()),
                mean(&before),
                mean(&after),
                json!(eliminator.bias()),
                json!(writes),
                mean(&by_kalman),
            ]);
            start = end;
        }
        let rms = |column: usize| {
            let values: Vec<f64> = rows.iter().filter_map(|r| r[column].as_f64()).collect();
            (!values.is_empty()).then(|| stats::rms(&values))
        };
        let (before, after, fused) = (rms(3), rms(4), rms(7));
        let by_cycle =
            |column: usize| rows.iter().filter_map(|r| Some((r[0].as_f64()?, r[column].as_f64()?))).collect::<Vec<_>>();
        let means = vec![Series::dots("before", by_cycle(3)), Series::dots("after", by_cycle(4))];
        let rates = vec![Series::dots("corrected, at rest", corrected), Series::line("bias", biases)];
        let panels = vec![
            Panel::new(format!("Bias elimination of {}", self.column), "time, s", "rate", rates),
            Panel::new("Means at rest", "power cycle", "rate", means),
        ];
        let mut report = FigureReport::new("zero-bias");
        report
            .record(&columns)
            .put("noise", "of a sample, unit of the record", noise)
            .rows(
                "cycles",
                &["cycle", "samples", "still", "before", "after", "bias", "writes", "inverse_variance"],
                rows,
            )
            .put("rms_before", "of the cycles' means at rest", json!(before))
            .put("rms_after", "after the fusion", json!(after))
            .put("rms_inverse_variance", "with --repeatability and --instability", json!(fused))
            .put("stored", "", json!(stored.biases()))
            .put("gate", "rows", gated.json());
        Ok(ComputeOutcome { report, panels })
    }
}
