//! Tables in Apache Parquet. Reads only the wanted columns, which hold numbers or texts without nesting.

mod claims;
mod pages;
#[cfg(test)]
mod tests;
mod thrift;

use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use ::parquet::basic::{Compression, LogicalType, TimeUnit, Type};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use ::parquet::data_type::{ByteArray, DataType};
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, SerializedFileReader};

use super::columns::{ColumnPlan, Columns, Wanted};
use super::names::Header;
use super::number::{Decimal, Form};
use super::sheet::{self, Cells};
use super::source::{FREE_UNPACKED, MOST_UNPACKED};
use super::{MOST_VALUES, ReadingOptions, TableError, tell_size, time};
use claims::{Claim, Stretch};
use pages::{CheckedPages, guarded};

/// Records that are read at once.
const BATCH: usize = 1 << 16;
/// Largest number of different texts in a column: labels and names of captures, not prose.
const MOST_TEXTS: usize = 1 << 16;

/// A Parquet file whose schema was read.
pub(super) struct Sheet {
    path: PathBuf,
    /// The file once more, to look at its claims.
    file: File,
    reader: SerializedFileReader<File>,
    file_bytes: u64,
    pub(super) header: Header,
    /// For each name its leaf column, and its unit of time in s if it holds time stamps.
    leaves: Vec<(usize, Option<f64>)>,
}

impl Sheet {
    pub(super) fn open(path: &Path, file: File) -> Result<Self, TableError> {
        let fail = |source| TableError::Io { path: path.to_owned(), source };
        let file_bytes = file.metadata().map_err(fail)?.len();
        claims::check_footer(&file, file_bytes).map_err(|claim| refused(path, &claim))?;
        let read = file.try_clone().map_err(fail)?;
        let reader = guarded(|| SerializedFileReader::new(read)).map_err(|e| damaged(path, &e))?;
        let schema = reader.metadata().file_metadata().schema_descr();
        let mut texts = Vec::new();
        let mut leaves = Vec::new();
        for (leaf, column) in schema.columns().iter().enumerate() {
            // A list has not one row for each value.
            if column.max_rep_level() > 0 || column.path().parts().len() > 1 {
                continue;
            }
            let unit_s = match column.logical_type_ref() {
                Some(LogicalType::Timestamp(stamp)) => Some(match stamp.unit {
                    TimeUnit::MILLIS => 1e-3,
                    TimeUnit::MICROS => 1e-6,
                    TimeUnit::NANOS => 1e-9,
                }),
                _ => None,
            };
            texts.push(column.name().to_owned());
            leaves.push((leaf, unit_s));
        }
        let units =
            leaves.iter().map(|(_, unit)| if unit.is_some() { "s".to_owned() } else { String::new() }).collect();
        let header = Header::new(path, 1, texts, Some(units))?;
        Ok(Self { path: path.to_owned(), file, reader, file_bytes, header, leaves })
    }

    pub(super) fn read(
        self,
        wanted: &Wanted,
        reading: &ReadingOptions,
        sensor: Option<&str>,
    ) -> Result<Columns, TableError> {
        // The first cells tell what a column of time holds.
        let is_time: Vec<bool> = self.header.names.iter().map(time::is_time).collect();
        let times = (0..self.leaves.len()).filter(|place| is_time[*place]);
        times.clone().try_for_each(|place| self.check_pages(place))?;
        let mut first_row = vec![String::new(); self.leaves.len()];
        times.for_each(|place| first_row[place] = self.first(place));
        let form = Form::Known(Decimal::Point);
        let plan = ColumnPlan::new(&self.path, &self.header, (&first_row, form), wanted, reading, sensor)?;
        self.check_size(plan.roles.iter().map(|(place, _)| *place))?;
        plan.roles.iter().filter(|(place, _)| !is_time[*place]).try_for_each(|(place, _)| self.check_pages(*place))?;
        let rows = usize::try_from(self.reader.metadata().file_metadata().num_rows()).unwrap_or(usize::MAX);
        if rows.saturating_mul(plan.roles.len()) > MOST_VALUES {
            return Err(TableError::TooLarge { path: self.path.clone(), limit: MOST_VALUES });
        }
        tell_size(&self.path, rows.saturating_mul(plan.roles.len()), &mut false);
        // A column of one value takes a few bytes in the file, however many rows it has.
        let most_bytes = usize::try_from(Self::most_unpacked(self.file_bytes)).unwrap_or(usize::MAX);
        let most_rows = most_bytes / size_of::<f64>() / plan.roles.len().max(1);
        if rows > most_rows {
            return Err(self.swollen());
        }
        let cells = |place| {
            let cells = self.cells(place, most_rows.saturating_add(1))?;
            if cells.len() > most_rows { Err(self.swollen()) } else { Ok(cells) }
        };
        let cells = plan.roles.iter().map(|(place, _)| cells(*place)).collect::<Result<Vec<_>, _>>()?;
        let gathered = sheet::gather(&self.path, &plan, &cells)?;
        plan.finish(gathered, &["Parquet".to_owned()])
    }

