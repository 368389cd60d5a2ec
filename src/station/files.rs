//! Reads plans and bench files from the disk, and finds out whether they have changed since.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use gnc_bench::service::CheckedPlan;
use gnc_config::Mistakes;
use gnc_executive::bench::{BenchFile, MAX_BENCH_BYTES};
use gnc_executive::plan::{MAX_PLAN_BYTES, Plan, PlanItem, UnreadInclude};
use gnc_files::{Reach, Refused, is_refused};
use gnc_records::store::digest;
use gnc_text::quoted;

use crate::refusal::CommandRefusal;

/// Largest size of a picture: photographs of phones have 2 to 12 MiB.
const MAX_PICTURE_BYTES: usize = 16 << 20;
/// What is said of a file outside of the plan's folder. The hint of its place stands elsewhere.
const OUTSIDE: &str = "it lies outside of the plan's folder, and only --allow-outside allows that";
/// What can be tried with it.
const BESIDE: &str = "put it beside the plan; or allow files of other folders with --allow-outside";

/// Reads and checks a plan with all that it includes, and with its pictures, whose digests it notes.
pub(crate) fn plan(path: &Path, reach: Reach) -> Result<CheckedPlan, CommandRefusal> {
    checked(path, reach, |plan| {
        let read: BTreeMap<String, Result<String, PictureFileError>> = pictures(&plan)
            .map(|picture| {
                (picture.to_owned(), named_picture(path, picture, reach).map(|bytes| digest::of_bytes(&bytes)))
            })
            .collect();
        let plan = plan.check(|item| picture_mistakes(item, &read))?;
        Ok(plan.with_pictures(|path| read.get(path).and_then(|read| read.as_ref().ok()).cloned()))
    })
}

/// The same for a plan that asks nobody: its limits judge what was answered before.
pub(crate) fn plan_to_judge(path: &Path, reach: Reach) -> Result<CheckedPlan, CommandRefusal> {
    checked(path, reach, Ok)
}

fn checked(
    path: &Path,
    reach: Reach,
    look: impl Fn(Plan) -> Result<Plan, Mistakes>,
) -> Result<CheckedPlan, CommandRefusal> {
    let bytes = read(path, MAX_PLAN_BYTES).map_err(|error| cannot_read("plan", path, &error))?;
    let mut load = |name: &str| {
        let read = gnc_files::named_beginning(folder_of(path), Path::new(name), reach, one_more(MAX_PLAN_BYTES));
        read.map_err(|error| match (is_refused(&error), error.kind()) {
            (Some(Refused::Outside), _) => UnreadInclude { why: OUTSIDE.to_owned(), try_this: Some(BESIDE) },
            (None, io::ErrorKind::NotFound) => error.to_string().into(),
            _ => UnreadInclude { why: error.to_string(), try_this: Some(how_to_read(&error)) },
        })
    };
    let plan = Plan::read_from(&path.to_string_lossy(), bytes, &mut load);
    plan.and_then(look).and_then(CheckedPlan::new).map_err(|mistakes| CommandRefusal::new(mistakes, ""))
}

/// The folder in which the files lie that a plan names: that of the plan with which a person began.
fn folder_of(plan: &Path) -> &Path {
    plan.parent().unwrap_or_else(|| Path::new(""))
}

/// The paths of the pictures that a plan shows.
fn pictures(plan: &Plan) -> impl Iterator<Item = &str> {
    let questions = plan.items().iter().flat_map(|item| &item.questions);
    questions.filter_map(|question| question.picture.as_deref())
}

/// The digest of a picture now. Where it lies was looked at when the plan was checked.
fn picture_sha256(path: &str) -> Result<String, PictureFileError> {
    picture(Path::new(path)).map(|bytes| digest::of_bytes(&bytes))
}

/// The pictures of questions that are not there or cannot be read. An operator who is told to look at one must find it.
fn picture_mistakes(
    item: &PlanItem,
    read: &BTreeMap<String, Result<String, PictureFileError>>,
) -> Vec<(String, &'static str)> {
    let pictures = item.questions.iter().filter_map(|question| Some((question, question.picture.as_deref()?)));
    let mistakes = pictures.filter_map(|(question, path)| {
        let error = read.get(path)?.as_ref().err()?;
        let (name, path) = (&question.name, quoted(path));
        Some(match error {
            PictureFileError::Missing => (
                format!("the question {name} shows {path}, and there is no such file"),
                "the path is relative to the plan's file",
            ),
            PictureFileError::Outside => {
                (format!("the question {name} shows {path}, which lies outside of the plan's folder"), BESIDE)
            }
            PictureFileError::TooLarge => (
                format!("the question {name} shows {path}, which has more than {} MiB", MAX_PICTURE_BYTES >> 20),
                "save the picture with fewer pixels",
            ),
            PictureFileError::Unreadable(error) => {
                (format!("the question {name} shows {path}, which cannot be read: {error}"), how_to_read(error))
            }
        })
    });
    mistakes.collect()
}

/// Why a picture is not read.
#[derive(Debug)]
pub(crate) enum PictureFileError {
    /// There is no file.
    Missing,
    /// It lies outside of the plan's folder.
    Outside,
    TooLarge,
    Unreadable(io::Error),
}

/// Reads a picture that a checked plan shows. A pipe or a device in its place blocks nothing.
pub(crate) fn picture(path: &Path) -> Result<Vec<u8>, PictureFileError> {
    whole_picture(gnc_files::read_beginning(path, one_more(MAX_PICTURE_BYTES)))
}

