//! The folder of an export: complete under its name, or not there.

use std::fs::{self, DirBuilder, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

use crate::exit_code::ABORTED;

/// Where the system says which signals the program that started this one has switched off, as bits.
const STATUS: &str = "/proc/self/status";
/// The system's text has 2 kB.
const MAX_STATUS_BYTES: u64 = 65_536;
const SWITCHED_OFF: &str = "SigIgn:";

/// A folder that is being filled under its name with `.part`. It is removed if it is dropped before it has its name.
#[derive(Debug)]
pub(super) struct Tables {
    part: PathBuf,
    path: PathBuf,
    /// Folders above it that were made for it, the outermost first.
    above: Vec<PathBuf>,
    is_placed: bool,
}

impl Tables {
    /// Makes the folder.
    ///
    /// # Errors
    /// The error of the system; a folder of an export that was killed is in the way.
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        let part = Self::part_of(path);
        let mut tables = Self { part, path: path.to_owned(), above: Vec::new(), is_placed: false };
        let absent = path.ancestors().skip(1).take_while(|above| !above.as_os_str().is_empty() && !above.exists());
        for above in absent.map(Path::to_owned).collect::<Vec<_>>().into_iter().rev() {
            if let Err(error) = DirBuilder::new().create(&above) {
                tables.give_back();
                return Err(error);
            }
            tables.above.push(above);
        }
        if let Err(error) = DirBuilder::new().create(&tables.part) {
            tables.give_back();
            return Err(error);
        }
        Ok(tables)
    }

    /// The name while it is being filled.
    pub(super) fn part_of(path: &Path) -> PathBuf {
        let mut name = path.components().as_path().as_os_str().to_owned();
        name.push(".");
        name.push(gnc_files::PART);
        name.into()
    }

    /// Makes a file in it.
    ///
    /// # Errors
    /// The error of the system.
    pub(super) fn file(&self, name: &str, stop: &Stop) -> io::Result<Table> {
        Ok(Table { file: gnc_files::create_new(&self.part.join(name))?, stop: stop.clone() })
    }

    /// Where a file will be.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    /// The error of the system.
    pub(super) fn place(mut self) -> io::Result<()> {
        fs::rename(&self.part, &self.path)?;
        self.is_placed = true;
        Ok(())
    }

    /// Removes the folders that were made above. One that others use meanwhile is not empty and stays.
    fn give_back(&mut self) {
        self.is_placed = true;
        for above in self.above.iter().rev() {
            let _ = fs::remove_dir(above);
        }
    }
}

impl Drop for Tables {
    fn drop(&mut self) {
        if !self.is_placed {
            // The reported error is that of the export.
            let _ = fs::remove_dir_all(&self.part);
            self.give_back();
        }
    }
}

/// A file of the export. A signal ends its writing.
#[derive(Debug)]
pub(super) struct Table {
    file: File,
    stop: Stop,
}

impl Table {
    /// Waits until it is on disk: a full disk may say so only then.
    ///
    /// # Errors
    /// The error of the system.
    pub(super) fn sync(&self) -> io::Result<()> {
        self.file.sync_all()
    }
}

impl Write for Table {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stop.check()?;
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Whether a person or the system asks for the end.
#[derive(Debug, Clone)]
pub(super) struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Watches for signals from now on. The first one asks for an end in order, the second one ends the program.
    pub(super) fn watch() -> Self {
        let asked = Arc::<AtomicBool>::default();
        for signal in [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| !is_switched_off(*signal)) {
            // Without them a signal ends the program as it always does.
            let _ = flag::register_conditional_shutdown(signal, i32::from(ABORTED), Arc::clone(&asked));
            let _ = flag::register(signal, Arc::clone(&asked));
        }
        Self(asked)
    }

    /// Whether the end was asked for.
    pub(super) fn is_asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// # Errors
    /// The end was asked for.
    pub(super) fn check(&self) -> io::Result<()> {
        if self.is_asked() { Err(io::Error::other("interrupted")) } else { Ok(()) }
    }
}

/// Whether the program was started without this signal, as `nohup` does.
fn is_switched_off(signal: i32) -> bool {
    let status = gnc_files::text(Path::new(STATUS), MAX_STATUS_BYTES).unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix(SWITCHED_OFF));
    let mask = mask.and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok()).unwrap_or_default();
    mask & (1 << (signal - 1)) != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_export_is_there_as_a_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let stop = Stop(Arc::default());
        let path = folder.path().join("new/deep/out");
        let tables = Tables::create(&path).unwrap();
        tables.file("a.csv", &stop).unwrap().write_all(b"half").unwrap();
        assert!(!path.exists() && Tables::part_of(&path).exists());
        assert!(Tables::create(&path).is_err(), "another one goes on there");
        drop(tables);
        assert_eq!(names(folder.path()), [""; 0], "the folders above go with it");

        fs::create_dir(folder.path().join("new")).unwrap();
        let tables = Tables::create(&path).unwrap();
        tables.file("a.csv", &stop).unwrap().write_all(b"whole").unwrap();
        tables.place().unwrap();
        assert_eq!(fs::read(path.join("a.csv")).unwrap(), b"whole");
        assert_eq!(names(&folder.path().join("new/deep")), ["out"]);

        // The name is taken meanwhile.
        let tables = Tables::create(&folder.path().join("late")).unwrap();
        fs::write(folder.path().join("late"), "of another").unwrap();
        assert!(tables.place().is_err());
        assert_eq!(names(folder.path()), ["late", "new"]);
    }

    #[test]
    fn a_file_takes_nothing_after_a_signal() {
        let folder = tempfile::tempdir().unwrap();
        let asked = Arc::<AtomicBool>::default();
        let stop = Stop(Arc::clone(&asked));
        let tables = Tables::create(&folder.path().join("out")).unwrap();
        let mut table = tables.file("a.csv", &stop).unwrap();
        table.write_all(b"1").unwrap();
        asked.store(true, Ordering::SeqCst);
        assert!(table.write_all(b"2").is_err() && stop.is_asked());
    }
}
