//! Writes a run's record, on a separate thread so that a slow disk never delays the link.
//!
//! A simulated run may use one clock for station and bench, which moves when both wait. Then nothing may wait for the
//! disk: the caller that emits an event also writes it, and the disk takes no time on that clock.
//!
//! Watchers of the run receive an event after it is in the journal, never before. After the first error nothing more is
//! written or passed on: the journal then ends where the disk failed.

use std::fs::File;
use std::io::Write as _;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;

use gnc_executive::event::{CapturedSamples, Event, EventKind, RunHeader};
use gnc_executive::plan::Plan;
use gnc_executive::record::ItemFile;
use gnc_executive::state::RunState;
use sha2::{Digest as _, Sha256};
use tokio::sync::{mpsc, oneshot};

use super::chain::{self, Place, Scribe};
use super::closing::pretty;
use super::contents::{Contents, PlanFiles};
use super::raw::RawThread;
use super::{ITEM, JOURNAL, PLAN, RawFile, RunFolder, StoreError, closing, digest, item_folder, name, on, raw_file};
use crate::raw::RawOrigin;

/// Most events on their way to the disk: more than the largest item yields at once.
const ON_THE_WAY: usize = 1024;

/// Receives each written event. `false`: the watcher no longer listens, or is too far behind.
pub type Watcher = Box<dyn FnMut(&Event) -> bool + Send>;

type Written = oneshot::Sender<Result<(), StoreError>>;

/// Where the writing takes place.
#[derive(Debug)]
enum Hand {
    Thread {
        events: mpsc::Sender<(Event, Option<Written>)>,
        thread: JoinHandle<Result<(), StoreError>>,
    },
    /// The caller that emits events writes; `None` after an error.
    Here(Box<Mutex<Option<JournalFile>>>),
}

/// A handle to the record that is being written.
#[derive(Debug)]
pub struct RecordWriter {
    hand: Hand,
    state: Arc<Mutex<RunState>>,
    folder: RunFolder,
    raw: Mutex<Vec<RawThread>>,
    origin: Arc<OnceLock<RawOrigin>>,
}

impl RecordWriter {
    /// Opens the journal in a run's folder, files the plan, and starts to write. Each of the `watchers` receives the
    /// written events.
    ///
    /// # Errors
    /// [`StoreError`]; nothing was tested yet.
    pub fn start(folder: RunFolder, plan: &Plan, watchers: Vec<Watcher>) -> Result<Self, StoreError> {
        let writer = JournalFile::open(&folder, plan, watchers)?;
        let (state, origin) = (Arc::clone(&writer.state), Arc::clone(&writer.origin));
        let (events, receiver) = mpsc::channel(ON_THE_WAY);
        let spawned = std::thread::Builder::new().name("writer".into()).spawn(move || writer.run(receiver));
        let thread = on(spawned, "start a thread for", std::path::Path::new(JOURNAL))?;
        Ok(Self { hand: Hand::Thread { events, thread }, state, folder, raw: Mutex::default(), origin })
    }

    /// As [`RecordWriter::start`], without a thread: an event is on disk when it is emitted. It is for a clock that
    /// goes on while the program waits for a thread.
    ///
    /// # Errors
    /// [`StoreError`]; nothing was tested yet.
    pub fn without_thread(folder: RunFolder, plan: &Plan, watchers: Vec<Watcher>) -> Result<Self, StoreError> {
        let writer = JournalFile::open(&folder, plan, watchers)?;
        let (state, origin) = (Arc::clone(&writer.state), Arc::clone(&writer.origin));
        Ok(Self { hand: Hand::Here(Box::new(Mutex::new(Some(writer)))), state, folder, raw: Mutex::default(), origin })
    }