    fn most_unpacked(packed: u64) -> u64 {
        FREE_UNPACKED.max(packed.saturating_mul(MOST_UNPACKED))
    }

    fn swollen(&self) -> TableError {
        let what = format!("it unpacks to more than {MOST_UNPACKED} times its size, so it is not a record");
        TableError::Damaged { path: self.path.clone(), what }
    }

    /// Refuses columns that unpack to more than a record of this size: pages are unpacked as a whole.
    fn check_size(&self, places: impl Iterator<Item = usize>) -> Result<(), TableError> {
        let groups = self.reader.metadata().row_groups();
        for place in places {
            let leaf = self.leaves[place].0;
            for column in groups.iter().filter_map(|group| group.columns().get(leaf)) {
                let sizes = [column.uncompressed_size(), column.compressed_size()];
                let [unpacked, packed] = sizes.map(|size| u64::try_from(size).unwrap_or(u64::MAX));
                if unpacked > Self::most_unpacked(packed) {
                    return Err(self.swollen());
                }
            }
        }
        Ok(())
    }

    /// Refuses a column whose pages claim what the file cannot hold.
    fn check_pages(&self, place: usize) -> Result<(), TableError> {
        let leaf = self.leaves[place].0;
        let columns = self.reader.metadata().row_groups().iter().filter_map(|group| group.columns().get(leaf));
        let stretches = columns.map(|column| Stretch {
            start: column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset()),
            bytes: column.compressed_size(),
            gzip: matches!(column.compression(), Compression::GZIP(_)),
        });
        claims::check_pages(&self.file, self.file_bytes, stretches, Self::most_unpacked)
            .map_err(|claim| refused(&self.path, &claim))
    }

    /// The first cell of a column as text; empty if it cannot be read.
    fn first(&self, place: usize) -> String {
        match self.cells(place, 1) {
            Ok(Cells::Numbers { values, .. }) => values.first().map_or(String::new(), f64::to_string),
            Ok(Cells::Texts { names, .. }) => names.first().cloned().unwrap_or_default(),
            Err(_) => String::new(),
        }
    }

    /// The first cells of a column, at most `most`. Its pages were checked.
    fn cells(&self, place: usize, most: usize) -> Result<Cells, TableError> {
        let read = guarded(|| Ok(self.cells_of(place, most)));
        read.unwrap_or_else(|error| Err(damaged(&self.path, &error)))
    }

    fn cells_of(&self, place: usize, most: usize) -> Result<Cells, TableError> {
        let (leaf, unit_s) = self.leaves[place];
        let failed = |e: &ParquetError| damaged(&self.path, e);
        let mut numbers = Numbers { values: Vec::new(), missing: Vec::new(), scale: unit_s.unwrap_or(1.0) };
        let mut texts = Texts::default();
        let column = self.reader.metadata().file_metadata().schema_descr().column(leaf);
        let is_text = matches!(column.physical_type(), Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY);
        for group in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(group).map_err(|e| failed(&e))?;
            let left = most - if is_text { texts.codes.len() } else { numbers.values.len() };
            if left == 0 {
                break;
            }
            let level = column.max_def_level();
            let pages = group.get_column_page_reader(leaf).map_err(|e| failed(&e))?;
            let reader = get_column_reader(column.clone(), Box::new(CheckedPages::new(pages, level > 0)));
            let pulled = match reader {
                ColumnReader::BoolColumnReader(r) => {
                    pull(r, level, left, |v| numbers.put(v.map(|v| f64::from(u8::from(*v)))))
                }
                ColumnReader::Int32ColumnReader(r) => pull(r, level, left, |v| numbers.put(v.map(|v| f64::from(*v)))),
                ColumnReader::Int64ColumnReader(r) => pull(r, level, left, |v| numbers.put(v.map(|v| *v as f64))),
                ColumnReader::FloatColumnReader(r) => pull(r, level, left, |v| numbers.put(v.map(|v| f64::from(*v)))),
                ColumnReader::DoubleColumnReader(r) => pull(r, level, left, |v| numbers.put(v.copied())),
                ColumnReader::ByteArrayColumnReader(r) => pull(r, level, left, |v| texts.put(v)),
                _ => Err(ParquetError::General(format!("column `{}` has a type that is not supported", column.name()))),
            };
            pulled.map_err(|e| failed(&e))?;
            if numbers.values.len() > MOST_VALUES || texts.codes.len() > MOST_VALUES || texts.names.len() > MOST_TEXTS {
                return Err(TableError::TooLarge { path: self.path.clone(), limit: MOST_VALUES });
            }
        }
        if is_text {
            return Ok(Cells::Texts { names: texts.names, codes: texts.codes });
        }
        Ok(Cells::Numbers { values: numbers.values, missing: numbers.missing })
    }
}

