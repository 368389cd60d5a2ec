//! The gate on the columns that a method reads. It stands before every method.

use std::ops::Range;

use clap::Args;
use gnc_metrology::gate::{RecordLayout, RowMeaning, Screening, one_stretch};
use gnc_metrology::{Refusal, series};
use serde_json::{Value, json};

use super::table::Columns;

/// What the gate looks at beside the columns of the method.
#[derive(Debug, Args)]
pub(super) struct GateColumns {
    /// More columns, separated by commas: their failed reads, spikes and stale rows make a row bad too
    #[arg(long = "gate-columns", value_name = "COLUMNS", value_delimiter = ',')]
    names: Vec<String>,
}

/// Rows of a record that passed the gate.
pub(super) struct Gated {
    screening: Screening,
    replaced: bool,
}

impl GateColumns {
    /// The columns of a method, followed by those of the gate.
    pub(super) fn behind<'a>(&'a self, own: &[&'a str]) -> Vec<&'a str> {
        own.iter().copied().chain(self.names.iter().map(String::as_str)).collect()
    }

    /// Screens still positions: stretches of one label, or of one direction in the columns behind the chip's. Bad rows
    /// are dropped.
    pub(super) fn positions(
        &self,
        chip: &[&str],
        columns: &mut Columns,
        range_end: Option<f64>,
    ) -> Result<Gated, Refusal> {
        let rows = columns.numbers.first().map_or(0, Vec::len);
        let directions = columns.numbers.get(chip.len()..columns.numbers.len() - self.names.len()).unwrap_or_default();
        let blocks = match columns.labels.is_empty() {
            true => series::stretches(rows, |a, b| directions.iter().all(|values| values[a] == values[b])),
            false => series::stretches(rows, |a, b| columns.labels[a] == columns.labels[b]),
        };
        let layout = RecordLayout { blocks: &blocks, still: true, range_end };
        let gated = self.screen(chip, columns, &layout, RowMeaning::Samples)?;
        gated.keep(columns);
        Ok(gated)
    }

    /// Screens levels. A level lasts as long as the columns at these places stay the same. Bad rows are dropped. A
    /// level of one row has no row to compare with, and passes.
    pub(super) fn levels(&self, chip: &[&str], columns: &mut Columns, by: &[usize]) -> Result<Gated, Refusal> {
        let numbers = &columns.numbers;
        let rows = numbers.first().map_or(0, Vec::len);
        let blocks = series::stretches(rows, |a, b| by.iter().all(|column| numbers[*column][a] == numbers[*column][b]));
        let gated = self.screen(
            chip,
            columns,
            &RecordLayout { blocks: &blocks, still: true, range_end: None },
            RowMeaning::Samples,
        )?;
        gated.keep(columns);
        Ok(gated)
    }

    /// Screens points of a curve. Bad rows are dropped.
    pub(super) fn points(
        &self,
        chip: &[&str],
        columns: &mut Columns,
        range_end: Option<f64>,
    ) -> Result<Gated, Refusal> {
        let blocks = one_stretch(columns.numbers.first().map_or(0, Vec::len));
        let layout = RecordLayout { blocks: &blocks, still: false, range_end };
        let gated = self.screen(chip, columns, &layout, RowMeaning::Samples)?;
        gated.keep(columns);
        Ok(gated)
    }

    /// Screens runs of one label that are integrated. Bad rows are bridged.
    pub(super) fn motion(
        &self,
        chip: &[&str],
        columns: &mut Columns,
        range_end: Option<f64>,
    ) -> Result<Gated, Refusal> {
        let labels = &columns.labels;
        let blocks = series::stretches(labels.len(), |a, b| labels[a] == labels[b]);
        let layout = RecordLayout { blocks: &blocks, still: false, range_end };
        let gated = self.screen(chip, columns, &layout, RowMeaning::Steps)?;
        if gated.screening.left_out().total() > 0 {
            for (name, values) in chip.iter().zip(&mut columns.numbers) {
                *values = gated.screening.bridged(name, values, &blocks)?;
            }
        }
        Ok(gated)
    }

    /// Screens one column over time. Bad rows are refilled.
    pub(super) fn series(&self, column: &str, columns: &mut Columns, still: bool) -> Result<Gated, Refusal> {
        let blocks = one_stretch(columns.numbers.first().map_or(0, Vec::len));
        self.stretches_of_series(column, columns, &blocks, still)
    }

    /// Screens one column over time, in stretches. The time between stretches is unknown. Bad rows are refilled.
    pub(super) fn stretches_of_series(
        &self,
        column: &str,
        columns: &mut Columns,
        blocks: &[Range<usize>],
        still: bool,
    ) -> Result<Gated, Refusal> {
        let layout = RecordLayout { blocks, still, range_end: None };
        let gated = self.screen(&[column], columns, &layout, RowMeaning::Steps)?;
        if gated.screening.left_out().total() > 0 {
            columns.numbers[0] = gated.screening.refilled(&columns.numbers[0], blocks);
        }
        Ok(gated)
    }

    /// Screens the first columns, which belong to one chip, and the last columns, which belong to the gate and are
    /// dropped.
    ///
    /// # Errors
    /// A value that is not finite, and what [`Screening::admit`] refuses.
    fn screen(
        &self,
        chip: &[&str],
        columns: &mut Columns,
        layout: &RecordLayout<'_>,
        rows: RowMeaning,
    ) -> Result<Gated, Refusal> {
        let own = columns.numbers.len() - self.names.len();
        let others = columns.numbers.split_off(own);
        columns.names.truncate(own);
        columns.units.truncate(own);
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();

        for (name, values) in chip.iter().zip(&columns.numbers) {
            series::signed(name, values)?;
        }
        let mut screening = Screening::of(chip, &slices(&columns.numbers[..chip.len()]), layout);
        if !others.is_empty() {
            series::channels(&names, &slices(&others))?;
            let layout = RecordLayout { still: false, range_end: None, ..*layout };
            screening = screening.and(Screening::of(&names, &slices(&others), &layout));
        }
        if screening.left_out().total() > 0 {
            // Check here: as long as no row is dropped, the row in a refusal is the row in the file.
            series::channels(chip, &slices(&columns.numbers[..chip.len()]))?;
        }
        screening.admit(match rows {
            RowMeaning::Steps if columns.about.clock.is_checked() => RowMeaning::ClockedSteps,
            other => other,
        })?;
        Ok(Gated { screening, replaced: rows != RowMeaning::Samples })
    }
}

impl Gated {
    /// Drops the rows that are left out.
    fn keep(&self, columns: &mut Columns) {
        if self.screening.left_out().total() == 0 {
            return;
        }
        for values in &mut columns.numbers {
            *values = self.screening.kept(values);
        }
        columns.labels = self.screening.kept(&columns.labels);
    }

    /// The result of the gate for the report.
    pub(super) fn json(&self) -> Value {
        let left_out = self.screening.left_out();
        let mut gate = json!({
            "used": self.screening.used(),
            "left_out": {
                "failed_reads": left_out.failed_reads,
                "spikes": left_out.spikes,
                "stale": left_out.stale,
                "clipped": left_out.clipped,
            },
            "first_row": self.screening.first_row(),
        });
        if left_out.total() > 0 {
            gate["in_their_place"] = json!(if self.replaced { "values like their neighbours" } else { "nothing" });
        }
        if let Some(rows) = self.screening.rows_per_update() {
            gate["rows_per_update"] = json!(rows);
        }
        gate
    }
}

fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}