    /// Opens a file for the raw samples of an attempt of an item.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub async fn raw(&self, item: &str, attempt: u32, repeat: u32) -> Result<RawFile, StoreError> {
        let position = self.state.lock().unwrap_or_else(PoisonError::into_inner).position(item).unwrap_or_default();
        let name = format!("{}/{}", item_folder(position, item), raw_file(attempt, repeat));
        let (opening, thread) = RawFile::create(&self.folder, name, self.origin.get().cloned())?;
        self.threads().push(thread);
        opening.opened().await
    }

    /// Waits until every raw file is complete, also those that are no longer awaited after a stop.
    pub async fn raw_files_ended(&self) {
        let threads = std::mem::take(&mut *self.threads());
        let joined = tokio::task::spawn_blocking(|| {
            for thread in threads {
                // The writer of the file has already reported the error.
                let _ = thread.join();
            }
        });
        let _ = joined.await;
    }

    fn threads(&self) -> std::sync::MutexGuard<'_, Vec<RawThread>> {
        self.raw.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The folder of the run's record.
    #[must_use]
    pub fn folder(&self) -> &std::path::Path {
        self.folder.path()
    }

    /// The fold over the events handed over. The emitting caller shares it: a run may have 20,000 items, and one copy
    /// of their state is enough.
    #[must_use]
    pub fn state(&self) -> Arc<Mutex<RunState>> {
        Arc::clone(&self.state)
    }

    /// A place for one event on its way to the disk.
    ///
    /// # Errors
    /// [`StoreError::Closed`] if an earlier event could not be written.
    pub async fn place(&self) -> Result<EventSlot<'_>, StoreError> {
        match &self.hand {
            Hand::Thread { events, .. } => {
                events.reserve().await.map(|room| EventSlot(Room::OnTheWay(room))).map_err(|_| closed())
            }
            Hand::Here(writer) => Ok(EventSlot(Room::Here(writer))),
        }
    }

    /// Waits until everything is on disk and the folder is closed with its digests.
    ///
    /// # Errors
    /// The first error of the record, if it was not reported yet.
    pub async fn close(self) -> Result<(), StoreError> {
        let Hand::Thread { events, thread } = self.hand else { return Ok(()) };
        drop(events);
        let joined = tokio::task::spawn_blocking(move || thread.join()).await;
        match joined {
            Ok(Ok(result)) => result,
            _ => Err(StoreError::Closed {
                why: "its writing thread stopped unexpectedly, by a fault of this program".into(),
            }),
        }
    }
}

/// Room for one event.
#[derive(Debug)]
pub struct EventSlot<'a>(Room<'a>);

#[derive(Debug)]
enum Room<'a> {
    OnTheWay(mpsc::Permit<'a, (Event, Option<Written>)>),
    Here(&'a Mutex<Option<JournalFile>>),
}

impl<'a> EventSlot<'a> {
    /// Hands the event over at once; `sync` asks for a notice when it is on disk.
    #[must_use]
    pub fn write(self, event: Event, sync: bool) -> OnItsWay<'a> {
        OnItsWay(match self.0 {
            Room::OnTheWay(room) if sync => {
                let (sender, written) = oneshot::channel();
                room.send((event, Some(sender)));
                Way::Awaited(written)
            }
            Room::OnTheWay(room) => {
                room.send((event, None));
                Way::Unawaited
            }
            Room::Here(writer) => Way::Here(writer, Box::new(event), sync),
        })
    }
}

/// An event that was handed over.
#[derive(Debug)]
pub struct OnItsWay<'a>(Way<'a>);

#[derive(Debug)]
enum Way<'a> {
    Unawaited,
    Awaited(oneshot::Receiver<Result<(), StoreError>>),
    /// Not written yet: the emitting caller still holds the fold from which the record is made.
    Here(&'a Mutex<Option<JournalFile>>, Box<Event>, bool),
}

impl OnItsWay<'_> {
    /// Waits until the event is on disk, if that was asked for.
    ///
    /// # Errors
    /// The first error of the record.
    pub async fn synced(self) -> Result<(), StoreError> {
        match self.0 {
            Way::Unawaited => Ok(()),
            Way::Awaited(written) => written.await.map_err(|_| closed())?,
            Way::Here(writer, event, sync) => {
                let mut writer = writer.lock().unwrap_or_else(PoisonError::into_inner);
                let written = writer.as_mut().ok_or_else(closed)?.write_and_tell(*event, sync);
                if written.is_err() {
                    *writer = None;
                }
                written
            }
        }
    }
}

fn closed() -> StoreError {
    StoreError::Closed { why: "an earlier event could not be written".into() }
}

/// The open record.
struct JournalFile {
    folder: RunFolder,
    /// The lock that is held while the run goes on.
    journal: File,
    /// At least up to the event being written. What an event closes does not change after it.
    state: Arc<Mutex<RunState>>,
    watchers: Vec<Watcher>,
    line: Vec<u8>,
    /// Digest of all lines so far.
    written: Sha256,
    /// Where the chain says that the run began.
    began: Option<Place>,
    /// The plan as it runs.
    plan: PlanFiles,
    /// What the raw files say of which run they are.
    origin: Arc<OnceLock<RawOrigin>>,
}

impl std::fmt::Debug for JournalFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer").field("folder", &self.folder).finish_non_exhaustive()
    }
}

impl JournalFile {
    fn open(folder: &RunFolder, plan: &Plan, watchers: Vec<Watcher>) -> Result<Self, StoreError> {
        let mut files = Vec::new();
        for (index, (name, text)) in plan.files().enumerate() {
            let name = std::path::Path::new(name).file_name().unwrap_or_default().to_string_lossy();
            let name = format!("{PLAN}/{:02}-{}", index + 1, name::of_part(&name));
            folder.put(&name, |out| out.write_all(text))?;
            files.push((name, text.to_vec()));
        }
        let journal = closing::hold(folder.create_file(JOURNAL)?, &folder.path().join(JOURNAL))?;
        let state = Arc::new(Mutex::new(RunState::new()));
        Ok(Self {
            folder: folder.clone(),
            journal,
            state,
            watchers,
            line: Vec::new(),
            written: Sha256::new(),
            began: None,
            plan: PlanFiles::Written(files),
            origin: Arc::default(),
        })
    }

