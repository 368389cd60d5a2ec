//! Spectra and the stability of block means.

use std::path::PathBuf;

use clap::Args;
use gnc_metrology::{psd, stability};
use gnc_plot::{Panel, Series};
use serde_json::{Value, json};

use super::gate::{GateColumns, Gated};
use super::record::{OutputTriad, Record};
use super::report::FigureReport;
use super::table::{Columns, ReadingOptions, TimeUse, Wanted};
use super::{ComputeError, ComputeOutcome};

/// One column of a record with a rate.
#[derive(Debug, Args)]
struct Source {
    /// Table with a header row
    file: PathBuf,
    /// Sample rate, Hz; by default that of the time column or of the raw capture
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Column to analyse
    #[arg(long, value_name = "NAME")]
    column: String,
    #[command(flatten)]
    gate: GateColumns,
}

/// Relative tolerance within which a block counts as a whole number of samples.
const WHOLE: f64 = 1e-6;

/// The column that was read.
struct Sampled {
    values: Vec<f64>,
    rate_hz: f64,
    columns: Columns,
    gated: Gated,
}

impl Source {
    fn read(&self, reading: &ReadingOptions) -> Result<Sampled, ComputeError> {
        let names = self.gate.behind(&[&self.column]);
        let wanted = Wanted { numbers: &names, rate_hz: self.rate, time: TimeUse::Rate, ..Wanted::default() };
        let mut columns = Record::open(&self.file, OutputTriad::Gyro, reading)?.read(&wanted)?;
        let gated = self.gate.series(&self.column, &mut columns, true)?;
        let values = columns.numbers.swap_remove(0);
        Ok(Sampled { values, rate_hz: columns.rate_hz()?, columns, gated })
    }
}

#[derive(Debug, Args)]
pub(super) struct PsdArgs {
    #[command(flatten)]
    source: Source,
    /// Samples of a segment
    #[arg(long, value_name = "N", default_value_t = 1024)]
    segment: usize,
}

impl PsdArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let Sampled { values, rate_hz, columns, gated } = self.source.read(reading)?;
        let psd = psd::welch(&values, rate_hz, self.segment)?;
        let plateau = psd::RobustSpectrum::of(&values, rate_hz).and_then(|spectrum| spectrum.without_lines().plateau());
        let n = plateau.map_or(Value::Null, |plateau| {
            let n = plateau.n();
            json!({ "value": n.value, "low": n.low, "high": n.high, "from_hz": plateau.from_hz, "to_hz": plateau.to_hz })
        });
        let mut report = FigureReport::new("psd");
        report
            .record(&columns)
            .put("frequency_hz", "", json!(psd.frequency_hz))
            .put("density", "unit^2 / Hz, one-sided", json!(psd.density))
            .put("segments", "Hann, 50 % overlap", psd.segments)
            .put("N_psd", "unit sqrt(s), by the plateau of the spectrum, 68.3 %", n)
            .put("gate", "rows", gated.json());
        let points = psd.frequency_hz.iter().copied().zip(psd.density.iter().copied()).skip(1);
        let title = format!("Spectrum of {}", self.source.column);
        let series = vec![Series::line("Welch", points)];
        let panel = Panel::new(title, "frequency, Hz", "density, unit^2 / Hz", series).log();
        Ok(ComputeOutcome { report, panels: vec![panel] })
    }
}

#[derive(Debug, Args)]
pub(super) struct StabilityArgs {
    #[command(flatten)]
    source: Source,
    /// Length of a block, s
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    block: f64,
}

impl StabilityArgs {
    pub(super) fn compute(&self, reading: &ReadingOptions) -> Result<ComputeOutcome, ComputeError> {
        let Sampled { values, rate_hz, mut columns, gated } = self.source.read(reading)?;
        let block_s = self.block_s(rate_hz, &mut columns);
        let s = stability::stability(&values, rate_hz, block_s)?;
        let mut report = FigureReport::new("stability");
        report
            .record(&columns)
            .put("blocks", "", s.block_means.len())
            .put("mean", "unit of the record", s.mean)
            .put("sd", "n - 1", s.sd)
            .put("sd_low", "95 %, block means taken as independent", s.sd_low)
            .put("sd_high", "", s.sd_high)
            .put("resolution_of_a_mean", "standard uncertainty of a mean from the steps of the output", s.resolution_sd)
            .put("block_samples", "", s.block_samples)
            .put("tail_samples", "dropped", s.tail_samples)
            .put("block_means", "", json!(s.block_means))
            .put("gate", "rows", gated.json());
        let points = s.block_means.iter().enumerate().map(|(i, m)| ((i as f64 + 0.5) * block_s, *m));
        let title = format!("Block means of {}", self.source.column);
        let panel = Panel::new(title, "time, s", "mean of a block", vec![Series::dots("blocks", points)]);
        Ok(ComputeOutcome { report, panels: vec![panel] })
    }
    /// Length of a block, s. It is rounded to whole samples if clocks gave the rate, since such a rate is not a whole
    /// number.
    fn block_s(&self, rate_hz: f64, columns: &mut Columns) -> f64 {
        let whole = (rate_hz * self.block).round();
        let block_s = whole / rate_hz;
        let fits = (block_s / self.block - 1.0).abs() < WHOLE;
        // A block that does not fit a stated rate is a mistake; the method refuses it.
        if fits || whole < 1.0 || !whole.is_finite() || self.source.rate.is_some() {
            return self.block;
        }
        columns.about.understood.push(format!("blocks of {whole} samples, {block_s:.6} s"));
        block_s
    }
}