fn refused(path: &Path, claim: &Claim) -> TableError {
    TableError::Damaged { path: path.to_owned(), what: format!("cannot be read as Parquet: {claim}") }
}

fn damaged(path: &Path, error: &ParquetError) -> TableError {
    let why = match error {
        ParquetError::General(why) => why.clone(),
        error => error.to_string(),
    };
    TableError::Damaged { path: path.to_owned(), what: format!("cannot be read as Parquet: {why}") }
}

struct Numbers {
    values: Vec<f64>,
    missing: Vec<usize>,
    scale: f64,
}

impl Numbers {
    fn put(&mut self, value: Option<f64>) {
        if value.is_none() {
            self.missing.push(self.values.len());
        }
        let scaled = value.map(|v| if self.scale == 1.0 { v } else { v * self.scale });
        self.values.push(scaled.unwrap_or(f64::NAN));
    }
}

#[derive(Default)]
struct Texts {
    names: Vec<String>,
    codes: Vec<u32>,
    known: HashMap<String, u32>,
}

impl Texts {
    fn put(&mut self, value: Option<&ByteArray>) {
        let text = value.map_or(String::new(), |v| String::from_utf8_lossy(v.data()).into_owned());
        let next = self.names.len() as u32;
        let code = *self.known.entry(text).or_insert_with_key(|text| {
            self.names.push(text.clone());
            next
        });
        self.codes.push(code);
    }
}

/// Passes the cells of a column of one row group to `put`, at most `most`. `None` is a cell without a value.
fn pull<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    level: i16,
    most: usize,
    mut put: impl FnMut(Option<&T::T>),
) -> Result<(), ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    let mut left = most;
    while left > 0 {
        levels.clear();
        values.clear();
        let (records, _, _) = reader.read_records(left.min(BATCH), Some(&mut levels), None, &mut values)?;
        if records == 0 {
            break;
        }
        if level == 0 {
            values.iter().for_each(|value| put(Some(value)));
        } else {
            let mut present = values.iter();
            levels.iter().for_each(|l| put(if *l == level { present.next() } else { None }));
        }
        left -= records;
    }
    Ok(())
}
