//! `gnc-station doctor`: checks everything that a bench depends on. For each fault it prints one line with the command
//! that mends it. It changes nothing itself. It asks the board who it is, unless another program works with it.

mod board;
mod bus;
mod holders;
mod key;
mod lines;
mod place;
mod port;
mod scanner;
#[cfg(test)]
mod tests;

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_executive::bench::BenchFile;
use gnc_text::printable;
use holders::Proc;

use crate::files;
use crate::hook::HookProgram;
use crate::locale::Lang;
use crate::phrases::in_language;
use crate::refusal::CommandRefusal;
use crate::setup::{BENCH_FILE, RECORDS};
use crate::wording::Lines;

/// Exit code when a fault makes a test of a module impossible.
const ILL: u8 = 1;

/// The folder in which the kernel describes its devices. Tests use a folder of their own.
#[derive(Debug, Clone)]
pub(crate) struct Sys(PathBuf);

impl Default for Sys {
    fn default() -> Self {
        Self("/sys/class".into())
    }
}

impl Sys {
    /// Returns the first line of a file below this folder.
    fn line(&self, path: impl AsRef<Path>) -> Option<String> {
        let text = std::fs::read_to_string(self.0.join(path)).ok()?;
        Some(text.lines().next().unwrap_or_default().trim().to_owned())
    }

    fn number(&self, path: impl AsRef<Path>) -> Option<i64> {
        let line = self.line(path)?;
        match line.strip_prefix("0x") {
            Some(digits) => i64::from_str_radix(digits, 16).ok(),
            None => line.parse().ok(),
        }
    }
}

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Health {
    /// As it should be.
    Good,
    /// Modules can be tested, but this will cause trouble sooner or later.
    Warning,
    /// No module can be tested like this.
    Bad,
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Finding {
    pub(crate) health: Health,
    /// What was found.
    pub(crate) what: String,
    /// The command or step that mends it; empty if nothing is to be done.
    pub(crate) mend: String,
}

impl Finding {
    fn good(what: impl Into<String>) -> Self {
        Self { health: Health::Good, what: what.into(), mend: String::new() }
    }

    fn warning(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { health: Health::Warning, what: what.into(), mend: mend.into() }
    }

    /// Makes a fault a warning: it concerns an item and not all runs.
    fn soften(&mut self) {
        self.health = self.health.min(Health::Warning);
    }

    fn bad(what: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { health: Health::Bad, what: what.into(), mend: mend.into() }
    }
}

impl Finding {
    /// The line for people: all of its columns begin at the same place in each language.
    pub(crate) fn line(&self, lang: Lang) -> String {
        let word = match self.health {
            Health::Good => "ok      ",
            Health::Warning => "warning ",
            Health::Bad => "BAD     ",
        };
        let told = |text: &str| in_language(&printable(text), lang).into_owned();
        let mend = if self.mend.is_empty() {
            String::new()
        } else {
            format!("{}{}", in_language("; mend: ", lang), told(&self.mend))
        };
        format!("{} {}{mend}", in_language(word, lang), told(&self.what))
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.line(Lang::En))
    }
}

/// Checks the bench and prints the findings. `named` is the bench file of the command line.
pub(crate) fn run(named: Option<&Path>, records: Option<&Path>) -> ExitCode {
    let findings = look(named, records, &Sys::default(), &Proc::default());
    let mut out = Lines::to_stdout();
    for finding in &findings {
        // A reader that has seen enough is no error.
        let _ = out.say_as_it_is(finding.line(out.wording.lang()));
    }
    match findings.iter().map(|finding| finding.health).max() {
        Some(Health::Bad) => ExitCode::from(ILL),
        _ => ExitCode::SUCCESS,
    }
}

