//! Plans and bench files from the disk.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use gnc_analysis::motion;
use gnc_executive::bench::{BenchFile, MAX_BENCH_BYTES};
use gnc_executive::plan::{MAX_PLAN_BYTES, Plan};

use crate::refusal::Refusal;

/// Reads and checks a plan with all that it includes.
pub(crate) fn plan(path: &Path) -> Result<Plan, Refusal> {
    let bytes = read(path, MAX_PLAN_BYTES).map_err(|error| cannot_read("plan", path, &error))?;
    let mut load = |name: &str| read(Path::new(name), MAX_PLAN_BYTES).map_err(|error| error.to_string());
    let plan = Plan::read(&path.to_string_lossy(), bytes, &mut load);
    // What it does with the module is known here alone.
    plan.and_then(|plan| plan.check(motion::mistakes)).map_err(|mistakes| Refusal::new(mistakes, ""))
}

/// Reads and checks a bench file.
pub(crate) fn bench(path: &Path) -> Result<BenchFile, Refusal> {
    let bytes = read(path, MAX_BENCH_BYTES).map_err(|error| cannot_read("bench file", path, &error))?;
    BenchFile::read(&path.to_string_lossy(), bytes).map_err(|mistakes| Refusal::new(mistakes, ""))
}

/// At most one byte more than the limit, so that the checker can say that there are too many.
fn read(path: &Path, limit: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(limit as u64 + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn cannot_read(what: &str, path: &Path, error: &io::Error) -> Refusal {
    let try_this = match error.kind() {
        io::ErrorKind::NotFound => "check the path; it goes from the folder you are in",
        io::ErrorKind::IsADirectory => "name the file in that folder",
        io::ErrorKind::PermissionDenied => "make it readable for this user",
        _ => "check the disk",
    };
    Refusal::new(format!("cannot read the {what} {}: {error}", path.display()), try_this)
}
