//! Arrays of numpy (`.npy`): one column, columns side by side, or records with names.
//!
//! The header is a Python literal (NEP 1): `{'descr': '<f8', 'fortran_order': False, 'shape': (100, 3), }`. There
//! `descr` is a type or a list of names and types.

use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::columns::{ColumnPlan, Columns, Wanted};
use super::names::Header;
use super::number::{Decimal, Form};
use super::sheet::{self, Cells};
use super::{MOST_VALUES, ReadingOptions, TableError, tell_size};

/// Longest header: numpy itself refuses longer ones.
const LONGEST_HEADER: usize = 10_000;
/// Longest text of a record, bytes.
const LONGEST_TEXT: usize = 256;

/// An array whose header was read.
pub(super) struct Array {
    path: PathBuf,
    source: Box<dyn Read>,
    pub(super) header: Header,
    fields: Vec<Field>,
    rows: usize,
    /// The array is stored column by column and not row by row.
    by_columns: bool,
    /// Columns have numbers in place of names.
    unnamed: bool,
    understood: Vec<String>,
}

/// The type of a field: its letter, bytes and order.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Field {
    kind: u8,
    bytes: usize,
    big: bool,
}

impl Array {
    pub(super) fn open(path: &Path, mut source: Box<dyn Read>, understood: Vec<String>) -> Result<Self, TableError> {
        let damaged = |what: &str| TableError::Damaged { path: path.to_owned(), what: format!("numpy array: {what}") };
        let fail = |source| TableError::Io { path: path.to_owned(), source };
        let mut start = [0; 8];
        source.read_exact(&mut start).map_err(fail)?;
        let mut length = vec![0; if start[6] == 1 { 2 } else { 4 }];
        source.read_exact(&mut length).map_err(fail)?;
        let length = length.iter().rev().fold(0, |sum, byte| sum * 256 + usize::from(*byte));
        if length > LONGEST_HEADER {
            return Err(damaged("its header is too long"));
        }
        let mut text = vec![0; length];
        source.read_exact(&mut text).map_err(fail)?;
        let text = String::from_utf8_lossy(&text);
        let entry = |key: &str| text.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
        let (Some(descr), Some(order), Some(shape)) = (entry("descr"), entry("fortran_order"), entry("shape")) else {
            return Err(damaged("its header is not understood"));
        };
        let shape = shape.strip_prefix('(').and_then(|s| s.split_once(')')).map_or("", |(inner, _)| inner);
        let sizes: Vec<usize> = shape
            .split(',')
            .map(str::trim)
            .filter(|size| !size.is_empty())
            .map(|size| size.parse().map_err(|_| damaged("its shape is not understood")))
            .collect::<Result<_, _>>()?;
        let (names, fields, unnamed) = if descr.starts_with('[') {
            let (names, fields) = records(descr).ok_or_else(|| damaged("its records are not understood"))?;
            (names, fields, false)
        } else {
            let field = quoted(descr).and_then(Field::of).ok_or_else(|| damaged("its type is not supported"))?;
            let columns = if sizes.len() == 2 { sizes[1] } else { 1 };
            if columns > 1000 {
                return Err(damaged("it has more than 1000 columns; are rows and columns exchanged?"));
            }
            ((0..columns).map(|column| column.to_string()).collect(), vec![field; columns], true)
        };
        let rows = match sizes.as_slice() {
            [rows] => *rows,
            [rows, _] if unnamed => *rows,
            _ => return Err(damaged(&format!("its shape is ({shape}); it must have one or two dimensions"))),
        };
        let header = Header::new(path, 1, names, None)?;
        let by_columns = order.starts_with("True");
        Ok(Self { path: path.to_owned(), source, header, fields, rows, by_columns, unnamed, understood })
    }

    pub(super) fn read(
        mut self,
        wanted: &Wanted,
        reading: &ReadingOptions,
        sensor: Option<&str>,
    ) -> Result<Columns, TableError> {
        if self.rows.saturating_mul(self.fields.len()) > MOST_VALUES {
            return Err(TableError::TooLarge { path: self.path.clone(), limit: MOST_VALUES });
        }
        tell_size(&self.path, self.rows.saturating_mul(self.fields.len()), &mut false);
        let mut understood = std::mem::take(&mut self.understood);
        understood.push("numpy array".to_owned());
        let by_name = wanted.numbers.iter().all(|name| matches!(self.header.find(name), Ok(Some(_))));
        if self.unnamed && !by_name && wanted.label.is_none() && wanted.numbers.len() == self.fields.len() {
            let names: Vec<String> = wanted.numbers.iter().map(|name| (*name).to_owned()).collect();
            understood.push(format!("columns by order: {}", names.join(", ")));
            self.header = Header::new(&self.path, 1, names, None)?;
        }
        let cells = self.cells()?;
        let first = |cells: &Cells| match cells {
            Cells::Numbers { values, .. } => values.first().map_or(String::new(), f64::to_string),
            Cells::Texts { names, .. } => names.first().cloned().unwrap_or_default(),
        };
        let first_row: Vec<String> = cells.iter().map(first).collect();
        let form = Form::Known(Decimal::Point);
        let plan = ColumnPlan::new(&self.path, &self.header, (&first_row, form), wanted, reading, sensor)?;
        let mut cells: Vec<Option<Cells>> = cells.into_iter().map(Some).collect();
        let mut used = Vec::new();
        for (k, (place, _)) in plan.roles.iter().enumerate() {
            // A column that is wanted twice is copied from its first place.
            let again = plan.roles[..k].iter().position(|(other, _)| other == place);
            let taken = cells[*place].take().or_else(|| again.map(|i| copied(&used[i])));
            used.extend(taken);
        }
        let gathered = sheet::gather(&self.path, &plan, &used)?;
        plan.finish(gathered, &understood)
    }