    fn run(mut self, mut events: mpsc::Receiver<(Event, Option<Written>)>) -> Result<(), StoreError> {
        while let Some((event, written)) = events.blocking_recv() {
            let result = self.write_and_tell(event, written.is_some());
            let failed = result.is_err();
            match written {
                Some(written) => {
                    let _ = written.send(result);
                }
                None => result?,
            }
            if failed {
                return Ok(());
            }
        }
        Ok(())
    }

    fn write_and_tell(&mut self, mut event: Event, sync: bool) -> Result<(), StoreError> {
        if let EventKind::Captured(captured) = &mut event.kind {
            self.vouch_for(captured);
        }
        self.write(&event, sync)?;
        // A watcher that no longer listens or is too far behind does not stop the run.
        self.watchers.retain_mut(|watcher| watcher(&event));
        Ok(())
    }

    /// Ties what a raw file holds to all that the journal says before it, and signs that where the station has a key.
    fn vouch_for(&self, captured: &mut CapturedSamples) {
        captured.journal_sha256 = digest::hexadecimal(&self.written.clone().finalize());
        let key = self.folder.key();
        captured.signature = key.map(|key| digest::hexadecimal(&key.sign(captured.signed_text().as_bytes())));
    }

    fn write(&mut self, event: &Event, sync: bool) -> Result<(), StoreError> {
        self.line.clear();
        serde_json::to_writer(&mut self.line, event)?;
        self.line.push(b'\n');
        let path = self.folder.path().join(JOURNAL);
        on(self.journal.write_all(&self.line), "write", &path)?;
        self.written.update(&self.line);
        match &event.kind {
            EventKind::RunStarted { header, .. } => self.begin(header, event)?,
            EventKind::ItemEnded { item, .. } => {
                // The file of an item whose line a power cut took would be one that no station wrote.
                on(self.journal.sync_data(), "write", &path)?;
                return self.file_item(item);
            }
            EventKind::RunEnded(_) => {
                // Before the run is closed: behind that no error may make a closed run an errored one.
                on(self.journal.sync_data(), "write", &path)?;
                return self.close_folder(event);
            }
            _ => {}
        }
        if sync {
            on(self.journal.sync_data(), "write", &path)?;
        }
        Ok(())
    }

    /// Files an item in its folder, with all of its attempts: measurements and what the slave recorded.
    fn file_item(&self, item: &str) -> Result<(), StoreError> {
        let (name, file) = {
            let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(position) = state.position(item) else { return Ok(()) };
            let Some(file) = ItemFile::from_state(&state, position) else { return Ok(()) };
            (format!("{}/{ITEM}", item_folder(position, item)), file)
        };
        self.folder.put(&name, |out| pretty(out, &file))
    }

    /// Writes into the chain that the run begins. The wait for the first event includes this line. Without it the run does
    /// not begin, and its folder goes.
    fn begin(&mut self, header: &RunHeader, event: &Event) -> Result<(), StoreError> {
        let station = header.station.as_str();
        let _ = self.origin.set(RawOrigin {
            serial_number: header.serial_number.clone(),
            plan: header.plan.name.clone(),
            station: header.station.clone(),
            started: event.at.to_rfc3339(),
            journal_sha256: digest::of_bytes(&self.line),
        });
        let path = self.folder.path().join(JOURNAL);
        on(self.journal.sync_data(), "write", &path)?;
        let by = Scribe { station, at: event.at, key: self.folder.key(), late: None };
        match chain::begin(self.folder.path(), &by) {
            Ok(place) => self.began = Some(place),
            Err(error) => {
                // What the chain does not have has not begun. If it may have it, or the disk refuses this too, the next start
                // seals the run.
                if !matches!(error, StoreError::MayStand(_)) && self.journal.set_len(0).is_ok() {
                    self.folder.withdraw();
                }
                return Err(error);
            }
        }
        Ok(())
    }

    fn close_folder(&self, event: &Event) -> Result<(), StoreError> {
        let header = self.state.lock().unwrap_or_else(PoisonError::into_inner).header().cloned();
        let station = header.as_ref().map_or("", |header| header.station.as_str());
        let by = Scribe { station, at: event.at, key: self.folder.key(), late: None };
        let contents = Contents { state: &self.state, plan: &self.plan, cut_off: &[], made: &[] };
        closing::close(&self.folder, &contents, &by, self.began.as_ref())
    }
}
