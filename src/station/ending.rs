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

/// Time of a run that heard the second signal: it stops at once and closes its record. For that it may wait ten seconds for the
/// lock of the records, and has hundreds of megabytes to digest and to bring to a slow disk.
const HEARD: Duration = Duration::from_secs(60);
/// Time of one that did not hear it: as long as the clock of an idle thread may be late.
const NOT_HEARD: Duration = Duration::from_secs(1);
/// Time for the return of the terminal and the last words. A blocked terminal takes neither.
const LAST_WORDS: Duration = Duration::from_millis(500);

/// Watches for the second SIGINT or SIGTERM from now on. `heard` tells whether the program is about to end by itself; `waits` is
/// called once if it still closes a record then; `give_back` returns the terminal.
///
/// # Errors
/// The system starts no thread or does not allow it.
pub(crate) fn at_second_signal(
    heard: impl Fn() -> bool + Send + 'static,
    waits: impl FnOnce() + Send + 'static,
    give_back: impl FnOnce() + Send + 'static,
) -> std::io::Result<()> {
    let (tell, ready) = mpsc::channel();
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        let runtime = crate::threads::beside();
        let runtime = match runtime {
            Ok(runtime) => runtime,
            Err(error) => return drop(tell.send(Err(error))),
        };
        let entered = runtime.enter();
        let signals = signal(SignalKind::interrupt()).and_then(|one| Ok((one, signal(SignalKind::terminate())?)));
        drop(entered);
        match signals {
            Ok((mut interrupt, mut terminate)) => {
                let _ = tell.send(Ok(()));
                runtime.block_on(count(async || next(&mut interrupt, &mut terminate).await, heard, waits));
                end(give_back);
            }
            Err(error) => drop(tell.send(Err(error))),
        }
    })?;
    ready.recv().unwrap_or_else(|_| Err(std::io::ErrorKind::BrokenPipe.into()))
}

/// Returns when the program must end. `next` waits for a signal.
async fn count(mut next: impl AsyncFnMut(), heard: impl Fn() -> bool, waits: impl FnOnce()) {
    next().await;
    next().await;
    if tokio::time::timeout(NOT_HEARD, next()).await.is_err() && heard() {
        waits();
        // A third signal waits for nothing.
        let _ = tokio::time::timeout(HEARD, next()).await;
    }
}

/// Says why a run that was told to end is still there.
pub(crate) fn say_that_it_closes() {
    if stderr_takes() {
        complain(
            format_args!(
                "the run is stopped, and its record is being closed; that ends after {} s at most",
                HEARD.as_secs()
            ),
            "wait, or press ctrl-C once more: the next start then closes the record",
        );
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

/// Whether standard error takes a line now: a blocked terminal does not.
fn stderr_takes() -> bool {
    let stderr = std::io::stderr();
    let mut takes = [PollFd::new(stderr.as_fd(), PollFlags::POLLOUT)];
    poll(&mut takes, PollTimeout::ZERO).unwrap_or(0) > 0
}

fn say() {
    if stderr_takes() {
        complain(
            "ended at once, since a second signal asked for it",
            "the next start closes the record of a run; a board without its station switches its module off",
        );
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use tokio::sync::mpsc::unbounded_channel;
    use tokio::time::{Instant, sleep};

    use super::*;

    /// How long the program lives after the second of these signals, by their times in seconds, and how often it says that it
    /// closes a record.
    async fn lives_on(signals_s: &[u64], heard: bool) -> (Duration, u32) {
        let (tell, mut told) = unbounded_channel();
        let began = Instant::now();
        let said = Cell::new(0);
        let sends = async {
            for at_s in signals_s {
                sleep(Duration::from_secs(*at_s).saturating_sub(began.elapsed())).await;
                tell.send(()).expect("a listener");
            }
            std::future::pending::<()>().await;
        };
        tokio::select! {
            () = count(async || told.recv().await.expect("a signal"), || heard, || said.set(said.get() + 1)) => {}
            () = sends => {}
        }
        (began.elapsed() - Duration::from_secs(signals_s[1]), said.get())
    }

    /// A closing waits up to 10 s for the lock, and then has the digests of all captures before it.
    #[tokio::test(start_paused = true)]
    async fn a_run_that_heard_has_time_to_close_its_record() {
        let (lives, said) = lives_on(&[0, 3], true).await;
        assert!(lives >= Duration::from_secs(10 + 30), "{lives:?}");
        assert_eq!(said, 1);
        let (lives, said) = lives_on(&[0, 3, 20], true).await;
        assert_eq!((lives, said), (Duration::from_secs(17), 1), "the third signal");
        assert_eq!(lives_on(&[0, 3, 3], true).await, (Duration::ZERO, 0), "three at once");
    }

    #[tokio::test(start_paused = true)]
    async fn a_run_that_did_not_hear_is_ended() {
        assert_eq!(lives_on(&[0, 3], false).await, (NOT_HEARD, 0));
        assert_eq!(lives_on(&[0, 3600], false).await, (NOT_HEARD, 0), "no signal is forgotten");
    }
}