pub(crate) fn look(named: Option<&Path>, records: Option<&Path>, sys: &Sys, proc: &Proc) -> Vec<Finding> {
    let mut findings = Vec::new();
    let path = named.map_or_else(|| PathBuf::from(BENCH_FILE), Path::to_owned);
    let bench = bench_file(&path, named.is_some(), &mut findings);
    if let Found::Read(bench) = &bench {
        socket(bench, &mut findings);
        let folder = path.parent().unwrap_or_else(|| Path::new(""));
        findings.extend(plans(bench, folder));
        findings.extend(key::look(bench, folder));
        findings.extend(key::trusted(bench, folder));
        findings.extend(hook(bench, folder));
        findings.extend(lines::look(bench, sys, proc));
        findings.extend(bench.scanner.iter().flat_map(|scanner| scanner::look(scanner, proc)));
    }
    // Before the lines below open files of their own: a run is refused by the same limit.
    findings.extend(crate::threads::can_run().err().map(|refusal| Finding::bad(refusal.what, refusal.try_this)));
    let records = match (records, &bench) {
        (Some(named), _) => Some(named.to_owned()),
        (None, Found::Read(bench)) => {
            let named = bench.records.as_ref();
            let in_file = named.map(|records| path.parent().unwrap_or_else(|| Path::new("")).join(records));
            Some(in_file.unwrap_or_else(|| RECORDS.into()))
        }
        (None, Found::Nothing) => Some(RECORDS.into()),
        (None, Found::Unreadable) => None,
    };
    match &records {
        Some(records) => {
            findings.extend(place::records(records));
            findings.extend(place::disk(records));
        }
        None => findings.push(Finding::warning(
            "where records go was not checked since the bench file decides that and could not be read",
            "correct the bench file; then run doctor again",
        )),
    }
    findings.push(place::clock(records.as_deref()));
    findings.push(place::terminal());
    findings.extend(crate::umask::doubt().map(|(what, mend)| Finding::warning(what, mend)));
    findings
}

/// What became of the bench file.
enum Found {
    Read(Box<BenchFile>),
    /// None is named, and none is in this folder: runs use the defaults.
    Nothing,
    /// It has mistakes or cannot be read, so what it says is not known.
    Unreadable,
}

fn bench_file(path: &Path, named: bool, findings: &mut Vec<Finding>) -> Found {
    if !named && !files::is_there(path) {
        let what = format!(
            "there is no bench file {}, so only simulated modules (--sim) can be tested",
            gnc_text::shown_path(path)
        );
        findings.push(Finding::warning(what, "name one with --bench FILE, or write one as docs/bench.md shows"));
        return Found::Nothing;
    }
    match files::bench(path) {
        Ok(bench) => {
            findings.push(Finding::good(format!(
                "bench file {} of station {}",
                gnc_text::shown_path(path),
                bench.station_id
            )));
            Found::Read(Box::new(bench))
        }
        Err(refusal) => {
            findings.extend(mistakes(&refusal));
            Found::Unreadable
        }
    }
}

/// Whether the bench pins its plans, and whether it runs the one with which its screen opens.
fn plans(bench: &BenchFile, folder: &Path) -> Vec<Finding> {
    let usual = bench.plan.as_ref().map(|plan| files::plan(&folder.join(plan), gnc_files::Reach::Folder));
    match usual.map(|plan| plan.map(|plan| bench.plans.check(plan.plan(), plan.sha256()))) {
        // The screen opens with this refusal, and without a plan.
        Some(Err(refusal)) => mistakes(&refusal),
        Some(Ok(Err(error))) => vec![Finding::bad(error.to_string(), error.try_this())],
        _ if bench.plans.is_empty() => {
            vec![Finding::good("the bench file pins no plan, so this bench runs any plan")]
        }
        _ => vec![Finding::good(format!("the bench file pins its plans: {}", bench.plans.len()))],
    }
}

/// Whether the program can be started that is told each verdict. Modules can be tested without it.
fn hook(bench: &BenchFile, folder: &Path) -> Option<Finding> {
    let program = HookProgram::new(bench.verdict.hook.as_ref()?, Some(folder))?;
    program.doubt().map(|(what, mend)| Finding::warning(what, mend))
}

/// A finding for each mistake of a file: its place, what is wrong, and what the message advises. The line of the file that the
/// message shows is left out.
fn mistakes(refusal: &CommandRefusal) -> Vec<Finding> {
    let one = |mistake: &str| {
        let advice = mistake.lines().find_map(|line| line.trim_start_matches([' ', '=']).strip_prefix("try: "));
        let given = Some(refusal.try_this.as_str()).filter(|hint| !hint.is_empty());
        let what = mistake.lines().next().unwrap_or_default();
        Finding::bad(what, advice.or(given).unwrap_or("correct the file"))
    };
    refusal.what.split("\n\n").map(one).collect()
}

fn socket(bench: &BenchFile, findings: &mut Vec<Finding>) {
    if bench.socket.is_none() {
        findings.push(Finding::bad("the bench file names no port", "add [socket] with port and rate"));
    }
    if bench.site.as_ref().is_none_or(|site| site.place.is_none()) {
        findings.push(Finding::warning(
            "the bench file has no surveyed place, so positions are not judged",
            "add latitude, longitude and height under [site]",
        ));
    }
}
