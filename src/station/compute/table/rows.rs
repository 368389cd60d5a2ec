//! Reads the rows of a piece of a file.

use std::path::Path;

use wide::u8x16;

use super::gathered::Gathered;
use super::number::{self, Form, NoNumber, unquoted};
use super::{LONGEST_LINE, TableError, plain, time};

/// The sign between fields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Delimiter {
    Byte(u8),
    Blanks,
}

impl Delimiter {
    /// The delimiter of a header: the first of tab, `;`, `,` and blanks that it holds.
    pub(super) fn of(header: &[u8]) -> Self {
        [b'\t', b';', b','].into_iter().find(|d| header.contains(d)).map_or(Self::Blanks, Self::Byte)
    }

    /// The delimiter in words.
    pub(super) fn named(self) -> String {
        match self {
            Self::Byte(b'\t') => "tabs".to_owned(),
            Self::Byte(byte) => format!("`{}`", char::from(byte)),
            Self::Blanks => "blanks".to_owned(),
        }
    }

    /// Where each field of a line begins and ends.
    pub(super) fn fields(self, line: &[u8]) -> Vec<(usize, usize)> {
        let mut fields = Vec::new();
        match self {
            // A delimiter within quotes belongs to its field.
            Self::Byte(d) => {
                let (mut start, mut quoted) = (0, false);
                for at in memchr::memchr2_iter(d, b'"', line) {
                    if line[at] == b'"' {
                        quoted = !quoted;
                    } else if !quoted {
                        fields.push((start, at));
                        start = at + 1;
                    }
                }
                fields.push((start, line.len()));
            }
            Self::Blanks => {
                let blank = |b: u8| b == b' ' || b == b'\t';
                let mut at = 0;
                while let Some(start) = line[at..].iter().position(|b| !blank(*b)).map(|s| at + s) {
                    let mut quoted = false;
                    let ends = |b: &u8| {
                        quoted ^= *b == b'"';
                        blank(*b) && !quoted
                    };
                    let end = line[start..].iter().position(ends).map_or(line.len(), |e| start + e);
                    fields.push((start, end));
                    at = end;
                }
            }
        }
        fields
    }

    /// Joins a unit behind a blank to its name, as in `Time [s]`.
    pub(super) fn merged(self, fields: Vec<String>) -> Vec<String> {
        if self != Self::Blanks {
            return fields;
        }
        let mut merged: Vec<String> = Vec::new();
        for field in fields {
            match merged.last_mut() {
                Some(name) if field.starts_with(['[', '(']) => *name = format!("{name} {field}"),
                _ => merged.push(field),
            }
        }
        merged
    }
}

/// The purpose of a column.
#[derive(Debug, Clone, Copy)]
pub(super) enum Role {
    /// The k-th wanted column of numbers.
    Number(usize),
    Label,
    /// The name of the capture. Rows of a capture that is not wanted are skipped.
    Capture,
    /// Time stamps as numbers, or as dates.
    Time {
        dates: bool,
    },
}

/// How rows are read.
#[derive(Debug, Clone, Copy)]
pub(super) struct ParsedRows<'a> {
    pub(super) delimiter: Delimiter,
    /// Number of fields in each row.
    pub(super) expected: usize,
    /// Columns that are read.
    pub(super) roles: &'a [(usize, Role)],
    /// Number of wanted columns of numbers.
    pub(super) numbers: usize,
    pub(super) allowed: &'a [&'a str],
    pub(super) form: Form,
    /// The capture that is wanted.
    pub(super) capture: Option<&'a str>,
    /// Rows without a label are skipped.
    pub(super) unlabelled: bool,
}

/// Rows of one piece, up to the first mistake in it.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    pub(super) found: Gathered,
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
    Number { field: usize, text: String, ambiguous: bool },
    Label { field: usize, text: String },
    OpenQuote,
    Long,
}

impl Fault {
    /// The same mistake, if the piece has `lines` lines before it.
    pub(super) fn after(&self, lines: usize) -> Self {
        Self { line: self.line + lines, ..self.clone() }
    }

    pub(super) fn placed(self, path: &Path, header: &[String], allowed: &[&str]) -> TableError {
        let Self { line, column, what } = self;
        let path = path.to_owned();
        match what {
            Mistake::Fields { got, expected } => TableError::Fields { path, line, column, got, expected },
            Mistake::Number { field, text, ambiguous } => {
                let name = header[field].clone();
                if ambiguous {
                    TableError::Ambiguous { path, line, column, name, text }
                } else {
                    TableError::Number { path, line, column, name, text }
                }
            }
            Mistake::OpenQuote => TableError::OpenQuote { path, line, column },
            Mistake::Label { field, text } => {
                let allowed = allowed.join(" ");
                TableError::Label { path, line, column, name: header[field].clone(), text, allowed }
            }
            Mistake::Long => TableError::LongLine { path, line },
        }
    }
}

