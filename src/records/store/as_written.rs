//! Whether a run is as it was written: its files against its digests and its journal, its signature, and files that its station
//! did not write.

use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::{Path, PathBuf};

use super::agree;
use super::begun;
use super::captured::CapturedFiles;
use super::digest::{Below, FileDigests};
use super::litter::{self, is_litter};
use super::reader::{ReadError, fold};
use super::unread::says_nothing;
use super::{
    DIGESTS, PublicKey, SIGNATURE, StoreError, Unread, captures, chain, digest, folded, goes_on, names, pending,
};

/// Longest list of digests: that of a run of 20,000 items with all of their files.
const MAX_DIGESTS_BYTES: u64 = 64 << 20;

/// The result of a comparison of a run with its digests and its journal.
#[derive(Debug, Default)]
pub struct Verified {
    /// What is wrong, a sentence each; empty if all is as it was written.
    pub problems: Vec<String>,
    /// What could not be read: nothing is known of it. What could be was compared.
    pub unread: Vec<Unread>,
    /// A later version of the station wrote the journal: only the digests are compared, not the content of the journal.
    pub newer: Option<ReadError>,
    /// A station is writing the run now: it has no digests yet, and nothing is wrong with it.
    pub running: bool,
    /// A station made the folder and ended before the first event: it holds nothing that could be wrong.
    pub never_begun: bool,
    /// The station ended, or could not write, before the run was closed, and its next start does so: what is missing, a sentence.
    pub incomplete: Option<String>,
    /// The run has its digests, and files of it wait for their names: its station ended, or could not write, between the two. What is
    /// missing, a sentence; the next start does it.
    pub unnamed: Option<String>,
    /// All files that the station wrote are as they were, and the problems are files that a file manager may have added.
    pub only_litter: bool,
}

/// Problems of a run's folder, as far as this version of the station can tell; empty if all is as it was written. For a
/// run of a later version this cannot be confirmed.
#[must_use]
pub fn verify(folder: &Path) -> Vec<String> {
    check(folder).into_sentences()
}

impl Verified {
    /// Of a comparison that an error ended.
    fn broken_off(error: StoreError) -> Self {
        match Unread::of(error) {
            Ok(unread) => Self { unread: vec![unread], ..Self::default() },
            Err(error) => Self { problems: vec![gnc_text::with_causes(&error)], ..Self::default() },
        }
    }

    /// All that keeps the run from being as it was written, a sentence each.
    #[must_use]
    pub fn into_sentences(self) -> Vec<String> {
        let Self { mut problems, unread, newer, running, never_begun, incomplete, unnamed, only_litter: _ } = self;
        problems.extend(unread.into_iter().map(|unread| unread.why));
        problems.extend(incomplete);
        problems.extend(unnamed);
        problems.extend(newer.map(|newer| newer.to_string()));
        problems.extend(never_begun.then(|| ReadError::NeverBegun.to_string()));
        problems.extend(running.then(|| "the run goes on, so it cannot be verified yet".to_owned()));
        problems
    }
}

/// Problems of a run that has its digests and that no other station holds, whether its files have their names or not, and without files
/// that are none of the run.
pub(crate) fn changes(folder: &Path) -> Vec<String> {
    let checked = compare(folder, true).unwrap_or_else(Verified::broken_off);
    let Verified { mut problems, unread, newer, never_begun, incomplete, .. } = checked;
    problems.extend(unread.into_iter().map(|unread| unread.why));
    problems.extend(incomplete);
    problems.extend(newer.map(|newer| newer.to_string()));
    problems.extend(never_begun.then(|| ReadError::NeverBegun.to_string()));
    problems
}

/// What to say of a file that the digests do not cover.
pub(crate) fn was_added(file: &Path) -> String {
    format!("{} was added", gnc_text::shown_path(file))
}

/// Files in the folder of a closed run that its digests do not cover: the station did not write them.
#[must_use]
pub fn strangers(folder: &Path) -> Vec<PathBuf> {
    let Ok((sums, _)) = FileDigests::read(folder) else { return Vec::new() };
    let promised = sums.into_map();
    let waiting: Vec<PathBuf> =
        waiting_of(folder, &promised).into_iter().map(|name| pending::waiting_name(name).into()).collect();
    let mut files = digest::files_below(folder).unwrap_or_default();
    files.retain(|file| !promised.contains_key(file) && !waiting.contains(file));
    files
}

