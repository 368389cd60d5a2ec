//! The terminal: it is taken, read, and given back in every case.

use std::fs::File;
use std::io::{self, BufWriter, Read as _, Write as _};
use std::os::fd::AsFd as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::{mpsc, watch};

use super::decode::Dialect;
use super::input::{Input, InputReader};

/// Switches to the other screen, hides the cursor, and asks for marks around pasted text.
const TAKE: &[u8] = b"\x1b[?1049h\x1b[?25l\x1b[?2004h";
/// Undoes all of this, and sets plain colours.
const GIVE_BACK: &[u8] = b"\x1b[?2004l\x1b[0m\x1b[?25h\x1b[?1049l";
/// Size of the buffer for one frame, which is written at once: a whole 200 x 60 screen with its colours.
const FRAME_BYTES: usize = 64 << 10;
/// Bytes read at once.
const READ_BYTES: usize = 1024;

/// The name of the thread that decodes pictures.
pub(crate) const PICTURE_THREAD: &str = "picture";

/// Has the terminal ring, or flash if its owner set it so.
pub(crate) fn ring() {
    let out = io::stdout();
    // Ignore the error: the next drawing meets the same one.
    let _ = out.lock().write_all(b"\x07").and_then(|()| out.lock().flush());
}

/// The screen's terminal.
pub(crate) type Screen = Terminal<CrosstermBackend<BufWriter<File>>>;

/// The screen's hold on the terminal. Clones share it.
#[derive(Debug, Clone)]
pub(crate) struct Guard {
    taken: Arc<AtomicBool>,
}

impl Guard {
    /// Makes a guard that has taken nothing yet. A panic on any thread gives the terminal back, so that its message can
    /// be read. The thread of pictures is another case: a decoder that fails badly must not end a run.
    pub(crate) fn new() -> Self {
        let guard = Self { taken: Arc::new(AtomicBool::new(false)) };
        let (in_panic, before) = (guard.clone(), std::panic::take_hook());
        std::panic::set_hook(Box::new(move |info| {
            if std::thread::current().name() == Some(PICTURE_THREAD) {
                return;
            }
            in_panic.give_back();
            before(info);
        }));
        guard
    }

    /// Takes the terminal.
    pub(crate) fn take(&self) -> io::Result<Screen> {
        let mut out = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        enable_raw_mode()?;
        self.taken.store(true, Ordering::SeqCst);
        out.write_all(TAKE)?;
        Terminal::new(CrosstermBackend::new(BufWriter::with_capacity(FRAME_BYTES, out)))
    }

    /// Whether the screen still holds the terminal.
    pub(crate) fn is_taken(&self) -> bool {
        self.taken.load(Ordering::SeqCst)
    }

    /// Gives the terminal back, once. The line discipline comes first, since that never blocks; a stopped terminal
    /// takes no text.
    pub(crate) fn give_back(&self) {
        if self.give_back_modes()
            && let Ok(out) = io::stdout().as_fd().try_clone_to_owned()
        {
            // Ignore the error: the terminal is gone.
            let _ = File::from(out).write_all(GIVE_BACK);
        }
    }

    /// Gives back the line discipline alone; `false` if that was done before.
    pub(crate) fn give_back_modes(&self) -> bool {
        let taken = self.taken.swap(false, Ordering::SeqCst);
        if taken {
            let _ = disable_raw_mode();
        }
        taken
    }
}

/// Reads keys and scans until the terminal is gone or the receiver is closed. Runs on a thread of its own.
pub(crate) fn read_keys(inputs: &mpsc::Sender<Vec<Input>>) {
    let Ok(stdin) = io::stdin().as_fd().try_clone_to_owned() else { return };
    let mut stdin = File::from(stdin);
    let dialect = Dialect::of_terminal(&std::env::var("TERM").unwrap_or_default());
    let (mut reader, mut bytes, began) = (InputReader::new(dialect), [0; READ_BYTES], Instant::now());
    loop {
        let mut polled = [PollFd::new(stdin.as_fd(), PollFlags::POLLIN)];
        let ready = match poll(&mut polled, until(reader.due_at(), began)) {
            Ok(ready) => ready,
            Err(nix::errno::Errno::EINTR) => continue,
            Err(_) => return,
        };
        let mut batch = Vec::new();
        if ready == 0 {
            reader.pass_time(began.elapsed(), &mut batch);
        } else if polled[0].revents().is_some_and(|events| events.contains(PollFlags::POLLIN)) {
            match stdin.read(&mut bytes) {
                Ok(0) => return,
                Ok(count) => reader.feed(began.elapsed(), &bytes[..count], &mut batch),
                Err(error) if matches!(error.kind(), io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock) => {}
                Err(_) => return,
            }
        } else {
            return;
        }
        if batch.is_empty() {
            continue;
        }
        // A full channel blocks this thread, never the run.
        if inputs.blocking_send(batch).is_err() {
            return;
        }
    }
}

/// The wait until a time since `began`, in whole milliseconds and not too short.
fn until(due_at: Option<Duration>, began: Instant) -> PollTimeout {
    let Some(due_at) = due_at else { return PollTimeout::NONE };
    let millis = due_at.saturating_sub(began.elapsed()).as_micros().div_ceil(1000);
    u16::try_from(millis).map_or(PollTimeout::from(u16::MAX), PollTimeout::from)
}

/// Counts changes of the terminal's size, and continuations of a stopped program, after which the screen must be drawn
/// again.
pub(crate) async fn watch_size(changes: watch::Sender<u64>) {
    let (Ok(mut size), Ok(mut continued)) =
        (signal(SignalKind::window_change()), signal(SignalKind::from_raw(nix::libc::SIGCONT)))
    else {
        return std::future::pending().await;
    };
    loop {
        tokio::select! {
            _ = size.recv() => {}
            _ = continued.recv() => {}
        }
        changes.send_modify(|count| *count += 1);
    }
}

#[cfg(test)]
mod tests;
