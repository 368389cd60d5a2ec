//! Records as text: a header row, then rows of fields divided by `,`, `;`, tab or blanks; comments begin with `#`.
//!
//! The file is read once, in pieces; only the columns that are wanted are kept. A time column is checked on the way and
//! not kept at all.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gnc_metrology::{Refusal, series::Clock};
use thiserror::Error;

/// Bytes read at a time: large enough to hide system calls, small enough for the cache.
const PIECE: usize = 1 << 18;
/// Longest line that is taken for a line of a record.
const LONGEST_LINE: usize = 1 << 20;
/// Names of a time column in seconds.
const TIME_NAMES: [&str; 4] = ["t", "time", "time_s", "t_s"];

/// Why a file could not be read as a table.
#[derive(Debug, Error)]
pub(super) enum TableError {
    #[error("{path}: cannot be read")]
    Io { path: PathBuf, source: io::Error },
    #[error("{path}:{line}:1: no header row with column names")]
    NoHeader { path: PathBuf, line: usize },
    #[error("{path}:{line}:1: no column `{name}`; the header has {header}")]
    NoColumn { path: PathBuf, line: usize, name: String, header: String },
    #[error("{path}:{line}:{column}: column `{name}` stands twice in the header")]
    Doubled { path: PathBuf, line: usize, column: usize, name: String },
    #[error("{path}:{line}:{column}: row has {got} fields, the header {expected}")]
    Fields { path: PathBuf, line: usize, column: usize, got: usize, expected: usize },
    #[error("{path}:{line}:{column}: `{text}` in column `{name}` is not a number")]
    Number { path: PathBuf, line: usize, column: usize, name: String, text: String },
    #[error("{path}:{line}:{column}: `{text}` in column `{name}` is none of {allowed}")]
    Label { path: PathBuf, line: usize, column: usize, name: String, text: String, allowed: String },
    #[error("{path}:{line}:1: line is longer than {LONGEST_LINE} bytes")]
    LongLine { path: PathBuf, line: usize },
    #[error("{path}: no rows after the header")]
    NoRows { path: PathBuf },
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// What to read of a table.
#[derive(Default)]
pub(super) struct Wanted<'a> {
    /// Columns of numbers.
    pub(super) numbers: &'a [&'a str],
    /// Column of labels and the labels allowed there.
    pub(super) label: Option<(&'a str, &'a [&'a str])>,
    /// Rate against which a time column is checked.
    pub(super) rate_hz: Option<f64>,
}

/// Columns of a table.
pub(super) struct Columns {
    /// One for each column of numbers that was wanted.
    pub(super) numbers: Vec<Vec<f64>>,
    /// Index of the label of each row among those allowed.
    pub(super) labels: Vec<u8>,
}

/// A table whose header has been read.
pub(super) struct Table {
    path: PathBuf,
    lines: Lines,
    header: Vec<String>,
    header_line: usize,
    delimiter: Delimiter,
}

#[derive(Clone, Copy, PartialEq)]
enum Delimiter {
    Byte(u8),
    Blanks,
}

impl Table {
    /// Opens a file (`-` is standard input) and reads its header.
    pub(super) fn open(path: &Path) -> Result<Self, TableError> {
        let fail = |source| TableError::Io { path: path.to_owned(), source };
        let source: Box<dyn Read> =
            if path == Path::new("-") { Box::new(io::stdin()) } else { Box::new(File::open(path).map_err(fail)?) };
        Self::from_reader(path, source)
    }

    fn from_reader(path: &Path, source: Box<dyn Read>) -> Result<Self, TableError> {
        let mut lines = Lines { source, buffer: vec![0; PIECE], start: 0, end: 0, number: 0, ended: false };
        let no_header = |line| TableError::NoHeader { path: path.to_owned(), line };
        loop {
            let Some((header_line, line)) = lines.next_line(path)? else { return Err(no_header(1)) };
            let text = String::from_utf8_lossy(line).trim_start_matches('\u{feff}').trim().to_owned();
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            let delimiter = [b'\t', b';', b',']
                .into_iter()
                .find(|d| text.as_bytes().contains(d))
                .map_or(Delimiter::Blanks, Delimiter::Byte);
            let fields: Vec<(usize, &[u8])> = Fields { rest: text.as_bytes(), at: 0, delimiter, done: false }.collect();
            let header: Vec<String> =
                fields.iter().map(|(_, f)| String::from_utf8_lossy(unquoted(f)).into_owned()).collect();
            if header.iter().all(|name| name.is_empty() || name.parse::<f64>().is_ok()) {
                return Err(no_header(header_line));
            }
            for (i, name) in header.iter().enumerate() {
                if !name.is_empty() && header[..i].contains(name) {
                    let (path, column, name) = (path.to_owned(), fields[i].0 + 1, name.clone());
                    return Err(TableError::Doubled { path, line: header_line, column, name });
                }
            }
            return Ok(Self { path: path.to_owned(), lines, header, header_line, delimiter });
        }
    }

    /// Whether the header has a column.
    pub(super) fn has(&self, name: &str) -> bool {
        self.header.iter().any(|h| h == name)
    }

    fn column(&self, name: &str) -> Result<usize, TableError> {
        self.header.iter().position(|h| h == name).ok_or_else(|| TableError::NoColumn {
            path: self.path.clone(),
            line: self.header_line,
            name: name.to_owned(),
            header: self.header.join(", "),
        })
    }

    /// Reads the wanted columns. Time must rise without a gap as long as the label stays.
    pub(super) fn read(mut self, wanted: &Wanted) -> Result<Columns, TableError> {
        #[derive(Clone, Copy)]
        enum Use {
            Number(usize),
            Label,
            Time,
        }
        let mut uses: Vec<(usize, Use)> = Vec::new();
        for (k, name) in wanted.numbers.iter().enumerate() {
            uses.push((self.column(name)?, Use::Number(k)));
        }
        if let Some((name, _)) = wanted.label {
            uses.push((self.column(name)?, Use::Label));
        }
        let is_time = |name: &String| TIME_NAMES.iter().any(|t| name.eq_ignore_ascii_case(t));
        if let Some(column) = self.header.iter().position(is_time) {
            uses.push((column, Use::Time));
        }
        let mut columns = Columns { numbers: vec![Vec::new(); wanted.numbers.len()], labels: Vec::new() };
        let mut clock = Clock::new(wanted.rate_hz);
        let expected = self.header.len();
        let mut rows = 0;
        let mut bounds: Vec<(usize, usize)> = Vec::with_capacity(expected);
        while let Some((number, line)) = self.lines.next_line(&self.path)? {
            let line = line.trim_ascii_end();
            if line.is_empty() || line[0] == b'#' || line.trim_ascii_start().is_empty() {
                continue;
            }
            // Where the fields lie, all of them, so that a row too short or too long is seen.
            bounds.clear();
            match self.delimiter {
                Delimiter::Byte(d) => {
                    let mut start = 0;
                    for end in memchr::memchr_iter(d, line) {
                        bounds.push((start, end));
                        start = end + 1;
                    }
                    bounds.push((start, line.len()));
                }
                Delimiter::Blanks => {
                    let fields = Fields { rest: line, at: 0, delimiter: self.delimiter, done: false };
                    bounds.extend(fields.map(|(at, field)| (at, at + field.len())));
                }
            }
            if bounds.len() != expected {
                let column = bounds.get(expected).map_or(line.len(), |b| b.0) + 1;
                let path = self.path.clone();
                return Err(TableError::Fields { path, line: number, column, got: bounds.len(), expected });
            }
            let mut time = None;
            let mut new_block = rows == 0;
            for &(column, usage) in &uses {
                let (at, end) = bounds[column];
                let field = &line[at..end];
                let bad_number = || TableError::Number {
                    path: self.path.clone(),
                    line: number,
                    column: at + 1,
                    name: self.header[column].clone(),
                    text: String::from_utf8_lossy(field).into_owned(),
                };
                match usage {
                    Use::Number(k) => columns.numbers[k].push(parse(field).ok_or_else(bad_number)?),
                    Use::Time => time = Some(parse(field).ok_or_else(bad_number)?),
                    Use::Label => {
                        let allowed = wanted.label.map_or(&[][..], |(_, allowed)| allowed);
                        let text = unquoted(field);
                        let Some(code) = allowed.iter().position(|l| l.as_bytes() == text) else {
                            return Err(TableError::Label {
                                path: self.path.clone(),
                                line: number,
                                column: at + 1,
                                name: self.header[column].clone(),
                                text: String::from_utf8_lossy(text).into_owned(),
                                allowed: allowed.join(" "),
                            });
                        };
                        new_block |= columns.labels.last() != Some(&(code as u8));
                        columns.labels.push(code as u8);
                    }
                }
            }
            if let Some(time) = time {
                clock.tick(rows, time, new_block)?;
            }
            rows += 1;
        }
        if rows == 0 {
            return Err(TableError::NoRows { path: self.path });
        }
        clock.finish()?;
        Ok(columns)
    }
}

/// A field as a number; blanks and quotes around it are allowed.
fn parse(field: &[u8]) -> Option<f64> {
    fast_float2::parse(field).ok().or_else(|| fast_float2::parse(unquoted(field)).ok())
}

fn unquoted(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => field,
    }
}