/// What to say of a closed run whose folder holds files that the station did not write, and what to do.
#[must_use]
pub fn of_strangers(folder: &Path) -> Option<(String, &'static str)> {
    let strangers = strangers(folder);
    let what = format!(
        "files in the folder of the run that the station did not write are not sealed with it: {}, {} in all",
        gnc_text::shown_path(strangers.first()?),
        strangers.len()
    );
    Some((what, "take them out of the folder, and find out what put them there; `records verify` calls them added"))
}

/// Compares a run's folder with its digests and its journal.
#[must_use]
pub fn check(folder: &Path) -> Verified {
    let check = || {
        let waiting = pending::waiting(folder);
        let checked = compare(folder, false).unwrap_or_else(Verified::broken_off);
        (checked, waiting != pending::waiting(folder))
    };
    let checked = match check() {
        // Its station gave files their names meanwhile.
        (_, true) => check().0,
        (checked, false) => checked,
    };
    if checked.unnamed.is_some() && checked.problems.is_empty() && checked.unread.is_empty() && goes_on(folder) {
        return Verified { running: true, ..Verified::default() };
    }
    checked
}

/// Those files of a run that its digests name and that wait for their names.
fn waiting_of(folder: &Path, promised: &BTreeMap<PathBuf, String>) -> Vec<&'static str> {
    pending::waiting(folder).into_iter().filter(|name| promised.contains_key(Path::new(name))).collect()
}

/// Whether a closed run has a signature.
#[must_use]
pub fn is_signed(folder: &Path) -> bool {
    folder.join(SIGNATURE).symlink_metadata().is_ok()
}

/// The problem with the signature of a run's digests by one of the keys, if any. Without keys nothing is checked.
#[must_use]
pub fn verify_signature(folder: &Path, keys: &[PublicKey]) -> Option<String> {
    signature(folder, keys).unwrap_or_else(|unread| Some(unread.why))
}

/// The same, and apart from it a signature that could not be read.
///
/// # Errors
/// The signature is there, and could not be read.
pub fn signature(folder: &Path, keys: &[PublicKey]) -> Result<Option<String>, Unread> {
    let read = |name| gnc_files::read_below(folder, Path::new(name), MAX_DIGESTS_BYTES);
    Ok(match (read(DIGESTS), read(SIGNATURE)) {
        _ if keys.is_empty() => None,
        (Ok(digests), Ok(signature)) if keys.iter().any(|key| key.signed(&digests, &signature)) => None,
        (Ok(_), Ok(_)) => Some(format!("{SIGNATURE} is not the signature of {DIGESTS} with this key")),
        (Ok(_), Err(error)) if error.kind() == io::ErrorKind::NotFound => {
            Some(format!("{SIGNATURE} is missing: the run is not signed"))
        }
        (Ok(_), Err(source)) if says_nothing(&source) => return Err(Unread::new(&folder.join(SIGNATURE), source)),
        (Ok(_), Err(source)) => {
            let error = StoreError::File { what: "read", path: folder.join(SIGNATURE), source };
            Some(gnc_text::with_causes(&error))
        }
        // `verify` reports missing digests.
        (Err(_), _) => None,
    })
}

/// What the journal of a run says of its raw files and the station did not sign with one of the keys, a sentence each. Without
/// keys nothing is checked.
#[must_use]
pub fn verify_captured(folder: &Path, keys: &[PublicKey]) -> Vec<String> {
    // `verify` reports a journal that cannot be read.
    let captured = CapturedFiles::read(folder).ok().filter(|_| !keys.is_empty());
    captured.map_or_else(Vec::new, |captured| captured.unsigned(keys))
}

