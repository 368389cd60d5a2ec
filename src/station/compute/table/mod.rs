//! Records as text: a header row, then rows of fields divided by `,`, `;`, tab or blanks; comments begin with `#`.
//!
//! The file is read once, in pieces of whole lines that threads parse while the next ones are read; only the columns that
//! are wanted are kept. A time column is checked on the way and not kept at all. The pieces are taken in their order, so
//! that the first mistake of the file is the one that is reported, with its line and column.

mod pieces;
mod rows;

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::thread;

use gnc_metrology::{Refusal, series::Clock};
use thiserror::Error;

use pieces::{PIECE, Pieces};
use rows::{Delimiter, Fault, Parsed, Role, Rows, unquoted};

/// Longest line that is taken for a line of a record.
const LONGEST_LINE: usize = 1 << 20;
/// Threads that parse: beyond these the one that reads and gathers is the limit.
const MOST_THREADS: usize = 4;
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
    #[error("{path}: no line end within {LONGEST_LINE} bytes; is it a text?")]
    Endless { path: PathBuf },
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
    pieces: Pieces,
    /// The piece that holds the header, and where the rows begin in it.
    first: (Vec<u8>, usize),
    header: Vec<String>,
    header_line: usize,
    delimiter: Delimiter,
    /// Whether a time column is looked at.
    timed: bool,
}

impl Table {
    /// Opens a file (`-` is standard input) and reads its header.
    pub(super) fn open(path: &Path) -> Result<Self, TableError> {
        let fail = |source| TableError::Io { path: path.to_owned(), source };
        let source: Box<dyn Read> =
            if path == Path::new("-") { Box::new(io::stdin()) } else { Box::new(File::open(path).map_err(fail)?) };
        Self::from_reader(path, source, PIECE)
    }

    /// Reads it in pieces of about this many bytes.
    pub(super) fn from_reader(path: &Path, source: Box<dyn Read>, piece: usize) -> Result<Self, TableError> {
        let mut pieces = Pieces::new(path, source, piece);
        let mut number = 0;
        let no_header = |line: usize| TableError::NoHeader { path: path.to_owned(), line };
        while let Some(piece) = pieces.next(Vec::new())? {
            let mut at = 0;
            while at < piece.len() {
                let end = memchr::memchr(b'\n', &piece[at..]).map_or(piece.len(), |l| at + l);
                let text = String::from_utf8_lossy(&piece[at..end]).trim_start_matches('\u{feff}').trim().to_owned();
                at = end + 1;
                number += 1;
                if !(text.is_empty() || text.starts_with('#')) {
                    let first = (piece, at);
                    return Self::with_header(path, &text, number, pieces, first);
                }
            }
        }
        Err(no_header(number.max(1)))
    }

    fn with_header(
        path: &Path,
        text: &str,
        line: usize,
        pieces: Pieces,
        first: (Vec<u8>, usize),
    ) -> Result<Self, TableError> {
        let delimiter = Delimiter::of(text.as_bytes());
        let fields = delimiter.fields(text.as_bytes());
        let name =
            |&(at, end): &(usize, usize)| String::from_utf8_lossy(unquoted(&text.as_bytes()[at..end])).into_owned();
        let header: Vec<String> = fields.iter().map(name).collect();
        if header.iter().all(|name| name.is_empty() || name.parse::<f64>().is_ok()) {
            return Err(TableError::NoHeader { path: path.to_owned(), line });
        }
        for (i, name) in header.iter().enumerate() {
            if !name.is_empty() && header[..i].contains(name) {
                let (path, column, name) = (path.to_owned(), fields[i].0 + 1, name.clone());
                return Err(TableError::Doubled { path, line, column, name });
            }
        }
        Ok(Self { path: path.to_owned(), pieces, first, header, header_line: line, delimiter, timed: true })
    }

    /// Whether the header has a column.
    pub(super) fn has(&self, name: &str) -> bool {
        self.header.iter().any(|h| h == name)
    }

