//! The second signal ends the program, whatever it does: while the thread of a run waits for a disk or a lock, too.
//!
//! The first one asks for a stop in order, and the run that hears the second one stops at once by itself. A thread of its
//! own counts the signals, since the run may hear nothing; it waits a moment and ends the process then.

use std::os::fd::AsFd as _;
use std::sync::mpsc;
use std::time::Duration;

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::{Signal as Kind, raise};
use tokio::signal::unix::{Signal, SignalKind, signal};

use crate::exit_code;
use crate::refusal::complain;

/// Time of a run that heard the second signal: it stops at once and closes its record, also on a slow disk.
const HEARD: Duration = Duration::from_secs(5);
/// Time of one that did not hear it: as long as the clock of an idle thread may be late.
const NOT_HEARD: Duration = Duration::from_secs(1);
/// Time for the return of the terminal and the last words. A blocked terminal takes neither.
const LAST_WORDS: Duration = Duration::from_millis(500);

/// Watches for the second SIGINT or SIGTERM from now on. `heard` tells whether the program is about to end by itself;
/// `give_back` returns the terminal.
///
/// # Errors
/// The system starts no thread or does not allow it.
pub(crate) fn at_second_signal(
    heard: impl Fn() -> bool + Send + 'static,
    give_back: impl FnOnce() + Send + 'static,
) -> std::io::Result<()> {
    let (tell, ready) = mpsc::channel();
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = match runtime {
            Ok(runtime) => runtime,
            Err(error) => return drop(tell.send(Err(error))),
        };
        let entered = runtime.enter();
        let signals = signal(SignalKind::interrupt()).and_then(|one| Ok((one, signal(SignalKind::terminate())?)));
        drop(entered);
        match signals {
            Ok(signals) => {
                let _ = tell.send(Ok(()));
                runtime.block_on(count(signals, heard));
                end(give_back);
            }
            Err(error) => drop(tell.send(Err(error))),
        }
    })?;
    ready.recv().unwrap_or_else(|_| Err(std::io::ErrorKind::BrokenPipe.into()))
}

/// Returns when the program must end.
async fn count((mut interrupt, mut terminate): (Signal, Signal), heard: impl Fn() -> bool) {
    next(&mut interrupt, &mut terminate).await;
    next(&mut interrupt, &mut terminate).await;
    if tokio::time::timeout(NOT_HEARD, next(&mut interrupt, &mut terminate)).await.is_err() && heard() {
        // A third signal waits for nothing.
        let _ = tokio::time::timeout(HEARD, next(&mut interrupt, &mut terminate)).await;
    }
}

async fn next(interrupt: &mut Signal, terminate: &mut Signal) {
    tokio::select! {
        _ = interrupt.recv() => {}
        _ = terminate.recv() => {}
    }
}

/// Ends the process. What takes too long is left out.
fn end(give_back: impl FnOnce() + Send + 'static) {
    let (tell, done) = mpsc::channel::<()>();
    let last_words = move || {
        // Lives as long as the thread.
        let _tell = tell;
        give_back();
        say();
        std::process::exit(i32::from(exit_code::ABORTED));
    };
    // Without a thread the process ends without words.
    if std::thread::Builder::new().name("end".into()).spawn(last_words).is_ok() {
        let _ = done.recv_timeout(LAST_WORDS);
    }
    let _ = raise(Kind::SIGKILL);
}

fn say() {
    let stderr = std::io::stderr();
    let mut takes = [PollFd::new(stderr.as_fd(), PollFlags::POLLOUT)];
    if poll(&mut takes, PollTimeout::ZERO).unwrap_or(0) > 0 {
        complain(
            "ended at once, since a second signal asked for it",
            "the next start closes the record of a run; a board without its station switches its module off",
        );
    }
}
