//! Rows of a piece of a file.

use std::path::Path;

use wide::u8x16;

use super::{LONGEST_LINE, TableError};

/// What divides fields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Delimiter {
    Byte(u8),
    Blanks,
}

impl Delimiter {
    /// Of a header: the first of tab, `;`, `,` and blanks that it holds.
    pub(super) fn of(header: &[u8]) -> Self {
        [b'\t', b';', b','].into_iter().find(|d| header.contains(d)).map_or(Self::Blanks, Self::Byte)
    }

    /// Where the fields of a line begin and end.
    pub(super) fn fields(self, line: &[u8]) -> Vec<(usize, usize)> {
        let mut fields = Vec::new();
        match self {
            Self::Byte(d) => {
                let mut start = 0;
                for end in memchr::memchr_iter(d, line) {
                    fields.push((start, end));
                    start = end + 1;
                }
                fields.push((start, line.len()));
            }
            Self::Blanks => {
                let mut at = 0;
                while let Some(start) = line[at..].iter().position(|b| *b != b' ').map(|s| at + s) {
                    let end = line[start..].iter().position(|b| *b == b' ').map_or(line.len(), |e| start + e);
                    fields.push((start, end));
                    at = end;
                }
            }
        }
        fields
    }
}

/// What a column is for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Role {
    /// The k-th column of numbers that is wanted.
    Number(usize),
    Label,
    Time,
}

/// How rows are read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows<'a> {
    pub(super) delimiter: Delimiter,
    /// Fields of every row.
    pub(super) expected: usize,
    /// Columns that are looked at.
    pub(super) roles: &'a [(usize, Role)],
    /// Columns of numbers.
    pub(super) numbers: usize,
    pub(super) allowed: &'a [&'a str],
}

/// Rows of one piece, up to the first mistake in it.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    pub(super) numbers: Vec<Vec<f64>>,
    pub(super) labels: Vec<u8>,
    pub(super) times: Vec<f64>,
    pub(super) rows: usize,
    pub(super) lines: usize,
    pub(super) fault: Option<Fault>,
}

/// A mistake in a row: line from 1 within the piece, column from 1.
#[derive(Debug, Clone)]
pub(super) struct Fault {
    line: usize,
    column: usize,
    what: Mistake,
}

#[derive(Debug, Clone)]
enum Mistake {
    Fields { got: usize, expected: usize },
    Number { field: usize, text: String },
    Label { field: usize, text: String },
    Long,
}

impl Fault {
    /// The same mistake with this many lines before the piece.
    pub(super) fn after(&self, lines: usize) -> Self {
        Self { line: self.line + lines, ..self.clone() }
    }

    pub(super) fn placed(self, path: &Path, header: &[String], allowed: &[&str]) -> TableError {
        let Self { line, column, what } = self;
        let path = path.to_owned();
        match what {
            Mistake::Fields { got, expected } => TableError::Fields { path, line, column, got, expected },
            Mistake::Number { field, text } => {
                TableError::Number { path, line, column, name: header[field].clone(), text }
            }
            Mistake::Label { field, text } => {
                let allowed = allowed.join(" ");
                TableError::Label { path, line, column, name: header[field].clone(), text, allowed }
            }
            Mistake::Long => TableError::LongLine { path, line },
        }
    }
}

