//! A run's folder: its name, and files that are either complete or absent.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use chrono::{DateTime, FixedOffset};
pub(super) use gnc_files::PART;
use gnc_files::{Part, Refused};

use super::begun::was_never_begun;
use super::{StationKey, StoreError, UNASSIGNED, digest, lock, name, on};

/// Bound on the runs of one plan with one serial number in one second; more mean a loop out of control.
const MAX_SAME_SECOND: u32 = 10_000;

/// Folders below the records folder on the way to a run: day, module, run.
const LEVELS: usize = 3;

/// The folder of a run.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
    /// Where the folder is since it was moved. Copies share it.
    moved: Arc<OnceLock<PathBuf>>,
    /// Signs the folder when it is closed.
    key: Option<StationKey>,
    /// Shows from the first moment on that the run goes on, long before a slow disk has its journal. Nothing depends on it
    /// but what a list says, so a folder that cannot be locked is as good.
    _held: Option<Arc<File>>,
}

impl RunFolder {
    /// Creates `DATE/SERIAL/TIME-PLAN` below the records folder, with `-2`, `-3` if the name is taken.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn create(
        records: &Path,
        at: DateTime<FixedOffset>,
        serial_number: &str,
        plan: &str,
    ) -> Result<Self, StoreError> {
        let day = records.join(at.format("%Y-%m-%d").to_string()).join(name::of_module(serial_number));
        let name = format!("{}-{}", at.format("%H%M%S"), name::of_part(plan));
        let create = || {
            // A day or a module that is a link would put the run elsewhere.
            for folder in [day.parent().unwrap_or(&day), &day] {
                on(fs::create_dir_all(folder), "create", folder)?;
                is_own(folder)?;
            }
            Self::fresh(&day, &name)
        };
        // The start of another station takes empty folders away, also between these two steps.
        let folder = match create() {
            Err(StoreError::File { source, .. }) if source.kind() == io::ErrorKind::NotFound => create()?,
            created => created?,
        };
        // The names of the new folders must survive a power cut as well.
        let mut dirs = [Some(day.as_path()), day.parent(), Some(records)].into_iter().flatten();
        let synced = dirs.try_for_each(sync_dir);
        if synced.is_err() {
            folder.withdraw();
        }
        synced.map(|()| folder)
    }

    /// Takes away the folder of a run that could not begin, so that no half folder is left; its parents too, if they are
    /// empty then. A folder that has an event stays. Where the disk refuses, readers name what is left.
    pub fn withdraw(&self) {
        let path = self.path();
        if !was_never_begun(path) || fs::remove_dir_all(path).is_err() {
            return;
        }
        // These fail where other runs are.
        let parents = path.ancestors().skip(1).take(2);
        let _ = parents.map(fs::remove_dir).take_while(Result::is_ok).count();
    }

    /// Creates a folder beside a run's, `RUN-WHAT`, with `-2`, `-3` if the name is taken.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn beside(run: &Path, what: &str) -> Result<Self, StoreError> {
        let run = on(fs::canonicalize(run), "read", run)?;
        let day = run.parent().unwrap_or(&run);
        let name = run.file_name().unwrap_or_default().to_string_lossy();
        let folder = Self::fresh(day, &format!("{name}-{what}"))?;
        sync_dir(day)?;
        Ok(folder)
    }

    /// The folder of a run whose program died.
    pub(super) fn existing(path: &Path) -> Self {
        Self::at(path.to_owned(), None)
    }

    fn at(path: PathBuf, held: Option<File>) -> Self {
        Self { path, moved: Arc::default(), key: None, _held: held.map(Arc::new) }
    }

    /// The same folder with a key that signs it when it is closed.
    #[must_use]
    pub fn signed_with(self, key: Option<StationKey>) -> Self {
        Self { key, ..self }
    }

    pub(super) fn key(&self) -> Option<&StationKey> {
        self.key.as_ref()
    }

    fn fresh(parent: &Path, name: &str) -> Result<Self, StoreError> {
        for number in 1..=MAX_SAME_SECOND {
            let path = parent.join(if number == 1 { name.to_owned() } else { format!("{name}-{number}") });
            // A run whose module was another one began under this name and was moved: the chain knows the name as begun.
            let moved = parent.with_file_name(UNASSIGNED).join(path.file_name().unwrap_or_default());
            if moved != path && moved.symlink_metadata().is_ok() {
                continue;
            }
            match DirBuilder::new().create(&path) {
                Ok(()) => {
                    let held = Self::held(&path, lock::LOCKED_FOR)?;
                    if path.is_dir() {
                        return Ok(Self::at(path, held));
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return on(Err(error), "create", &path),
            }
        }
        on(Err(io::ErrorKind::AlreadyExists.into()), "create", &parent.join(name))
    }

    /// Takes the lock of a new folder. The start of another station may be taking the empty folder away at this moment, so it waits
    /// for that. A folder that cannot be locked is as good.
    fn held(path: &Path, wait: Duration) -> Result<Option<File>, StoreError> {
        let Ok(folder) = File::open(path) else { return Ok(None) };
        match lock::within(&folder, wait, File::try_lock) {
            Ok(true) => Ok(Some(folder)),
            Ok(false) => {
                Self::existing(path).withdraw();
                let why = format!(
                    "another program holds this new folder for more than {} s (the start of another station or a program that searches or copies the records)",
                    wait.as_secs()
                );
                lock::busy(why, path)
            }
            Err(_) => Ok(None),
        }
    }

    /// The path of the folder. It changes once if the run turns out to be of another module.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.moved.get().unwrap_or(&self.path)
    }

    /// Moves a run whose module is not the one that was scanned to `DATE/_unassigned/TIME-PLAN`, so that it stands with neither.
    pub(super) fn unassign(&self) -> Result<(), StoreError> {
        let from = self.path();
        let (Some(serial), Some(name)) = (from.parent(), from.file_name()) else { return Ok(()) };
        let Some(day) = serial.parent().filter(|_| serial.file_name() != Some(UNASSIGNED.as_ref())) else {
            return Ok(());
        };
        let unassigned = day.join(UNASSIGNED);
        on(fs::create_dir_all(&unassigned), "create", &unassigned)?;
        // Another run may have the name: an empty folder keeps the place until the run is moved over it.
        // It is held until then, so that the start of another station does not take it for one of a run that never began.
        let place = Self::fresh(&unassigned, &name.to_string_lossy())?;
        on(fs::rename(from, &place.path), "move", from)?;
        let to = place.path;
        // It stays where the scanned module has other runs.
        let _ = fs::remove_dir(serial);
        for dir in [serial, unassigned.as_path(), day].into_iter().filter(|dir| dir.exists()) {
            sync_dir(dir)?;
        }
        let _ = self.moved.set(to);
        Ok(())
    }

    /// Opens a new file to append to.
    pub(super) fn create_file(&self, name: &str) -> Result<File, StoreError> {
        folders_are_own(self.path())?;
        let path = self.path().join(name);
        let file = on(OpenOptions::new().append(true).create_new(true).open(&path), "create", &path)?;
        sync_dir(self.path())?;
        Ok(file)
    }

    /// Opens a new file in its own subfolder to append to.
    pub(super) fn create_below(&self, name: &str) -> Result<File, StoreError> {
        let path = self.path().join(name);
        let parent = self.parent(&path)?;
        let file = on(OpenOptions::new().append(true).create_new(true).open(&path), "create", &path)?;
        sync_dir(parent)?;
        sync_dir(self.path())?;
        Ok(file)
    }

    /// The folder of a file, created if it is an item's folder. The run's own folder is not created again: if it was
    /// removed, a part of the record must not look like the complete record.
    fn parent<'a>(&self, path: &'a Path) -> Result<&'a Path, StoreError> {
        let parent = path.parent().unwrap_or(path);
        folders_are_own(self.path())?;
        if parent == self.path() {
            return Ok(parent);
        }
        match DirBuilder::new().create(parent) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => on(Err(error), "create", parent),
            Err(_) => is_own(parent).map(|()| parent),
            Ok(()) => Ok(parent),
        }
    }

    /// Writes a complete file: it appears under its name only when all of it is written.
    pub(super) fn put(
        &self,
        name: &str,
        write: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), StoreError> {
        self.place(name, write, false)
    }

    /// Writes a complete file and waits until it is on disk.
    pub(super) fn put_synced(
        &self,
        name: &str,
        write: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), StoreError> {
        self.place(name, write, true)?;
        sync_dir(self.path().join(name).parent().unwrap_or(self.path()))
    }

    /// Writes a complete file that gets its name later, and returns the digest of what was written.
    pub(super) fn put_waiting(
        &self,
        name: &str,
        write: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<String, StoreError> {
        let mut digest = String::new();
        let digesting = |out: &mut dyn io::Write| {
            let mut out = digest::Digesting::new(out);
            write(&mut out)?;
            digest = out.digest();
            Ok(())
        };
        let (part, _) = self.written(name, digesting, false)?;
        part.leave();
        Ok(digest)
    }

    /// Waits until all written files are on disk.
    pub(super) fn sync(&self) -> Result<(), StoreError> {
        let dir = on(File::open(self.path()), "read", self.path())?;
        on(nix::unistd::syncfs(dir).map_err(io::Error::from), "write", self.path())
    }

    fn place(
        &self,
        name: &str,
        write: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
        sync: bool,
    ) -> Result<(), StoreError> {
        let (part, _) = self.written(name, write, sync)?;
        on(part.place(), "write", &self.path().join(name))
    }

    /// A complete file that has not its name yet, and where it is.
    fn written(
        &self,
        name: &str,
        write: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
        sync: bool,
    ) -> Result<(Part, PathBuf), StoreError> {
        let path = self.path().join(name);
        self.parent(&path)?;
        let part = on(Part::create(&path), "create", &path)?;
        let name = part.written_to().to_owned();
        let mut file = io::BufWriter::new(part);
        let mut written = write(&mut file).and_then(|()| file.flush());
        if sync {
            written = written.and_then(|()| file.get_ref().sync());
        }
        on(written, "write", &name)?;
        let part = on(file.into_inner().map_err(io::IntoInnerError::into_error), "write", &name)?;
        Ok((part, name))
    }
}

