//! The thread that writes the raw samples of an attempt, beside the thread that writes the journal. A slow disk delays
//! the capture but does not drop samples. The bytes are digested while they are written.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::Duration;

use mcap::McapError;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{MissedTickBehavior, interval};

use super::tally::{Held, Tallied};
use super::{RunFolder, StoreError, on};
use crate::raw::{Piece, RawOrigin, RawWriter};

/// Most pieces on their way to the disk: six seconds of 1 kHz in frames of 12 samples. That is far longer than a disk
/// takes to wake up.
const ON_THE_WAY: usize = 512;
/// Samples older than this are in the file, whatever happens to this program.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Bytes that are given to the system at once.
const BUFFER: usize = 1 << 18;

/// A raw file that is being written. Dropping it ends the file at this place.
#[derive(Debug)]
pub struct RawFile {
    /// The file, relative to the folder of the run.
    name: String,
    work: mpsc::Sender<Work>,
    ended: oneshot::Receiver<Result<Held, StoreError>>,
}

/// What a raw file holds, on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawPart {
    /// The file, relative to the folder of the run.
    pub file: String,
    /// Number of its bytes.
    pub bytes: u64,
    /// Their SHA-256, as hexadecimal digits.
    pub sha256: String,
}

/// What the thread of a raw file is asked for.
#[derive(Debug)]
enum Work {
    Piece(Piece),
    /// All pieces before this are to be on disk.
    Settle(oneshot::Sender<Held>),
}

/// The thread of a raw file; the file is complete when the thread has ended.
pub(super) type RawThread = JoinHandle<()>;

/// A raw file that is being created. The disk may take seconds for this; meanwhile the board's watchdog must be served.
pub(super) struct Opening {
    file: RawFile,
    there: oneshot::Receiver<()>,
}

impl Opening {
    /// Waits until the file exists.
    ///
    /// # Errors
    /// The cause why it cannot be created.
    pub(super) async fn opened(self) -> Result<RawFile, StoreError> {
        match self.there.await {
            Ok(()) => Ok(self.file),
            Err(_) => Err(self.file.ended.await.map_or_else(|_| closed(), |ended| ended.err().unwrap_or_else(closed))),
        }
    }
}

impl RawFile {
    /// Starts the thread that creates the file below a run's folder and writes it.
    pub(super) fn create(
        folder: &RunFolder,
        name: String,
        origin: Option<RawOrigin>,
    ) -> Result<(Opening, RawThread), StoreError> {
        let path = folder.path().join(&name);
        let (work, receiver) = mpsc::channel(ON_THE_WAY);
        let (done, ended) = oneshot::channel();
        let (created, there) = oneshot::channel();
        let (folder, named, file_name) = (folder.clone(), path.clone(), name.clone());
        let spawned = std::thread::Builder::new().name("raw samples".into()).spawn(move || {
            let written = folder.create_below(&name).and_then(|file| {
                // After a stop the receiver may be gone.
                let _ = created.send(());
                write(file, &named, origin.as_ref(), receiver)
            });
            // The receiver reports the error; after a stop there is no receiver.
            let _ = done.send(written);
        });
        let thread = on(spawned, "start a thread for", &path)?;
        Ok((Opening { file: Self { name: file_name, work, ended }, there }, thread))
    }

    /// Hands a piece over; waits if the disk is too slow.
    ///
    /// # Errors
    /// The cause why the file cannot be written.
    pub async fn write(&mut self, piece: Piece) -> Result<(), StoreError> {
        self.ask(Work::Piece(piece)).await
    }

    /// Waits until all pieces so far are on disk, and says what the file holds then.
    ///
    /// # Errors
    /// The cause why the file cannot be written.
    pub async fn settled(&mut self) -> Result<RawPart, StoreError> {
        let (sender, settled) = oneshot::channel();
        self.ask(Work::Settle(sender)).await?;
        match settled.await {
            Ok(held) => Ok(part(self.name.clone(), held)),
            Err(_) => Err(self.failed().await),
        }
    }

    /// Ends the file, waits until it is on disk, and says what it holds.
    ///
    /// # Errors
    /// The cause why the file is not on disk.
    pub async fn finish(self) -> Result<RawPart, StoreError> {
        let Self { name, work, ended } = self;
        drop(work);
        ended.await.map_err(|_| closed())?.map(|held| part(name, held))
    }

    async fn ask(&mut self, work: Work) -> Result<(), StoreError> {
        match self.work.send(work).await {
            Ok(()) => Ok(()),
            Err(_) => Err(self.failed().await),
        }
    }

    /// Why the thread has ended.
    async fn failed(&mut self) -> StoreError {
        // Its cause can be had once.
        if self.ended.is_terminated() {
            return closed();
        }
        match (&mut self.ended).await {
            Ok(Err(error)) => error,
            Ok(Ok(_)) | Err(_) => closed(),
        }
    }
}

fn part(file: String, Held { bytes, sha256 }: Held) -> RawPart {
    RawPart { file, bytes, sha256 }
}

fn closed() -> StoreError {
    StoreError::Closed { why: "the raw samples could not be written".into() }
}

fn write(file: File, path: &Path, origin: Option<&RawOrigin>, work: mpsc::Receiver<Work>) -> Result<Held, StoreError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build();
    let runtime = on(runtime, "start a clock for", path)?;
    let file = Tallied::new(file);
    let out = BufWriter::with_capacity(BUFFER, file.clone());
    let written = runtime.block_on(all(out, &file, origin, work)).map_err(|error| file_error(error, path))?;
    on(written.into_inner().map_err(io::IntoInnerError::into_error).and_then(|file| file.held()), "write", path)
}

async fn all(
    out: BufWriter<Tallied>,
    file: &Tallied,
    origin: Option<&RawOrigin>,
    mut work: mpsc::Receiver<Work>,
) -> Result<BufWriter<Tallied>, McapError> {
    let mut out = RawWriter::new(out, origin)?;
    // A head alone is a valid file already.
    out.flush()?;
    let mut flush_due = interval(FLUSH_EVERY);
    flush_due.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            biased;
            _ = flush_due.tick() => out.flush()?,
            asked = work.recv() => match asked {
                Some(Work::Piece(piece)) => out.write(piece)?,
                Some(Work::Settle(settled)) => {
                    out.flush()?;
                    // After a stop the receiver may be gone.
                    let _ = settled.send(file.held()?);
                }
                None => return out.finish(),
            },
        }
    }
}

fn file_error(error: McapError, path: &Path) -> StoreError {
    let source = match error {
        McapError::Io(source) => source,
        other => io::Error::other(other),
    };
    StoreError::File { what: "write", path: PathBuf::from(path), source }
}
