//! The threads and files that a run takes: the system is asked for them before anything is switched on. A run that met the
//! limit at its end would lose its record.

use std::io;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};

use crate::refusal::CommandRefusal;

/// Threads for work that waits for the disk. They stay until the end; where the system gives no more, more work waits
/// its turn.
const WAITING: usize = 4;
/// All threads of a run: those, the journal, the raw samples of two items, what is shown, the operator, keys, the picture of a
/// question, the hook and its end, signals, the simulated bench.
const OF_A_RUN: usize = WAITING + 11;
/// Files that a run has open at once: the lines to the board, those of the simulated bench and of signals, the journal, the log,
/// raw samples of two items, folders while the chain is written, the hook with its pipes.
const FILES_OF_A_RUN: usize = 40;
/// Files that a runtime has open: the queue of its events, a way to wake it, and both ends of the line on which signals come.
/// The library would panic without the last ones.
const FILES_OF_A_RUNTIME: usize = 8;
/// A thread that is idle stays: longer than any run.
const STAYS: Duration = Duration::from_secs(365 * 86_400);

/// The runtime of runs, with its threads.
///
/// # Errors
/// The system has too few threads for a run, or refuses the runtime.
pub(crate) fn runtime() -> Result<Runtime, CommandRefusal> {
    let cannot = |error: io::Error| CommandRefusal::new(format_args!("cannot start: {error}"), "");
    can_run()?;
    let runtime = Builder::new_current_thread().enable_all().thread_keep_alive(STAYS).build().map_err(cannot)?;
    // Each of them waits until all are there, else one thread would do the work of all.
    let (held, waits): (Vec<_>, Vec<Receiver<()>>) = (0..WAITING).map(|_| channel()).unzip();
    for wait in waits {
        runtime.spawn_blocking(move || wait.recv());
    }
    drop(held);
    Ok(runtime)
}

/// Whether the system gives the threads and files that a run takes: at the start of a run, and for `doctor`.
///
/// # Errors
/// It gives too few.
pub(crate) fn can_run() -> Result<(), CommandRefusal> {
    enough().map_err(|error| {
        CommandRefusal::new(
            format_args!("this computer cannot start the {OF_A_RUN} threads that a run takes: {error}"),
            "end other programs of this user, or raise the limit: `ulimit -u`, or pids.max of the container",
        )
    })?;
    files(FILES_OF_A_RUN).map_err(|error| {
        CommandRefusal::new(
            format_args!("this program cannot open the {FILES_OF_A_RUN} files that a run takes: {error}"),
            "raise the limit: `ulimit -n`, or LimitNOFILE of the service; or end other programs of this computer",
        )
    })
}

/// A runtime beside a run, or without one, on the thread that asks for it.
///
/// # Errors
/// The system gives too few files, or refuses the runtime.
pub(crate) fn beside() -> io::Result<Runtime> {
    files(FILES_OF_A_RUNTIME)?;
    Builder::new_current_thread().enable_all().build()
}

/// Asks for so many files at the same time, and gives them back.
fn files(count: usize) -> io::Result<()> {
    let (first, _other) = io::pipe()?;
    let held: io::Result<Vec<io::PipeReader>> = (0..count.saturating_sub(2)).map(|_| first.try_clone()).collect();
    held.map(drop)
}

/// Starts as many threads as a run takes, all at the same time, and ends them again.
fn enough() -> io::Result<()> {
    let (held, waits): (Vec<_>, Vec<Receiver<()>>) = (0..OF_A_RUN).map(|_| channel()).unzip();
    let start = |wait: Receiver<()>| std::thread::Builder::new().spawn(move || wait.recv().unwrap_or_default());
    let started: Vec<io::Result<_>> = waits.into_iter().map(start).collect();
    drop(held);
    let mut all = Ok(());
    for thread in started {
        match thread {
            // It does nothing that could panic.
            Ok(thread) => drop(thread.join()),
            Err(error) => all = Err(error),
        }
    }
    all
}