    /// All columns, in the order of the header.
    fn cells(&mut self) -> Result<Vec<Cells>, TableError> {
        let fail = |source| TableError::Io { path: self.path.clone(), source };
        let empty = |field: &Field| match field.kind {
            b'U' | b'S' => Cells::Texts { names: Vec::new(), codes: Vec::new() },
            _ => Cells::Numbers { values: Vec::new(), missing: Vec::new() },
        };
        let mut cells: Vec<Cells> = self.fields.iter().map(empty).collect();
        let mut known: Vec<HashMap<String, u32>> = vec![HashMap::new(); self.fields.len()];
        let mut put = |column: usize, bytes: &[u8]| match &mut cells[column] {
            Cells::Numbers { values, .. } => values.push(self.fields[column].number(bytes)),
            Cells::Texts { names, codes } => {
                let text = self.fields[column].text(bytes);
                let next = names.len() as u32;
                let code = *known[column].entry(text).or_insert_with_key(|text| {
                    names.push(text.clone());
                    next
                });
                codes.push(code);
            }
        };
        if self.by_columns {
            for (column, field) in self.fields.iter().enumerate() {
                let mut cell = vec![0; field.bytes];
                for _ in 0..self.rows {
                    self.source.read_exact(&mut cell).map_err(fail)?;
                    put(column, &cell);
                }
            }
            return Ok(cells);
        }
        let mut row = vec![0; self.fields.iter().map(|field| field.bytes).sum()];
        for _ in 0..self.rows {
            self.source.read_exact(&mut row).map_err(fail)?;
            let mut at = 0;
            for (column, field) in self.fields.iter().enumerate() {
                put(column, &row[at..at + field.bytes]);
                at += field.bytes;
            }
        }
        Ok(cells)
    }
}

fn copied(cells: &Cells) -> Cells {
    match cells {
        Cells::Numbers { values, missing } => Cells::Numbers { values: values.clone(), missing: missing.clone() },
        Cells::Texts { names, codes } => Cells::Texts { names: names.clone(), codes: codes.clone() },
    }
}

/// Names and types of `[('t', '<f8'), ('x', '<i4')]`.
fn records(descr: &str) -> Option<(Vec<String>, Vec<Field>)> {
    let inner = descr.strip_prefix('[')?.split_once(']')?.0;
    let mut words = inner.split('\'').skip(1).step_by(2);
    let (mut names, mut fields) = (Vec::new(), Vec::new());
    while let Some(name) = words.next() {
        fields.push(Field::of(words.next()?)?);
        names.push(name.to_owned());
    }
    // Fields of several values would shift all columns behind them.
    let plain = inner.matches('(').count() == names.len();
    (plain && !names.is_empty()).then_some((names, fields))
}

fn quoted(text: &str) -> Option<&str> {
    text.strip_prefix('\'')?.split('\'').next()
}

impl Field {
    fn of(text: &str) -> Option<Self> {
        let mut chars = text.chars();
        let big = match chars.next()? {
            '<' | '|' | '=' => false,
            '>' => true,
            _ => return None,
        };
        let kind = u8::try_from(chars.next()?).ok()?;
        let size: usize = chars.as_str().parse().ok()?;
        let fits = match kind {
            b'f' => matches!(size, 4 | 8),
            b'i' | b'u' => matches!(size, 1 | 2 | 4 | 8),
            b'b' => size == 1,
            b'U' | b'S' => (1..=LONGEST_TEXT).contains(&size),
            _ => false,
        };
        fits.then_some(Self { kind, bytes: if kind == b'U' { 4 * size } else { size }, big })
    }

    fn number(self, bytes: &[u8]) -> f64 {
        let mut little = [0; 8];
        for (to, from) in little.iter_mut().zip(0..bytes.len()) {
            *to = if self.big { bytes[bytes.len() - 1 - from] } else { bytes[from] };
        }
        let bits = u64::from_le_bytes(little);
        match (self.kind, self.bytes) {
            (b'f', 8) => f64::from_bits(bits),
            (b'f', _) => f64::from(f32::from_bits(bits as u32)),
            (b'i', size) => {
                let unused = 64 - 8 * size as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
            _ => bits as f64,
        }
    }

    fn text(self, bytes: &[u8]) -> String {
        let text: String = if self.kind == b'U' {
            let (letters, _) = bytes.as_chunks::<4>();
            let code = |b: &[u8; 4]| if self.big { u32::from_be_bytes(*b) } else { u32::from_le_bytes(*b) };
            letters.iter().filter_map(|b| char::from_u32(code(b))).collect()
        } else {
            String::from_utf8_lossy(bytes).into_owned()
        };
        text.trim_end_matches('\0').to_owned()
    }
}