    /// The same without a look at its time column, for methods to which time says nothing.
    pub(super) fn untimed(self) -> Self {
        Self { timed: false, ..self }
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
    pub(super) fn read(self, wanted: &Wanted) -> Result<Columns, TableError> {
        let mut roles: Vec<(usize, Role)> = Vec::new();
        for (k, name) in wanted.numbers.iter().enumerate() {
            roles.push((self.column(name)?, Role::Number(k)));
        }
        if let Some((name, _)) = wanted.label {
            roles.push((self.column(name)?, Role::Label));
        }
        let is_time = |name: &String| TIME_NAMES.iter().any(|t| name.eq_ignore_ascii_case(t));
        if let Some(column) = self.header.iter().position(is_time).filter(|_| self.timed) {
            roles.push((column, Role::Time));
        }
        let rows = Rows {
            delimiter: self.delimiter,
            expected: self.header.len(),
            roles: &roles,
            numbers: wanted.numbers.len(),
            allowed: wanted.label.map_or(&[], |(_, allowed)| allowed),
        };
        let mut gathered = Gathered {
            columns: Columns { numbers: vec![Vec::new(); wanted.numbers.len()], labels: Vec::new() },
            clock: Clock::new(wanted.rate_hz),
            lines: self.header_line,
            rows: 0,
        };
        let place =
            |fault: Fault| fault.placed(&self.path, &self.header, wanted.label.map_or(&[], |(_, allowed)| allowed));
        gathered.add(&rows.parse(&self.first.0[self.first.1.min(self.first.0.len())..]), &place)?;
        let mut pieces = self.pieces;
        if !pieces.ended() {
            in_parallel(&mut pieces, &rows, |parsed| gathered.add(parsed, &place))?;
        }
        if gathered.rows == 0 {
            return Err(TableError::NoRows { path: self.path.clone() });
        }
        gathered.clock.finish()?;
        Ok(gathered.columns)
    }
}

/// Reads pieces, has them parsed by threads in turn and takes the results in the order of the file.
fn in_parallel(
    pieces: &mut Pieces,
    rows: &Rows,
    mut take: impl FnMut(&Parsed) -> Result<(), TableError>,
) -> Result<(), TableError> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(MOST_THREADS);
    thread::scope(|scope| {
        let lanes: Vec<_> = (0..threads)
            .map(|_| {
                // One piece in work and one result at a time: memory is bounded by the threads.
                let (work, pieces) = sync_channel::<Vec<u8>>(1);
                let (done, results) = sync_channel(1);
                scope.spawn(move || {
                    for piece in pieces {
                        let parsed = rows.parse(&piece);
                        if done.send((parsed, piece)).is_err() {
                            return;
                        }
                    }
                });
                (work, results)
            })
            .collect();
        // A lane is closed only by a thread that panicked, and the scope hands that panic on.
        let mut given = 0;
        let mut spare = Vec::new();
        while let Some(piece) = pieces.next(spare)? {
            let (work, results) = &lanes[given % threads];
            spare = Vec::new();
            if given >= threads
                && let Ok((parsed, used)) = results.recv()
            {
                take(&parsed)?;
                spare = used;
            }
            if work.send(piece).is_err() {
                return Ok(());
            }
            given += 1;
        }
        for k in given.saturating_sub(threads)..given {
            if let Ok((parsed, _)) = lanes[k % threads].1.recv() {
                take(&parsed)?;
            }
        }
        Ok(())
    })
}

/// What has been read so far.
struct Gathered {
    columns: Columns,
    clock: Clock,
    /// Lines before the next piece.
    lines: usize,
    rows: usize,
}

impl Gathered {
    fn add(&mut self, parsed: &Parsed, place: &impl Fn(Fault) -> TableError) -> Result<(), TableError> {
        for (column, part) in self.columns.numbers.iter_mut().zip(&parsed.numbers) {
            column.extend_from_slice(part);
        }
        let label_before = |i: usize| {
            if i == 0 { self.columns.labels.last() } else { parsed.labels.get(i - 1) }
        };
        for (i, time) in parsed.times.iter().enumerate() {
            let new_block = self.rows + i == 0 || label_before(i) != parsed.labels.get(i);
            self.clock.tick(self.rows + i, *time, new_block)?;
        }
        if let Some(fault) = &parsed.fault {
            return Err(place(fault.after(self.lines)));
        }
        self.columns.labels.extend_from_slice(&parsed.labels);
        self.lines += parsed.lines;
        self.rows += parsed.rows;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &'static str, numbers: &[&str], rate_hz: Option<f64>) -> Result<Columns, TableError> {
        Table::from_reader(Path::new("r.csv"), Box::new(text.as_bytes()), PIECE)?.read(&Wanted {
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
        check("x\ty\n1\t\n", "r.csv:2:3: `` in column `y` is not a number");
        check("x,y\r\n1\r\n", "r.csv:2:2: row has 1 fields, the header 2");
        check("x y\n1 2\n 1  b \n", "r.csv:3:5: `b` in column `y` is not a number");
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

    /// A line that the pieces cut in two is still one line, and the first mistake has its line whatever the threads do.
    #[test]
    fn pieces_do_not_show() {
        let mut text = "# head\nt,a,b\n".to_owned();
        (0..400_000).for_each(|i| text += &format!("{i},{i},{}\n", i * 2));
        assert!(text.len() > 5 << 20, "several pieces");
        let good: &'static str = Box::leak(text.clone().into_boxed_str());
        let columns = read(good, &["b"], None).unwrap();
        assert_eq!(columns.numbers[0].len(), 400_000);
        assert!(columns.numbers[0].iter().enumerate().all(|(i, v)| *v == 2.0 * i as f64));
        let mut check = |row: usize, bad: &str, expected: &str| {
            let at = text.match_indices('\n').nth(row + 1).unwrap().0 + 1;
            let end = at + text[at..].find('\n').unwrap();
            text.replace_range(at..end, bad);
            let broken: &'static str = Box::leak(text.clone().into_boxed_str());
            assert_eq!(read(broken, &["b"], None).err().unwrap().to_string(), expected);
        };
        check(399_999, "399999,0,x", "r.csv:400002:10: `x` in column `b` is not a number");
        check(300_000, "300000,0", "r.csv:300003:9: row has 2 fields, the header 3");
        check(200_000, "200001,0,0", "gap at sample 200000: step of 2.000000 s, expected 1.000000 s");
        check(3, "3,0,0,0", "r.csv:6:7: row has 4 fields, the header 3");
    }

    #[test]
    fn what_is_no_text_is_refused_soon() {
        struct Zeros;
        impl Read for Zeros {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                buffer.fill(b'0');
                Ok(buffer.len())
            }
        }
        let error = Table::from_reader(Path::new("r.bin"), Box::new(Zeros), PIECE).err().unwrap();
        assert_eq!(error.to_string(), "r.bin: no line end within 1048576 bytes; is it a text?");
    }
}
