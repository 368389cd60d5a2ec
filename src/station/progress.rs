//! A word of what takes long, on standard error. Standard output keeps its lines: they may be for a program.
//!
//! A thread of its own counts the time, so that a single step that takes long is told, too. Where the system starts no thread,
//! nothing is told.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::locale::Environment;
use crate::phrases::in_language;

/// A person at a terminal wonders after so long.
const SOON: Duration = Duration::from_secs(2);
/// Time between two lines. Where the output is no terminal, it is also the time before the first line.
const EVERY: Duration = Duration::from_secs(10);

/// Tells how far something is until it is dropped.
#[derive(Debug)]
pub(crate) struct Progress {
    done: Arc<Done>,
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// How far it is. Without a total only the time is told.
#[derive(Debug, Default)]
struct Done {
    done: AtomicU64,
    total: AtomicU64,
}

impl Progress {
    /// Begins. `what` is a sentence without its end: "the runs are compared".
    pub(crate) fn begin(what: &'static str) -> Self {
        let first = if std::io::stderr().is_terminal() { SOON } else { EVERY };
        let lang = Environment::read().language(None);
        // Ignore an error of the write: without standard error there is no other place.
        Self::with(what, (first, EVERY), move |line| drop(writeln!(std::io::stderr(), "{}", in_language(line, lang))))
    }

    fn with(what: &'static str, (first, every): (Duration, Duration), say: impl Fn(&str) + Send + 'static) -> Self {
        let done = Arc::<Done>::default();
        let (end, ended) = channel();
        let told = Arc::clone(&done);
        let spawned = std::thread::Builder::new()
            .name("progress".into())
            .spawn(move || tell(what, &told, &ended, (first, every), say));
        Self { done, end: Some(end), thread: spawned.ok() }
    }

    /// Sets what there is to do in all.
    pub(crate) fn total(&self, total: usize) {
        self.done.total.store(total as u64, Ordering::Relaxed);
    }

    /// Adds to what is done.
    pub(crate) fn step(&self, steps: usize) {
        self.done.done.fetch_add(steps as u64, Ordering::Relaxed);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        drop(self.end.take());
        // No line of it comes behind what is told next.
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Says how far it is, until the other end is dropped.
fn tell(what: &str, done: &Done, ended: &Receiver<()>, (first, every): (Duration, Duration), say: impl Fn(&str)) {
    let began = Instant::now();
    let mut wait = first;
    while ended.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
        let seconds = began.elapsed().as_secs();
        let [done, total] = [&done.done, &done.total].map(|count| count.load(Ordering::Relaxed));
        say(&match total {
            0 => format!("{what}: {seconds} s so far"),
            _ => format!("{what}: {} % after {seconds} s", done.saturating_mul(100) / total),
        });
        wait = every;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What takes no time says nothing; the next lines say how far it is.
    #[test]
    fn what_takes_long_is_told_until_it_ends() {
        let (tell, told) = channel();
        let say = move |line: &str| tell.send(line.to_owned()).unwrap_or_default();
        let short = Progress::with("it is done", (EVERY, EVERY), say.clone());
        drop(short);
        assert_eq!(told.try_recv().ok(), None);

        let moment = Duration::from_millis(1);
        let long = Progress::with("it is done", (moment, moment), say);
        let line = told.recv().unwrap_or_default();
        assert!(line.starts_with("it is done: ") && line.ends_with(" s so far"), "{line}");
        long.total(8);
        long.step(2);
        let line = told.iter().find(|line| line.contains('%')).unwrap_or_default();
        assert!(line.starts_with("it is done: ") && line.contains(" % after "), "{line}");
        long.step(4);
        assert!(told.iter().any(|line| line.contains(": 75 % after ")));
        drop(long);
        assert!(told.iter().last().is_none_or(|line| line.contains('%')), "no line comes behind the end");
    }
}