impl Rows<'_> {
    /// Reads a piece; its last line may lack its end.
    pub(super) fn parse(&self, piece: &[u8]) -> Parsed {
        let mut parsed = Parsed { numbers: vec![Vec::new(); self.numbers], ..Parsed::default() };
        let Delimiter::Byte(delimiter) = self.delimiter else {
            for line in piece.split_inclusive(|b| *b == b'\n') {
                let line = line.strip_suffix(b"\n").unwrap_or(line).trim_ascii_end();
                if !self.line(line, &self.delimiter.fields(line), &mut parsed) {
                    break;
                }
            }
            return parsed;
        };
        let mut fields: Vec<(usize, usize)> = Vec::with_capacity(self.expected);
        let (mut line, mut field) = (0, 0);
        let finished = marks(piece, delimiter, |at| {
            fields.push((field - line, at - line));
            field = at + 1;
            if piece[at] != b'\n' {
                return true;
            }
            let go_on = self.line(&piece[line..at], &fields, &mut parsed);
            fields.clear();
            line = at + 1;
            go_on
        });
        if finished && line < piece.len() {
            fields.push((field - line, piece.len() - line));
            self.line(&piece[line..], &fields, &mut parsed);
        }
        parsed
    }

    /// Takes a line with its fields; false when it holds a mistake.
    fn line(&self, line: &[u8], fields: &[(usize, usize)], parsed: &mut Parsed) -> bool {
        parsed.lines += 1;
        let blank =
            line.first().is_none_or(|b| *b == b'#' || (b.is_ascii_whitespace() && line.trim_ascii().is_empty()));
        if blank && line.len() <= LONGEST_LINE {
            return true;
        }
        match self.row(line, fields, parsed) {
            Ok(()) => {
                parsed.rows += 1;
                true
            }
            Err((column, what)) => {
                // Columns read before the mistake are one value longer than the rest.
                parsed.fault = Some(Fault { line: parsed.lines, column, what });
                parsed.times.truncate(parsed.rows);
                false
            }
        }
    }

    fn row(&self, line: &[u8], fields: &[(usize, usize)], parsed: &mut Parsed) -> Result<(), (usize, Mistake)> {
        if line.len() > LONGEST_LINE {
            return Err((1, Mistake::Long));
        }
        // All fields are counted, so that a row too short or too long is seen.
        if fields.len() != self.expected {
            let end = line.strip_suffix(b"\r").unwrap_or(line).len();
            let column = fields.get(self.expected).map_or(end, |f| f.0) + 1;
            return Err((column, Mistake::Fields { got: fields.len(), expected: self.expected }));
        }
        for &(column, role) in self.roles {
            let (at, end) = fields[column];
            let field = &line[at..end];
            let number = || {
                parse(field).ok_or_else(|| {
                    let text = String::from_utf8_lossy(field.strip_suffix(b"\r").unwrap_or(field)).into_owned();
                    (at + 1, Mistake::Number { field: column, text })
                })
            };
            match role {
                Role::Number(k) => parsed.numbers[k].push(number()?),
                Role::Time => parsed.times.push(number()?),
                Role::Label => {
                    let text = unquoted(field);
                    let Some(code) = self.allowed.iter().position(|l| l.as_bytes() == text) else {
                        let text = String::from_utf8_lossy(text).into_owned();
                        return Err((at + 1, Mistake::Label { field: column, text }));
                    };
                    parsed.labels.push(code as u8);
                }
            }
        }
        Ok(())
    }
}

/// Visits every delimiter and line end, in order, until the visitor says no; sixteen bytes are compared at once, since
/// fields are too short for a search of its own each.
fn marks(text: &[u8], delimiter: u8, mut visit: impl FnMut(usize) -> bool) -> bool {
    const WIDTH: usize = 16;
    let (delimiters, ends) = (u8x16::splat(delimiter), u8x16::splat(b'\n'));
    let (chunks, rest) = text.as_chunks::<WIDTH>();
    for (k, chunk) in chunks.iter().enumerate() {
        let bytes = u8x16::new(*chunk);
        let mut found = (bytes.simd_eq(delimiters) | bytes.simd_eq(ends)).to_bitmask();
        while found != 0 {
            if !visit(k * WIDTH + found.trailing_zeros() as usize) {
                return false;
            }
            found &= found - 1;
        }
    }
    let start = text.len() - rest.len();
    rest.iter().enumerate().filter(|(_, b)| **b == delimiter || **b == b'\n').all(|(i, _)| visit(start + i))
}

/// A field as a number; blanks and quotes around it are allowed.
fn parse(field: &[u8]) -> Option<f64> {
    fast_float2::parse(field).ok().or_else(|| fast_float2::parse(unquoted(field)).ok())
}

/// A field without blanks and quotes around it.
pub(super) fn unquoted(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => field,
    }
}
