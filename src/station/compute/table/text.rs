//! Tables as text. The file is read once, in pieces of whole lines; threads parse pieces while the next ones are read.
//!
//! Only the wanted columns are kept. The pieces are taken in their order, so that the first mistake of the file is the
//! one that is reported, with its line and column.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::thread;

use super::columns::{ColumnPlan, Columns, Wanted};
use super::gathered::Gathered;
use super::pieces::Pieces;
use super::preamble::{self, Preamble};
use super::rows::{Fault, Parsed, ParsedRows};
use super::{MOST_VALUES, ReadingOptions, TableError, tell_size};

/// Largest number of threads that parse. With more, the thread that reads and gathers is the limit.
const MOST_THREADS: usize = 4;

/// A text whose header was read.
pub(super) struct Text {
    path: PathBuf,
    pieces: Pieces,
    /// The beginning of the text, which holds the header.
    head: Vec<u8>,
    pub(super) preamble: Preamble,
}

impl Text {
    /// Opens a text, to be read in pieces of about this many bytes.
    pub(super) fn open(
        path: &Path,
        source: Box<dyn Read>,
        piece: usize,
        understood: Vec<String>,
        reading: &ReadingOptions,
    ) -> Result<Self, TableError> {
        let mut pieces = Pieces::new(path, source, piece);
        let mut head = Vec::new();
        while head.len() < preamble::HEAD {
            let Some(mut piece) = pieces.next(Vec::new())? else { break };
            if head.is_empty() {
                head = piece;
            } else {
                head.append(&mut piece);
            }
        }
        if head.starts_with(b"\xef\xbb\xbf") {
            head.drain(..3);
        }
        let mut preamble = preamble::read(path, &head, reading.decimal)?;
        preamble.understood.splice(0..0, understood);
        Ok(Self { path: path.to_owned(), pieces, head, preamble })
    }

    /// Reads the wanted columns.
    pub(super) fn read(
        self,
        wanted: &Wanted,
        reading: &ReadingOptions,
        sensor: Option<&str>,
    ) -> Result<Columns, TableError> {
        let Self { path, mut pieces, head, preamble } = self;
        let Preamble { header, delimiter, form, .. } = &preamble;
        let mut plan = ColumnPlan::new(&path, header, (&preamble.first_row, *form), wanted, reading, sensor)?;
        let (roles, capture) = (plan.roles.clone(), plan.capture.clone());
        let rows = ParsedRows {
            delimiter: *delimiter,
            expected: header.names.len(),
            roles: &roles,
            numbers: wanted.numbers.len(),
            allowed: plan.allowed,
            form: *form,
            capture: capture.as_deref(),
            unlabelled: plan.export,
        };
        let numbers = vec![Vec::new(); wanted.numbers.len()];
        let mut gathered = Gathered { numbers, ..Gathered::default() };
        let mut lines = preamble.lines;
        let mut fault = None;
        let mut told = false;
        let mut take = |parsed: &Parsed| {
            gathered.add(&parsed.found, lines);
            fault = parsed.fault.as_ref().map(|fault| fault.after(lines));
            lines += parsed.lines;
            let values = gathered.values(roles.len());
            tell_size(&path, values, &mut told);
            if values > MOST_VALUES {
                Err(TableError::TooLarge { path: path.clone(), limit: MOST_VALUES })
            } else {
                Ok(fault.is_none())
            }
        };
        let go_on = take(&rows.parse(&head[preamble.bytes.min(head.len())..]))?;
        drop(head);
        if go_on && !pieces.ended() {
            in_parallel(&mut pieces, &rows, take)?;
        }
        if let Some(fault) = fault {
            // A fault of the clock before the mistake is reported first.
            if gathered.rows > 0 {
                plan.clock(&gathered)?;
            }
            return Err(place(fault, &path, &header.texts(), plan.allowed));
        }
        plan.finish(gathered, &preamble.understood)
    }
}

fn place(fault: Fault, path: &Path, header: &[String], allowed: &[&str]) -> TableError {
    fault.placed(path, header, allowed)
}

/// Reads pieces, gives them to threads in turn, and takes the results in the order of the file, until `take` has
/// enough. Without any thread it parses them itself.
fn in_parallel(
    pieces: &mut Pieces,
    rows: &ParsedRows,
    mut take: impl FnMut(&Parsed) -> Result<bool, TableError>,
) -> Result<(), TableError> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(MOST_THREADS);
    thread::scope(|scope| {
        let lane = |_| {
            // One piece in work and one result for each thread, so that memory is bounded.
            let (work, pieces) = sync_channel::<Vec<u8>>(1);
            let (done, results) = sync_channel(1);
            let spawned = thread::Builder::new().spawn_scoped(scope, move || {
                for piece in pieces {
                    let parsed = rows.parse(&piece);
                    if done.send((parsed, piece)).is_err() {
                        return;
                    }
                }
            });
            spawned.ok().map(|_| (work, results))
        };
        // The system may have no more threads for this user.
        let lanes: Vec<_> = (0..threads).map_while(lane).collect();
        let threads = lanes.len();
        // Only a thread that panicked closes its lane, and the scope passes that panic on.
        let mut given = 0;
        let mut spare = Vec::new();
        while let Some(piece) = pieces.next(spare)? {
            if threads == 0 {
                if !take(&rows.parse(&piece))? {
                    return Ok(());
                }
                spare = piece;
                continue;
            }
            let (work, results) = &lanes[given % threads];
            spare = Vec::new();
            if given >= threads
                && let Ok((parsed, used)) = results.recv()
            {
                if !take(&parsed)? {
                    return Ok(());
                }
                spare = used;
            }
            if work.send(piece).is_err() {
                return Ok(());
            }
            given += 1;
        }
        for k in given.saturating_sub(threads)..given {
            if let Ok((parsed, _)) = lanes[k % threads].1.recv()
                && !take(&parsed)?
            {
                return Ok(());
            }
        }
        Ok(())
    })
}