/// Fields of a line with their place.
struct Fields<'a> {
    rest: &'a [u8],
    at: usize,
    delimiter: Delimiter,
    done: bool,
}

impl<'a> Iterator for Fields<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let delimiter = match self.delimiter {
            Delimiter::Byte(d) => d,
            Delimiter::Blanks => {
                let blanks = self.rest.iter().take_while(|b| **b == b' ').count();
                self.at += blanks;
                self.rest = &self.rest[blanks..];
                if self.rest.is_empty() {
                    return None;
                }
                b' '
            }
        };
        let (at, rest) = (self.at, self.rest);
        // Fields are short: a plain walk beats a search set up for long ones.
        match rest.iter().position(|b| *b == delimiter) {
            Some(end) => {
                self.rest = &rest[end + 1..];
                self.at += end + 1;
                Some((at, &rest[..end]))
            }
            None => {
                self.done = true;
                Some((at, rest))
            }
        }
    }
}

/// Lines of a source, numbered from 1, without their ends.
struct Lines {
    source: Box<dyn Read>,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    number: usize,
    ended: bool,
}

impl Lines {
    fn next_line(&mut self, path: &Path) -> Result<Option<(usize, &[u8])>, TableError> {
        let mut searched = 0;
        loop {
            let pending = &self.buffer[self.start..self.end];
            if let Some(length) = memchr::memchr(b'\n', &pending[searched..]).map(|l| l + searched) {
                let line = self.start..self.start + length;
                self.start += length + 1;
                self.number += 1;
                return Ok(Some((self.number, &self.buffer[line])));
            }
            searched = pending.len();
            if self.ended {
                if pending.is_empty() {
                    return Ok(None);
                }
                let line = self.start..self.end;
                self.start = self.end;
                self.number += 1;
                return Ok(Some((self.number, &self.buffer[line])));
            }
            if searched > LONGEST_LINE {
                return Err(TableError::LongLine { path: path.to_owned(), line: self.number + 1 });
            }
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
            if self.buffer.len() - self.end < PIECE / 2 {
                self.buffer.resize(self.buffer.len() + PIECE, 0);
            }
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.ended = true,
                Ok(n) => self.end += n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => return Err(TableError::Io { path: path.to_owned(), source }),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &'static str, numbers: &[&str], rate_hz: Option<f64>) -> Result<Columns, TableError> {
        Table::from_reader(Path::new("r.csv"), Box::new(text.as_bytes()))?.read(&Wanted {
            numbers,
            label: None,
            rate_hz,
        })
    }

    #[test]
    fn every_delimiter_and_what_people_write() {
        for text in [
            "# by hand\n\nt,x,y\n0,1,2.5\n# pause\n0.1,-1e3,.5\n",
            "t;x;y\r\n0;1;2.5\r\n0.1;-1e3;0.5",
            "t\tx\ty\n0\t1\t2.5\n0.1\t-1e3\t0.5\n",
            "  t  x   y\n 0  1  2.5 \n0.1 -1e3 +0.5\n",
            "\u{feff}\"t\",\"x\",\"y\"\n0, 1 ,\"2.5\"\n0.1,-1e3,0.5\n",
        ] {
            let columns = read(text, &["y", "x"], None).unwrap_or_else(|e| panic!("{text:?}: {e}"));
            assert_eq!(columns.numbers, [vec![2.5, 0.5], vec![1.0, -1000.0]], "{text:?}");
        }
    }

    #[test]
    fn mistakes_have_a_line_and_a_column() {
        let check = |text, expected: &str| match read(text, &["x", "y"], None) {
            Ok(_) => panic!("{text:?} was read"),
            Err(e) => assert_eq!(e.to_string(), expected),
        };
        check("x,y\n1,2\n1,abc\n", "r.csv:3:3: `abc` in column `y` is not a number");
        check("x,y\n1,\n", "r.csv:2:3: `` in column `y` is not a number");
        check("x;y\n1,5;2\n", "r.csv:2:1: `1,5` in column `x` is not a number");
        check("x,y\n1,2,3\n", "r.csv:2:5: row has 3 fields, the header 2");
        check("x,y\n1\n", "r.csv:2:2: row has 1 fields, the header 2");
        check("#c\nx,z\n1,2\n", "r.csv:2:1: no column `y`; the header has x, z");
        check("1,2\n3,4\n", "r.csv:1:1: no header row with column names");
        check("x,y,x\n3,4,5\n", "r.csv:1:5: column `x` stands twice in the header");
        check("x,y\n", "r.csv: no rows after the header");
        check("", "r.csv:1:1: no header row with column names");
    }

    #[test]
    fn time_is_watched() {
        let check = |rows: &str, rate, expected: &str| {
            let head = (0..40).fold("t,x\n".to_owned(), |s, i| format!("{s}{},0\n", f64::from(i) * 0.1));
            let text: &'static str = Box::leak(format!("{head}{rows}").into_boxed_str());
            assert_eq!(read(text, &["x"], rate).err().map(|e| e.to_string()).unwrap_or_default(), expected);
        };
        check("4.0,0\n", Some(10.0), "");
        check("4.3,0\n", None, "gap at sample 40: step of 0.400000 s, expected 0.100000 s");
        check("3.9,0\n", None, "time does not increase at sample 40: 3.9000000000000004 s, then 3.9 s");
        check("4.0,0\n", Some(20.0), "time column says 10.000000 Hz, stated are 20.000000 Hz");
        check("nan,0\n", None, "time: sample 40 is NaN");
    }

    /// A line that the pieces cut in two is still one line.
    #[test]
    fn pieces_do_not_show() {
        let rows: String = (0..100_000).map(|i| format!("{i},{}\n", i * 2)).collect();
        let text: &'static str = Box::leak(format!("a,b\n{rows}").into_boxed_str());
        let columns = read(text, &["b"], None).unwrap();
        assert!(columns.numbers[0].iter().enumerate().all(|(i, v)| *v == 2.0 * i as f64));
    }
}