/// Reads a picture that a plan names.
fn named_picture(plan: &Path, path: &str, reach: Reach) -> Result<Vec<u8>, PictureFileError> {
    whole_picture(gnc_files::named_beginning(folder_of(plan), Path::new(path), reach, one_more(MAX_PICTURE_BYTES)))
}

fn whole_picture(read: io::Result<Vec<u8>>) -> Result<Vec<u8>, PictureFileError> {
    let bytes = read.map_err(|error| match (is_refused(&error), error.kind()) {
        (Some(Refused::Outside), _) => PictureFileError::Outside,
        (None, io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => PictureFileError::Missing,
        _ => PictureFileError::Unreadable(error),
    })?;
    if bytes.len() > MAX_PICTURE_BYTES { Err(PictureFileError::TooLarge) } else { Ok(bytes) }
}

/// Reads and checks a bench file.
pub(crate) fn bench(path: &Path) -> Result<BenchFile, CommandRefusal> {
    let (file, _) = bench_and_text(path)?;
    Ok(file)
}

/// Reads and checks a bench file, and keeps what was read.
pub(crate) fn bench_and_text(path: &Path) -> Result<(BenchFile, ReadFile), CommandRefusal> {
    let bytes = read(path, MAX_BENCH_BYTES).map_err(|error| cannot_read("bench file", path, &error))?;
    let text = ReadFile { path: path.to_owned(), bytes: bytes.clone() };
    let file = BenchFile::read(&path.to_string_lossy(), bytes).map_err(|mistakes| CommandRefusal::new(mistakes, ""))?;
    Ok((file, text))
}

/// A file as it was when it was read.
#[derive(Debug, Clone)]
pub(crate) struct ReadFile {
    pub path: PathBuf,
    pub bytes: Vec<u8>,
}

/// A file that has changed since it was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ChangedFile {
    /// Its name, as the user or an include gave it.
    pub name: String,
    /// Why it cannot be read any more; `None` if it holds something else.
    pub unreadable: Option<String>,
}

/// The files of a plan, its pictures included, that have changed since they were checked.
pub(crate) fn changed_plan(path: &Path, plan: &CheckedPlan) -> Vec<ChangedFile> {
    // The plan's name may be written in another encoding than its path, so compare by the path as it was given.
    let paths = std::iter::once(path).chain(plan.plan().files().skip(1).map(|(name, _)| Path::new(name)));
    let texts = paths.zip(plan.plan().files()).filter_map(|(path, (_, text))| changed(path, text));
    let items = plan.plan().items().iter();
    let pictures: BTreeMap<&str, Option<&str>> = items
        .flat_map(|item| &item.questions)
        .filter_map(|question| Some((question.picture.as_deref()?, question.picture_sha256.as_deref())))
        .collect();
    texts.chain(pictures.into_iter().filter_map(|(path, was)| changed_picture(path, was))).collect()
}

fn changed_picture(path: &str, was: Option<&str>) -> Option<ChangedFile> {
    let unreadable = match picture_sha256(path) {
        Ok(is) if Some(is.as_str()) == was => return None,
        Ok(_) | Err(PictureFileError::TooLarge) => None,
        Err(PictureFileError::Missing | PictureFileError::Outside) => {
            Some(io::Error::from(io::ErrorKind::NotFound).to_string())
        }
        Err(PictureFileError::Unreadable(error)) => Some(error.to_string()),
    };
    Some(ChangedFile { name: path.to_owned(), unreadable })
}

/// Returns a file that has changed since it was read.
pub(crate) fn changed(path: &Path, was: &[u8]) -> Option<ChangedFile> {
    let name = gnc_text::shown_path(path);
    match read(path, was.len()) {
        Ok(is) if is == was => None,
        Ok(_) => Some(ChangedFile { name, unreadable: None }),
        Err(error) => Some(ChangedFile { name, unreadable: Some(error.to_string()) }),
    }
}

/// Reads at most one byte more than the limit, so that the checker can report a file that is too long.
fn read(path: &Path, limit: usize) -> io::Result<Vec<u8>> {
    gnc_files::read_beginning(path, one_more(limit))
}

fn one_more(limit: usize) -> u64 {
    limit as u64 + 1
}

fn cannot_read(what: &str, path: &Path, error: &io::Error) -> CommandRefusal {
    let try_this = match (is_refused(error), error.kind()) {
        (None, io::ErrorKind::NotFound) => "check the path; it starts at the current folder",
        _ => how_to_read(error),
    };
    CommandRefusal::new(format!("cannot read the {what} {}: {error}", gnc_text::shown_path(path)), try_this)
}

/// Whether a file has this name in this folder. A link that leads nowhere is no missing file: a person has put it there.
pub(crate) fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// What can be tried with a file that was found and cannot be read.
pub(crate) fn how_to_read(error: &io::Error) -> &'static str {
    match (is_refused(error), error.kind()) {
        (Some(Refused::Folder), _) => "name the file in that folder",
        (Some(Refused::TooLong { .. }), _) => "is this the right file?",
        (Some(Refused::Link | Refused::Circle), _) => "name the file itself and not the link",
        (Some(_), _) => "name a file; what a program writes, save as a file first",
        (None, io::ErrorKind::PermissionDenied) => "make it readable for this user",
        (None, io::ErrorKind::InvalidData) => "save the file with the encoding UTF-8",
        (None, io::ErrorKind::NotFound | io::ErrorKind::NotADirectory | io::ErrorKind::InvalidFilename) => {
            "check the path"
        }
        (None, _) => "check the disk",
    }
}

#[cfg(test)]
mod tests;