impl ParsedRows<'_> {
    /// Reads a piece; its last line may lack its end.
    pub(super) fn parse(&self, piece: &[u8]) -> Parsed {
        plain::parse(self, piece).unwrap_or_else(|| self.one_by_one(piece))
    }

    /// Reads any piece row by row.
    pub(super) fn one_by_one(&self, piece: &[u8]) -> Parsed {
        let mut parsed = Parsed {
            found: Gathered { numbers: vec![Vec::new(); self.numbers], ..Gathered::default() },
            ..Parsed::default()
        };
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
        let quotes = memchr::memchr(b'"', piece).is_some();
        let finished = marks(piece, delimiter, |at| {
            fields.push((field - line, at - line));
            field = at + 1;
            if piece[at] != b'\n' {
                return true;
            }
            let go_on = self.quoted_line(&piece[line..at], &mut fields, quotes, &mut parsed);
            fields.clear();
            line = at + 1;
            go_on
        });
        if finished && line < piece.len() {
            fields.push((field - line, piece.len() - line));
            self.quoted_line(&piece[line..], &mut fields, quotes, &mut parsed);
        }
        parsed
    }

    /// Takes a line. Its fields are right unless it holds a quote.
    fn quoted_line(&self, line: &[u8], fields: &mut Vec<(usize, usize)>, quotes: bool, parsed: &mut Parsed) -> bool {
        if quotes && memchr::memchr(b'"', line).is_some() {
            *fields = self.delimiter.fields(line);
        }
        self.line(line, fields, parsed)
    }

    /// Takes a line with its fields; false when it holds a mistake.
    fn line(&self, line: &[u8], fields: &[(usize, usize)], parsed: &mut Parsed) -> bool {
        parsed.lines += 1;
        let blank = line.first().is_none_or(|b| match *b {
            b'#' | b'%' => true,
            // Spreadsheets write rows that hold only delimiters.
            b if self.delimiter == Delimiter::Byte(b) => line.iter().all(|c| *c == b || c.is_ascii_whitespace()),
            b => b.is_ascii_whitespace() && line.trim_ascii().is_empty(),
        });
        if blank && line.len() <= LONGEST_LINE {
            return true;
        }
        match self.row(line, fields, parsed) {
            Ok(taken) => {
                parsed.found.rows += usize::from(taken);
                true
            }
            Err((column, what)) => {
                // Columns read before the mistake are one value longer than the others.
                parsed.fault = Some(Fault { line: parsed.lines, column, what });
                parsed.found.times.truncate(parsed.found.rows);
                parsed.found.labels.truncate(parsed.found.rows);
                false
            }
        }
    }

    /// Takes a row; false when it is skipped.
    fn row(&self, line: &[u8], fields: &[(usize, usize)], parsed: &mut Parsed) -> Result<bool, (usize, Mistake)> {
        if line.len() > LONGEST_LINE {
            return Err((1, Mistake::Long));
        }
        // Count all fields, so that a row with too few or too many is found.
        if fields.len() != self.expected {
            let open =
                fields.last().filter(|(at, end)| line[*at..*end].iter().filter(|b| **b == b'"').count() % 2 == 1);
            if let Some((at, _)) = open {
                return Err((at + 1, Mistake::OpenQuote));
            }
            let end = line.strip_suffix(b"\r").unwrap_or(line).len();
            let column = fields.get(self.expected).map_or(end, |f| f.0) + 1;
            return Err((column, Mistake::Fields { got: fields.len(), expected: self.expected }));
        }
        for &(column, role) in self.roles {
            let (at, end) = fields[column];
            let field = &line[at..end];
            let mistake = |ambiguous| {
                if field.iter().filter(|b| **b == b'"').count() % 2 == 1 {
                    return (at + 1, Mistake::OpenQuote);
                }
                let text = number::decoded(field.strip_suffix(b"\r").unwrap_or(field)).into_owned();
                (at + 1, Mistake::Number { field: column, text, ambiguous })
            };
            match role {
                Role::Number(k) => match number::read(field, self.form) {
                    Ok(value) => parsed.found.numbers[k].push(value),
                    Err(NoNumber::Missing) => {
                        parsed.found.missing.push((k, parsed.lines));
                        parsed.found.numbers[k].push(f64::NAN);
                    }
                    Err(why) => return Err(mistake(why == NoNumber::Ambiguous)),
                },
                Role::Time { dates: false } => match number::read(field, self.form) {
                    Ok(value) => parsed.found.times.push(value),
                    Err(why) => return Err(mistake(why == NoNumber::Ambiguous)),
                },
                Role::Time { dates: true } => {
                    let stamp = time::date(&number::decoded(unquoted(field)));
                    parsed.found.times.push(stamp.ok_or_else(|| mistake(false))?);
                }
                Role::Capture => {
                    let name = unquoted(field);
                    if self.capture.is_some_and(|wanted| wanted.as_bytes() != name) {
                        parsed.found.pass_over(name);
                        return Ok(false);
                    }
                    parsed.found.begin(parsed.found.rows, name);
                }
                Role::Label => {
                    let text = unquoted(field);
                    if text.is_empty() && self.unlabelled {
                        return Ok(false);
                    }
                    let Some(code) = self.allowed.iter().position(|l| l.as_bytes().eq_ignore_ascii_case(text)) else {
                        let text = number::decoded(text).into_owned();
                        return Err((at + 1, Mistake::Label { field: column, text }));
                    };
                    parsed.found.labels.push(code as u8);
                }
            }
        }
        Ok(true)
    }
}

/// Visits every delimiter and line end in order, until the visitor returns false. Sixteen bytes are compared at once,
/// since fields are too short for one search each.
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
