//! Compares the lines of each run with one another and with its folder: a run that began and is gone, one that was closed twice,
//! one whose journal is not the one that began.

use std::collections::{HashMap, HashSet};
use std::io;
use std::path::Path;

use super::begin;
use super::check::{ChainBook, ChainCheck};
use super::entry::ChainEntry;
use crate::store::unread::says_nothing;
use crate::store::{DIGESTS, StoreError, UNASSIGNED, Unread, digest, folded, goes_on, on, reader};

pub(super) fn check(book: &ChainBook, checked: &mut ChainCheck) {
    check_lines(book, &book.lines.iter().collect::<Vec<_>>(), checked);
}

/// Checks some of the lines; all lines of a run must be among them.
pub(super) fn check_lines(book: &ChainBook, lines: &[&ChainEntry], checked: &mut ChainCheck) {
    let ChainCheck { problems, unread, .. } = checked;
    let (closes, begins): (Vec<&ChainEntry>, Vec<&ChainEntry>) = lines.iter().partition(|line| line.is_close());
    // Versions of the station that wrote no line when a run began wrote all lines before this one.
    let since = book.lines.iter().find(|line| !line.is_close()).map(|line| line.number);
    let mut began: HashMap<&str, &ChainEntry> = HashMap::new();
    for line in &begins {
        if let Some(earlier) = began.insert(&line.run, line) {
            problems.push(format!(
                "line {} of the chain ({}): the run began twice, line {} says it as well",
                line.number, line.run, earlier.number
            ));
        }
    }
    let mut closed: HashMap<&str, &ChainEntry> = HashMap::new();
    let mut by_name: HashMap<&str, &ChainEntry> = HashMap::new();
    for line in &closes {
        let by_name = by_name.insert(&line.run, line);
        if let Some(earlier) = closed.insert(line.began_as(), line).or(by_name) {
            problems.push(format!(
                "line {} of the chain ({}): the run was closed twice, line {} says it as well",
                line.number, line.run, earlier.number
            ));
        }
    }
    for line in lines.iter().filter(|line| !line.is_true()) {
        problems.push(format!("line {} of the chain ({}): it was changed", line.number, line.run));
    }
    for line in closes {
        let is_there = closed_folder(book, line, problems, unread);
        match began.get(line.began_as()) {
            Some(begin) if begin.number > line.number => {
                problems.push(format!(
                    "line {} of the chain ({}): the run was closed before it began",
                    line.number, line.run
                ));
            }
            Some(begin) => {
                let looked = if is_there { is_same(book, begin, &line.run) } else { Ok(true) };
                let is_moved = line.from.as_ref().is_none_or(|from| {
                    let day = from.split('/').next().unwrap_or_default();
                    line.run.split('/').take(2).eq([day, UNASSIGNED])
                });
                match looked {
                    Err(one) if is_moved => unread.push(one),
                    Ok(true) if is_moved => {}
                    _ => problems.push(not_as_it_began(begin.number, &line.run)),
                }
            }
            None if line.from.is_some() || since.is_some_and(|since| line.number > since) => {
                problems.push(format!(
                    "line {} of the chain ({}): the run was closed, and no line says that it began",
                    line.number, line.run
                ));
            }
            None => {}
        }
    }
    let mut moved = Moved::default();
    for line in begins.into_iter().filter(|line| !closed.contains_key(line.run.as_str())) {
        open_folder(book, line, &mut moved, problems, unread);
    }
}

fn not_as_it_began(number: u64, run: &str) -> String {
    format!("line {number} of the chain ({run}): the journal does not begin as it did when the run began")
}

