//! Reads plans and bench files from the disk, and finds out whether they have changed since.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use gnc_bench::service::CheckedPlan;
use gnc_executive::bench::{BenchFile, MAX_BENCH_BYTES};
use gnc_executive::plan::{MAX_PLAN_BYTES, Plan, PlanItem};
use gnc_text::quoted;

use crate::refusal::CommandRefusal;

/// Reads and checks a plan with all that it includes, and with its pictures.
pub(crate) fn plan(path: &Path) -> Result<CheckedPlan, CommandRefusal> {
    checked(path, missing_pictures)
}

/// The same for a plan that asks nobody: its limits judge what was answered before.
pub(crate) fn plan_to_judge(path: &Path) -> Result<CheckedPlan, CommandRefusal> {
    checked(path, |_| Vec::new())
}

fn checked(
    path: &Path,
    look: impl Fn(&PlanItem) -> Vec<(String, &'static str)>,
) -> Result<CheckedPlan, CommandRefusal> {
    let bytes = read(path, MAX_PLAN_BYTES).map_err(|error| cannot_read("plan", path, &error))?;
    let mut load = |name: &str| read(Path::new(name), MAX_PLAN_BYTES).map_err(|error| error.to_string());
    let plan = Plan::read(&path.to_string_lossy(), bytes, &mut load);
    plan.and_then(|plan| plan.check(look))
        .and_then(CheckedPlan::new)
        .map_err(|mistakes| CommandRefusal::new(mistakes, ""))
}

/// The pictures of questions that are not there. An operator who is told to look at one must find it.
fn missing_pictures(item: &PlanItem) -> Vec<(String, &'static str)> {
    let pictures = item.questions.iter().filter_map(|question| Some((question, question.picture.as_deref()?)));
    let missing = pictures.filter(|(_, path)| !Path::new(path).is_file());
    let told = missing.map(|(question, path)| {
        let what = format!("the question {} shows {}, and there is no such file", question.name, quoted(path));
        (what, "the path is relative to the plan's file")
    });
    told.collect()
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

/// The files of a plan that have changed since they were checked.
pub(crate) fn changed_plan(path: &Path, plan: &CheckedPlan) -> Vec<ChangedFile> {
    // The plan's name may be written in another encoding than its path, so compare by the path as it was given.
    let paths = std::iter::once(path).chain(plan.plan().files().skip(1).map(|(name, _)| Path::new(name)));
    paths.zip(plan.plan().files()).filter_map(|(path, (_, text))| changed(path, text)).collect()
}

/// Returns a file that has changed since it was read.
pub(crate) fn changed(path: &Path, was: &[u8]) -> Option<ChangedFile> {
    let name = path.display().to_string();
    match read(path, was.len()) {
        Ok(is) if is == was => None,
        Ok(_) => Some(ChangedFile { name, unreadable: None }),
        Err(error) => Some(ChangedFile { name, unreadable: Some(error.to_string()) }),
    }
}

/// Reads at most one byte more than the limit, so that the checker can report a file that is too long.
fn read(path: &Path, limit: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(limit as u64 + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn cannot_read(what: &str, path: &Path, error: &io::Error) -> CommandRefusal {
    let try_this = match error.kind() {
        io::ErrorKind::NotFound => "check the path; it starts at the current folder",
        io::ErrorKind::IsADirectory => "name the file in that folder",
        io::ErrorKind::PermissionDenied => "make it readable for this user",
        _ => "check the disk",
    };
    CommandRefusal::new(format!("cannot read the {what} {}: {error}", path.display()), try_this)
}
