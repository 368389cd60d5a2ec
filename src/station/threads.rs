//! The threads that a run takes: the system is asked for them before anything is switched on. A run that met the limit at its
//! end would lose its record.

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
/// A thread that is idle stays: longer than any run.
const STAYS: Duration = Duration::from_secs(365 * 86_400);

/// The runtime of runs, with its threads.
///
/// # Errors
/// The system has too few threads for a run, or refuses the runtime.
pub(crate) fn runtime() -> Result<Runtime, CommandRefusal> {
    let cannot = |error: io::Error| CommandRefusal::new(format_args!("cannot start: {error}"), "");
    enough().map_err(|error| {
        CommandRefusal::new(
            format_args!("this computer cannot start the {OF_A_RUN} threads that a run takes: {error}"),
            "end other programs of this user, or raise the limit: `ulimit -u`, or pids.max of the container",
        )
    })?;
    let runtime = Builder::new_current_thread().enable_all().thread_keep_alive(STAYS).build().map_err(cannot)?;
    // Each of them waits until all are there, else one thread would do the work of all.
    let (held, waits): (Vec<_>, Vec<Receiver<()>>) = (0..WAITING).map(|_| channel()).unzip();
    for wait in waits {
        runtime.spawn_blocking(move || wait.recv());
    }
    drop(held);
    Ok(runtime)
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