/// Compares the line of a closed run with its folder. `false`: the folder cannot be looked at.
fn closed_folder(book: &ChainBook, line: &ChainEntry, problems: &mut Vec<String>, unread: &mut Vec<Unread>) -> bool {
    let (number, run) = (line.number, &line.run);
    match digest_below(&book.records, &Path::new(run).join(DIGESTS)) {
        Ok(digest) if digest == line.digest => return true,
        Ok(_) => {
            problems
                .push(format!("line {number} of the chain ({run}): {DIGESTS} was changed after the run was closed"));
            return true;
        }
        Err(StoreError::File { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
            // Of a folder that cannot be entered it is not known either.
            match book.records.join(run).symlink_metadata() {
                Ok(_) => problems.push(format!("line {number} of the chain ({run}): the run was closed, and its {DIGESTS} is missing")),
                Err(_) => problems.push(match folded::find(&book.records, run) {
                    Some(found) => format!(
                        "line {number} of the chain ({run}): the run stands here as {found}, it was copied to a file system that changes names"
                    ),
                    None => format!("line {number} of the chain ({run}): the run was closed, and its folder is missing"),
                }),
            }
        }
        Err(error) => match Unread::of(error) {
            Ok(one) => unread.push(one),
            Err(error) => problems.push(unreadable(number, run, &error)),
        },
    }
    false
}

fn unreadable(number: u64, run: &str, error: &StoreError) -> String {
    format!("line {number} of the chain ({run}): {}", gnc_text::with_causes(error))
}

fn digest_below(records: &Path, file: &Path) -> Result<String, StoreError> {
    let path = records.join(file);
    digest::of_reader(on(gnc_files::below(records, file), "read", &path)?, &path)
}

/// Whether the journal of a run begins as the line says; an error if it is there, and cannot be read. What is no file, or not there,
/// does not begin so.
fn is_same(book: &ChainBook, begin: &ChainEntry, run: &str) -> Result<bool, Unread> {
    match begin::of_first_line(&book.records, &book.records.join(run)) {
        Ok(digest) => Ok(digest == begin.digest),
        Err(error) => Unread::of(error).map_or(Ok(false), Err),
    }
}

/// What to say of a folder whose journal does not begin as the line says.
pub(super) fn unlike_its_beginning(book: &ChainBook, line: &ChainEntry) -> Result<Option<String>, Unread> {
    let is_same = is_same(book, line, &line.run)?;
    Ok((!is_same).then(|| not_as_it_began(line.number, &line.run)))
}

/// Compares the line of a run that is not closed with its folder. The run goes on, or its station ended.
fn open_folder(
    book: &ChainBook,
    line: &ChainEntry,
    moved: &mut Moved,
    problems: &mut Vec<String>,
    unread: &mut Vec<Unread>,
) {
    let (number, run) = (line.number, &line.run);
    let folder = book.records.join(run);
    match folder.symlink_metadata() {
        Ok(_) => match unlike_its_beginning(book, line) {
            Ok(None) => {}
            // It is closed or moved at this moment.
            Ok(Some(_)) | Err(_) if goes_on(&folder) => {}
            Ok(Some(what)) => problems.push(what),
            Err(one) => unread.push(one),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            // Its module was not the one that was scanned, so that its station moves it.
            if !moved.has(&book.records, line) {
                problems.push(format!("line {number} of the chain ({run}): the run began, and its folder is gone"));
            }
        }
        Err(error) if says_nothing(&error) => unread.push(Unread::new(&folder, error)),
        Err(error) => {
            problems.push(format!("line {number} of the chain ({run}): the folder of the run cannot be read: {error}"));
        }
    }
}

/// What the journals of runs that stand apart begin with. Those of a day are read once.
#[derive(Default)]
struct Moved(HashMap<String, HashSet<String>>);

impl Moved {
    fn has(&mut self, records: &Path, line: &ChainEntry) -> bool {
        let of_day = self.0.entry(line.day().to_owned()).or_insert_with(|| {
            let runs = reader::unassigned(records, line.day());
            runs.iter().filter_map(|run| begin::of_first_line(records, run).ok()).collect()
        });
        of_day.contains(&line.digest)
    }
}
