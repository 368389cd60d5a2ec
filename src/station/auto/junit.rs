//! The file of `--junit`: what a CI server reads about the runs.
//!
//! The file is there before the module gets power, and says then that the run has no end. So neither a killed station
//! nor a refused run leaves the file of an earlier run that passed.

use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use gnc_bench::clock;
use gnc_bench::runner::Ending;
use gnc_files::Part;
use gnc_records::junit::JunitReport;
use gnc_records::store::reader;
use gnc_text::with_causes;

use crate::outputs::may_write;
use crate::refusal::CommandRefusal;

/// The file of a command, with the runs up to now.
#[derive(Debug)]
pub(crate) struct JunitFile {
    path: PathBuf,
    report: JunitReport,
    /// When the command began, as the form has it: without an offset.
    began: String,
    /// Whether a run was added.
    any: bool,
}

impl JunitFile {
    /// Writes the file that says that no run has ended.
    ///
    /// # Errors
    /// The file cannot be written, or something else has its name.
    pub(super) fn begin(path: &Path) -> Result<Self, CommandRefusal> {
        if path.exists() && !path.is_file() {
            let what = format!("{} is not a file, so no JUnit XML can take its place", gnc_text::shown_path(path));
            return Err(CommandRefusal::new(what, "name a file with --junit"));
        }
        may_write(path, "--junit")?;
        // The file of a link is replaced, and not the link.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let began = clock::now().format("%Y-%m-%dT%H:%M:%S").to_string();
        let file = Self { path, report: JunitReport::default(), began, any: false };
        let mut first = JunitReport::default();
        let hint = "look at what the station said: it still runs, or it was killed";
        let written = first.add_error(&file.began, "the run has not ended", hint);
        file.written(written.map_err(io::Error::other).and_then(|()| file.put(&first)))?;
        Ok(file)
    }

    /// Writes a file that says why nothing was run at all.
    ///
    /// # Errors
    /// The file cannot be written, or something else has its name.
    pub(crate) fn refuse(path: &Path, what: &str) -> Result<(), CommandRefusal> {
        let mut file = Self::begin(path)?;
        file.refused(what, "");
        file.end()
    }

    /// Adds a run that has ended, as its record says.
    pub(super) fn add(&mut self, folder: &Path, ending: &Ending) {
        let unrecorded = ending.store_error.as_ref().map(|error| with_causes(error));
        let place = gnc_text::shown_path(folder);
        let added = match reader::read(folder) {
            Ok(record) => self.report.add_run(&record, &place, unrecorded.as_deref()),
            Err(error) => {
                let what = format!("the record {place} cannot be read: {}", with_causes(&error));
                self.report.add_error(&self.began, &what, error.try_this())
            }
        };
        // Only a mistake of this program can fail here; a run that is missing in the report is none that passed.
        self.any = added.is_ok();
    }

    /// Adds why a run was not begun.
    pub(super) fn refused(&mut self, what: &str, try_this: &str) {
        self.any |= self.report.add_error(&self.began, what, try_this).is_ok();
    }

    /// Writes the file with all runs.
    ///
    /// # Errors
    /// The file cannot be written; the one that says that no run has ended may still be there.
    pub(super) fn end(&self) -> Result<(), CommandRefusal> {
        if !self.any {
            return Ok(());
        }
        self.written(self.put(&self.report))
    }

    /// The file appears under its name only when all of it is on disk.
    fn put(&self, report: &JunitReport) -> io::Result<()> {
        let text = report.xml().map_err(io::Error::other)?;
        let mut part = Part::create(&self.path)?;
        part.write_all(&text)?;
        part.sync()?;
        part.place()
    }

    fn written(&self, written: io::Result<()>) -> Result<(), CommandRefusal> {
        written.map_err(|error| {
            let try_this = match error.kind() {
                io::ErrorKind::NotFound => "make the folder, or name another file with --junit",
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                    "make room on the disk, or name a file on another one with --junit"
                }
                _ => "name a file that you may write with --junit",
            };
            CommandRefusal::new(
                format!("the JUnit XML cannot be written to {}: {error}", gnc_text::shown_path(&self.path)),
                try_this,
            )
        })
    }
}
