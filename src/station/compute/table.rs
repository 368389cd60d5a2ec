//! Reads records as tables, in the forms that people have: text of every kind, Parquet, arrays of numpy.
//!
//! The reader takes what is unambiguous, and says what it understood. It refuses what is ambiguous, and names the
//! option that decides it. It checks a time column and does not hand it on.

mod columns;
mod error;
mod gathered;
mod names;
mod npy;
mod number;
mod parquet;
mod pieces;
mod plain;
mod preamble;
mod rows;
mod sheet;
mod source;
#[cfg(test)]
mod tests;
mod text;
mod time;
mod units;

use std::path::Path;

use gnc_text::shown_path;

use crate::refusal::complain;
pub(super) use columns::{About, Columns, RecordClock, TimeUse, Wanted};
pub(super) use error::TableError;
pub(super) use number::Decimal;
use pieces::PIECE;
use source::Source;
pub(super) use units::Named;

/// Longest line of a record, bytes.
const LONGEST_LINE: usize = 1 << 20;
/// Largest number of values in the columns of a method: 4 GB of memory, and a day of six channels at 1 kHz.
const MOST_VALUES: usize = 1 << 29;

/// Number of values that is worth a word. An Allan deviation of 66 million takes 1.16 GB, and a spectrum less.
const WORTH_A_WORD: usize = 50_000_000;

/// Says once that a record takes much memory.
pub(super) fn tell_size(path: &Path, values: usize, told: &mut bool) {
    if values > WORTH_A_WORD && !std::mem::replace(told, true) {
        complain(
            format_args!(
                "{} has more than {WORTH_A_WORD} values: with the work on them they may take more than 1 GB of memory",
                shown_path(path)
            ),
            "give a shorter stretch of the record if this computer has less",
        );
    }
}

/// How records are read, where the file leaves it open.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct ReadingOptions {
    /// The decimal sign, if the file does not show which one it uses
    #[arg(long, global = true, value_enum, value_name = "SIGN")]
    pub(super) decimal: Option<Decimal>,
    /// Allowed difference between the time column and the stated rate, ppm [default: 10 for rotation, else 1000]
    #[arg(long, global = true, value_name = "PPM")]
    pub(super) rate_tolerance: Option<f64>,
    /// The one capture of an export that is wanted.
    #[arg(skip)]
    pub(super) capture: Option<String>,
}

/// A table whose header has been read.
pub(super) struct RecordTable {
    reading: ReadingOptions,
    form: Form,
}

enum Form {
    Text(Box<text::Text>),
    Parquet(Box<parquet::Sheet>),
    Array(Box<npy::Array>),
}

impl RecordTable {
    /// Opens a file (`-` is standard input) and reads its header.
    pub(super) fn open(path: &Path, reading: &ReadingOptions) -> Result<Self, TableError> {
        Self::of(path, source::open(path)?, PIECE, reading)
    }

    /// Reads a text in pieces of about this many bytes.
    #[cfg(any(test, fuzzing))]
    pub(super) fn from_reader(path: &Path, source: Box<dyn std::io::Read>, piece: usize) -> Result<Self, TableError> {
        Self::of(path, source::of(path, source)?, piece, &ReadingOptions::default())
    }

    fn of(path: &Path, source: Source, piece: usize, reading: &ReadingOptions) -> Result<Self, TableError> {
        let form = match source {
            Source::Text(source, understood) => {
                Form::Text(Box::new(text::Text::open(path, source, piece, understood, reading)?))
            }
            Source::Npy(source, understood) => Form::Array(Box::new(npy::Array::open(path, source, understood)?)),
            Source::Parquet(file) => Form::Parquet(Box::new(parquet::Sheet::open(path, file)?)),
        };
        Ok(Self { reading: reading.clone(), form })
    }

    fn header(&self) -> &names::Header {
        match &self.form {
            Form::Text(text) => &text.preamble.header,
            Form::Parquet(sheet) => &sheet.header,
            Form::Array(array) => &array.header,
        }
    }

    /// Whether the header has a column. A name that fits two columns is refused when it is read.
    pub(super) fn has(&self, name: &str) -> bool {
        !matches!(self.header().find(name), Ok(None))
    }

    /// Reads the wanted columns. Within one label time must rise without a gap. In a table of several sensors `sensor`
    /// says whose `x`, `y` and `z` are wanted.
    pub(super) fn read(self, wanted: &Wanted, sensor: Option<&str>) -> Result<Columns, TableError> {
        match self.form {
            Form::Text(text) => text.read(wanted, &self.reading, sensor),
            Form::Parquet(sheet) => sheet.read(wanted, &self.reading, sensor),
            Form::Array(array) => array.read(wanted, &self.reading, sensor),
        }
    }
}