/// `is_ours`: the caller holds the run, so that no station writes it.
fn compare(folder: &Path, is_ours: bool) -> Result<Verified, StoreError> {
    let only = |problem: String| Ok(Verified { problems: vec![problem], ..Verified::default() });
    let path = folder.join(DIGESTS);
    let looked = path.symlink_metadata();
    if let Err(source) = looked
        && says_nothing(&source)
    {
        // Of a folder that cannot be entered it is not known what is there.
        return Ok(Verified { unread: vec![Unread::new(folder, source)], ..Verified::default() });
    }
    // Looked at before the journal is read: a run that ends meanwhile has its digests then.
    let is_under_way = || !path.exists() || !pending::waiting(folder).is_empty();
    // A run whose line is in the chain is whole, whatever holds its folder.
    if !is_ours && is_under_way() && goes_on(folder) && !chain::is_closed(folder).unwrap_or(false) {
        return Ok(Verified { running: true, ..Verified::default() });
    }
    let mut unread = Vec::new();
    let (state, newer) = match fold(folder) {
        Ok(state) => (Some(state), None),
        Err(error) if error.is_newer() => (None, Some(error)),
        // The digests say what it was.
        Err(ReadError::NeverBegun) if path.exists() => (None, None),
        Err(ReadError::NeverBegun) => return Ok(Verified { never_begun: true, ..Verified::default() }),
        Err(error) => match Unread::of_read(error) {
            // The other files are compared all the same.
            Ok(journal) => {
                unread.push(journal);
                (None, None)
            }
            Err(error) => return only(begun::strangers(folder).unwrap_or_else(|| gnc_text::with_causes(&error))),
        },
    };
    if let Some(strangers) = begun::strangers(folder) {
        return only(strangers);
    }
    let state = state.filter(|state| state.header().is_some() || !path.exists());
    // The next start seals an interrupted run. What its journal says of captures holds already.
    if state.as_ref().is_some_and(|state| state.header().is_none() || state.is_interrupted()) && !path.exists() {
        let station =
            state.as_ref().and_then(|state| state.header()).map(|header| gnc_text::printable(&header.station));
        let what = station.map_or_else(
            || "interrupted: its station ended, or could not write, in the run; the next start seals it".to_owned(),
            |station| {
                format!(
                    "interrupted: its station ended, or could not write, in the run; the next start of the station {station} seals it, with a key if it had one"
                )
            },
        );
        let (mut problems, more) =
            CapturedFiles::read(folder).map(|captured| captured.unlike(folder, &HashMap::new())).unwrap_or_default();
        add(&mut unread, &mut problems, more);
        problems.extend(state.as_ref().and_then(|state| names::unlike(folder, state)));
        return Ok(Verified { problems, unread, incomplete: Some(what), newer, ..Verified::default() });
    }
    if !path.exists() && !unread.is_empty() {
        return Ok(Verified { unread, newer, ..Verified::default() });
    }
    if !path.exists() {
        let problem = format!(
            "ended and not closed, so it cannot be verified: {DIGESTS} is missing; if its station ended too early, or could not write, its next start closes the run late"
        );
        let problems: Vec<String> = state.as_ref().and_then(|state| names::unlike(folder, state)).into_iter().collect();
        return Ok(Verified { problems, incomplete: Some(problem), newer, ..Verified::default() });
    }
    let (sums, bad) = match FileDigests::read(folder) {
        Ok(read) => read,
        Err(error) => {
            // Without digests the journal alone tells what it was.
            unread.push(Unread::of(error)?);
            let mut problems: Vec<String> =
                state.as_ref().and_then(|state| names::unlike(folder, state)).into_iter().collect();
            if let Ok(captured) = CapturedFiles::read(folder) {
                let (unlike, more) = captured.unlike(folder, &HashMap::new());
                problems.extend(unlike);
                add(&mut unread, &mut problems, more);
            }
            return Ok(Verified { problems, unread, newer, ..Verified::default() });
        }
    };
    let mut problems = vec![format!("{DIGESTS} holds a line that is not a digest"); bad];
    problems.extend(state.as_ref().and_then(|state| names::unlike(folder, state)));
    let record_sha256 = sums.of_record();
    let mut promised = sums.into_map();
    let waiting = waiting_of(folder, &promised);
    let mut added = Vec::new();
    // The digests have the names that these files get when the run is closed.
    let waiting: HashMap<PathBuf, &str> =
        waiting.iter().map(|name| (pending::waiting_name(name).into(), *name)).collect();
    let mut unnamed = None;
    let mut known = HashMap::new();
    let Below { files, mut empty, unread: closed } = digest::readable_below(folder)?;
    let below: Vec<PathBuf> = {
        let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        closed.iter().filter_map(|one| Some(one.path.strip_prefix(&whole).ok()?.to_owned())).collect()
    };
    // What stands below such a folder is not missing.
    promised.retain(|file, _| !below.iter().any(|closed| file.starts_with(closed)));
    unread.extend(closed);
    for file in files.clone() {
        let named = waiting.get(&file).map(Path::new);
        if named.is_some() {
            unnamed = Some(format!(
                "{} waits for its name: its station ended, or could not write, while it closed the run; the next start goes on",
                gnc_text::shown_path(&file)
            ));
        }
        match promised.remove(named.unwrap_or(&file)) {
            None => added.push(file),
            // A link or a device in place of the file is not a file of the record, wherever it points.
            Some(_) if !folder.join(&file).symlink_metadata().is_ok_and(|meta| meta.is_file()) => {
                problems.push(format!("{} was replaced by something that is not a file", gnc_text::shown_path(&file)));
            }
            Some(digest) => match digest::of_file(&folder.join(&file)) {
                Ok(found) if found == digest => {
                    drop(known.insert(named.map_or_else(|| file.clone(), Path::to_owned), digest));
                }
                Ok(_) => problems.push(format!("{} was changed", gnc_text::shown_path(&file))),
                Err(error) => add(&mut unread, &mut problems, vec![error]),
            },
        }
    }
    // A copy on a disk that folds names has all files, and each under another name.
    let folded = |file: &Path| folded::fold(&file.to_string_lossy());
    let mut renamed = None;
    if added.len() == promised.len() {
        let by_folded: HashMap<String, &PathBuf> = added.iter().map(|added| (folded(added), added)).collect();
        let is_copy = |file: &PathBuf, digest: &String| {
            let copy = *by_folded.get(&folded(file))?;
            digest::of_file(&folder.join(copy))
                .is_ok_and(|found| found == *digest)
                .then(|| (file.clone(), copy.clone()))
        };
        let copies: Option<Vec<_>> = promised.iter().map(|(file, digest)| is_copy(file, digest)).collect();
        renamed = copies.and_then(|copies| copies.first().cloned());
    }
    let mut only_litter = false;
    match renamed {
        Some((was, is)) => {
            let (was, is) = (gnc_text::shown_path(&was), gnc_text::shown_path(&is));
            problems.push(match added.len() {
                1 => format!(
                    "1 file has another name, {was} is {is}: the run was copied to a file system that changes names"
                ),
                files => format!(
                    "{files} files have other names, {was} is {is}: the run was copied to a file system that changes names"
                ),
            });
        }
        None => {
            // A start that closes the run leaves files of strangers out: they are no reason to leave the run open.
            if is_ours {
                added.clear();
                empty.clear();
            }
            only_litter = problems.is_empty()
                && promised.is_empty()
                && !(added.is_empty() && empty.is_empty())
                && added.iter().chain(&empty).all(|file| is_litter(file));
            problems.extend(added.iter().chain(&empty).map(|file| litter::added(file, only_litter)));
            problems.extend(promised.keys().map(|file| format!("{} is missing", gnc_text::shown_path(file))));
        }
    }
    problems.extend(captures::of_other_runs(folder, &files, &mut unread));
    if let Some(state) = state {
        match CapturedFiles::read(folder) {
            Ok(captured) => {
                let (unlike, more) = captured.unlike(folder, &known);
                problems.extend(unlike);
                add(&mut unread, &mut problems, more);
            }
            Err(error) => match Unread::of_read(error) {
                Ok(journal) => unread.push(journal),
                Err(error) => problems.push(gnc_text::with_causes(&error)),
            },
        }
        problems.extend(agree::unlike(folder, state, &record_sha256, &known));
    }
    only_litter &= problems.len() == added.len() + empty.len();
    Ok(Verified { problems, unread, newer, unnamed, only_litter, ..Verified::default() })
}

/// Adds what could not be read to the one list, and each other error to the other.
fn add(unread: &mut Vec<Unread>, problems: &mut Vec<String>, errors: Vec<StoreError>) {
    for error in errors {
        match Unread::of(error) {
            Ok(one) => unread.push(one),
            Err(error) => problems.push(gnc_text::with_causes(&error)),
        }
    }
}
