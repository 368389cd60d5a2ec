//! Where the records of a command lie: as for runs, in the folder that the bench file names.

use std::path::{Path, PathBuf};

use clap::Args;
use gnc_records::store::{KeyError, PublicKey, StationKey};

use crate::files;
use crate::refusal::CommandRefusal;
use crate::setup::{BENCH_FILE, RECORDS, key, records_of};

/// The options of commands that read records.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct RecordsArgs {
    /// The records folder; by default the one that the bench file names, else `records`.
    #[arg(long, value_name = "DIR", global = true)]
    records: Option<PathBuf>,
    /// The bench file; by default `bench.toml`, if it exists.
    #[arg(long, value_name = "FILE", global = true)]
    bench: Option<PathBuf>,
}

/// A records folder, and why it is this one.
#[derive(Debug, Clone)]
pub(crate) struct RecordsPlace {
    pub(crate) path: PathBuf,
    pub(super) why: String,
}

impl RecordsPlace {
    /// The folder with the reason for it, for a message.
    pub(crate) fn in_words(&self) -> String {
        format!("{}, {}", gnc_text::printable(&self.path.to_string_lossy()), self.why)
    }
}

impl RecordsArgs {
    /// Finds the folder. The bench file is not read if the command line names the folder.
    ///
    /// # Errors
    /// The bench file cannot be read or has mistakes, or there is no such folder.
    pub(crate) fn find(&self) -> Result<RecordsPlace, CommandRefusal> {
        let place = self.place()?;
        if place.path.is_dir() {
            return Ok(place);
        }
        let what = if place.path.exists() { "this is no records folder" } else { "there is no records folder" };
        let try_this = "name the folder with --records DIR, or the bench file that names it with --bench FILE";
        Err(CommandRefusal::new(format!("{what}: {}", place.in_words()), try_this))
    }

    /// The key that signs: the one that is named, else that of the bench file; `None` if there is none.
    ///
    /// # Errors
    /// The bench file cannot be read or has mistakes, or the key cannot be used.
    pub(crate) fn key(&self, named: Option<&Path>) -> Result<Option<StationKey>, CommandRefusal> {
        if let Some(path) = named {
            let refused = |error: KeyError| CommandRefusal::new(gnc_text::with_causes(&error), error.try_this());
            return StationKey::read(path).map(Some).map_err(refused);
        }
        let here = Path::new(BENCH_FILE);
        let Some(bench) = self.bench.as_deref().or_else(|| files::is_there(here).then_some(here)) else {
            return Ok(None);
        };
        key(&files::bench(bench)?, bench.parent())
    }

    /// The public half of the key that the bench file names, if it is there: what could check signatures.
    pub(super) fn public_key(&self) -> Option<PathBuf> {
        let bench = self.bench.clone().unwrap_or_else(|| BENCH_FILE.into());
        let key = files::bench(&bench).ok()?.key?;
        let mut public = bench.parent().unwrap_or_else(|| Path::new("")).join(key).into_os_string();
        public.push(".pub");
        Some(PathBuf::from(public)).filter(|public| PublicKey::read(public).is_ok())
    }

    fn place(&self) -> Result<RecordsPlace, CommandRefusal> {
        if let Some(records) = &self.records {
            return Ok(RecordsPlace { path: records.clone(), why: "which --records names".to_owned() });
        }
        let here = Path::new(BENCH_FILE);
        let Some(bench) = self.bench.as_deref().or_else(|| files::is_there(here).then_some(here)) else {
            let why = format!("since neither --records nor --bench is given and this folder has no {BENCH_FILE}");
            return Ok(RecordsPlace { path: RECORDS.into(), why });
        };
        let file = files::bench(bench)?;
        let shown = gnc_text::shown_path(bench);
        Ok(match records_of(&file, bench.parent()) {
            Some(path) => RecordsPlace { path, why: format!("which {shown} names") },
            None => RecordsPlace { path: RECORDS.into(), why: format!("since {shown} names no other") },
        })
    }
}