/// Refuses a run whose folder, or that of its module or its day, is a link or has become one: nothing is written or sealed
/// behind it. The records folder itself may be a link.
fn folders_are_own(run: &Path) -> Result<(), StoreError> {
    run.ancestors().take(LEVELS).filter(|folder| !folder.as_os_str().is_empty()).try_for_each(is_own)
}

fn is_own(folder: &Path) -> Result<(), StoreError> {
    match on(folder.symlink_metadata(), "read", folder)?.is_symlink() {
        true => on(Err(Refused::Link.into()), "write", folder),
        false => Ok(()),
    }
}

/// Whether a folder has the name of a run's folder: `TIME-PLAN`.
pub(super) fn is_name_of_run(name: &str) -> bool {
    name.split_once('-').is_some_and(|(time, _)| time.len() == 6 && time.bytes().all(|byte| byte.is_ascii_digit()))
}

pub(super) fn sync_dir(dir: &Path) -> Result<(), StoreError> {
    on(File::open(dir).and_then(|dir| dir.sync_all()), "write", dir)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::as_written;
    use crate::store::reader::{self, Found};

    /// A slow disk takes seconds until the journal has its first event. The run is called running until then.
    #[test]
    fn a_run_that_has_only_begun_is_running() {
        let records = tempfile::tempdir().unwrap();
        let at = DateTime::parse_from_rfc3339("2026-11-28T12:00:00+08:00").unwrap();
        let folder = RunFolder::create(records.path(), at, "SN", "functional").unwrap();
        let look = || {
            let found = reader::list(records.path()).unwrap().remove(0);
            (found.state(), as_written::check(&found.path).running)
        };
        assert_eq!(look(), (Found::Running, true), "no journal yet");
        let journal = folder.create_file(crate::store::JOURNAL).unwrap();
        assert_eq!(look(), (Found::Running, true), "a journal without an event");
        // A look leaves the lock with its holder.
        let held = crate::store::closing::hold(journal, folder.path());
        assert!(held.is_ok());
        drop(folder);
        drop(held);
        assert_eq!(look(), (Found::Unreadable, false), "its station has died");
    }

    /// A paper is exchanged while it is written: its digest is that of what the station wrote, so the exchange is found.
    #[test]
    fn the_digest_of_a_paper_is_that_of_what_was_written() {
        let records = tempfile::tempdir().unwrap();
        let at = DateTime::parse_from_rfc3339("2026-11-28T12:00:00+08:00").unwrap();
        let folder = RunFolder::create(records.path(), at, "SN", "functional").unwrap();
        let waiting = folder.path().join(crate::store::pending::waiting_name("log.txt"));
        let digest = folder.put_waiting("log.txt", |out| {
            out.write_all(b"failed")?;
            fs::remove_file(&waiting)?;
            fs::write(&waiting, "passed")
        });
        assert_eq!(digest.unwrap(), digest::of_bytes(b"failed"));
        assert_eq!(fs::read_to_string(waiting).unwrap(), "passed");
    }

    /// The folder of the run, of its module or of its day is exchanged for a link while the run goes on, or before: nothing is
    /// written or sealed at the other end. The records folder itself may be a link.
    #[test]
    fn nothing_is_written_behind_a_link() {
        use std::os::unix::fs::symlink;
        let at = DateTime::parse_from_rfc3339("2026-11-28T12:00:00+08:00").unwrap();
        let place = tempfile::tempdir().unwrap();
        let [real, records, other] = ["real", "records", "other"].map(|name| place.path().join(name));
        fs::create_dir(&real).unwrap();
        symlink(&real, &records).unwrap();
        let is_link = |result: Result<(), StoreError>| match result {
            Err(StoreError::File { source, .. }) => gnc_files::is_refused(&source) == Some(Refused::Link),
            _ => false,
        };
        for level in 0..LEVELS {
            let folder = RunFolder::create(&records, at, "SN", "functional").unwrap();
            folder.put("log.txt", |out| out.write_all(b"in the run")).unwrap();
            folder.put("01-imu/item.json", |out| out.write_all(b"{}")).unwrap();
            let exchanged = folder.path().ancestors().nth(level).unwrap().to_owned();
            fs::rename(&exchanged, &other).unwrap();
            symlink(&other, &exchanged).unwrap();
            assert!(is_link(folder.put_synced("SHA256SUMS", |out| out.write_all(b"sealed"))), "{level}");
            assert!(is_link(folder.create_file("events.jsonl").map(drop)), "{level}");
            if level > 0 {
                assert!(is_link(RunFolder::create(&records, at, "SN", "functional").map(drop)), "{level}");
            }
            fs::remove_file(&exchanged).unwrap();
            fs::remove_dir_all(&other).unwrap();
        }
        // The folder of an item, and a link where a file is to be.
        let folder = RunFolder::create(&records, at, "SN", "functional").unwrap();
        fs::create_dir(&other).unwrap();
        symlink(&other, folder.path().join("01-imu")).unwrap();
        assert!(is_link(folder.put("01-imu/item.json", |out| out.write_all(b"{}"))));
        assert!(is_link(folder.create_below("01-imu/attempt-1.mcap").map(drop)));
        for name in ["run.json", "run.json.part"] {
            symlink(other.join("victim"), folder.path().join(name)).unwrap();
        }
        folder.put("run.json", |out| out.write_all(b"{}")).unwrap();
        assert_eq!(fs::read_dir(&other).unwrap().count(), 0);
        assert!(!folder.path().join("run.json").is_symlink());
    }

    /// Another program holds the new folder: the wait ends, and no folder is left.
    #[test]
    fn a_new_folder_that_is_held_is_given_up() {
        let records = tempfile::tempdir().unwrap();
        let path = records.path().join("2026-11-28/SN/120000-functional");
        fs::create_dir_all(&path).unwrap();
        let holds = File::open(&path).unwrap();
        holds.lock().unwrap();
        let error = RunFolder::held(&path, Duration::ZERO).unwrap_err();
        let why = "another program holds this new folder for more than 0 s (the start of another station or a program that \
                   searches or copies the records)";
        assert!(gnc_text::with_causes(&error).ends_with(why), "{error}");
        assert!(error.try_this().contains("end the program that holds the records folder"));
        assert!(!records.path().join("2026-11-28").exists());
        fs::create_dir_all(&path).unwrap();
        assert!(RunFolder::held(&path, Duration::ZERO).unwrap().is_some());
    }

    /// A pipe, a device, a folder or a link in the place of a file of a record is refused at once: the test would wait for ever.
    #[test]
    fn what_is_no_file_is_not_read() {
        use crate::store::{DIGESTS, RECORD, captures, cut_off, digest, head};
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let names = [DIGESTS, RECORD, cut_off::CUT_OFF, "a.mcap", crate::store::JOURNAL];
        type Put<'a> = (&'a str, &'a dyn Fn(&Path));
        let put: [Put<'_>; 4] = [
            ("pipe", &|path| nix::unistd::mkfifo(path, nix::sys::stat::Mode::S_IRWXU).unwrap()),
            ("folder", &|path| fs::create_dir(path).unwrap()),
            ("link to a file", &|path| std::os::unix::fs::symlink("/etc/hostname", path).unwrap()),
            ("link to a device", &|path| std::os::unix::fs::symlink("/dev/zero", path).unwrap()),
        ];
        for (what, put) in put {
            names.iter().for_each(|name| put(&at(name)));
            assert!(digest::FileDigests::read(place.path()).is_err(), "{what}");
            assert!(digest::of_file(&at(RECORD)).is_err(), "{what}");
            assert!(captures::read(&at("a.mcap")).is_err(), "{what}");
            assert!(head::RunHead::read(place.path()).is_none(), "{what}");
            assert!(cut_off::complete(&RunFolder::existing(place.path())).is_err(), "{what}");
            assert!(!was_never_begun(place.path()), "{what}");
            for name in names {
                let _ = fs::remove_file(at(name)).or_else(|_| fs::remove_dir(at(name)));
            }
        }
    }

    /// The station died, or its disk was full, before the first event. Nothing was tested, and nothing was changed.
    #[test]
    fn a_run_that_was_never_begun_is_named_and_taken_back() {
        let records = tempfile::tempdir().unwrap();
        let at = DateTime::parse_from_rfc3339("2026-11-28T12:00:00+08:00").unwrap();
        for journal in [None, Some(&b""[..]), Some(&[0; 9]), Some(b"{\"seq\":0,\"at\":\"2026"), Some(b"{\"seq\":0}\n")]
        {
            let folder = RunFolder::create(records.path(), at, "SN", "functional").unwrap();
            folder.put("plan/01-functional.toml", |out| out.write_all(b"name")).unwrap();
            if let Some(journal) = journal {
                folder.create_file(crate::store::JOURNAL).unwrap().write_all(journal).unwrap();
            }
            let path = folder.path().to_owned();
            let is_begun = journal.is_some_and(|journal| journal.ends_with(b"\n"));
            let again = folder.clone();
            drop(folder);
            drop(again);
            let checked = as_written::check(&path);
            assert_eq!(checked.never_begun, !is_begun, "{journal:?}");
            assert_eq!(checked.problems.is_empty(), !is_begun, "{:?}", checked.problems);
            let told = reader::read(&path).unwrap_err().to_string();
            assert_eq!(told.contains("nothing was tested"), !is_begun, "{told}");
            RunFolder::existing(&path).withdraw();
            assert_eq!(path.exists(), is_begun);
            assert_eq!(records.path().join("2026-11-28").exists(), is_begun, "the folders of day and module go too");
        }
    }
}
