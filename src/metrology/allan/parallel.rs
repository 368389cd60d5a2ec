//! Work that is divided among threads, with results in the order of the work.

use std::sync::{Mutex, PoisonError};
use std::thread;

/// Runs `work` on each part, on a thread of its own, and returns the results in order. Where the system gives no more threads, the
/// thread that asks does the rest.
pub(super) fn on_threads<T: Send, R: Send>(parts: impl IntoIterator<Item = T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    let work = &work;
    // A part stays in its slot until it is worked on: a thread that is refused does not take it away.
    let slots: Vec<Mutex<Option<T>>> = parts.into_iter().map(|part| Mutex::new(Some(part))).collect();
    let take = |slot: &Mutex<Option<T>>| slot.lock().unwrap_or_else(PoisonError::into_inner).take().map(work);
    thread::scope(|scope| {
        let threads: Vec<_> =
            slots.iter().map(|slot| (slot, thread::Builder::new().spawn_scoped(scope, move || take(slot)))).collect();
        let done = threads.into_iter().filter_map(|(slot, thread)| match thread {
            Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            Err(_) => take(slot),
        });
        done.collect()
    })
}

/// Runs `work` for each factor. The threads take the factors in turn.
pub(super) fn spread<R: Copy + Send>(factors: &[usize], threads: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let threads = threads.clamp(1, factors.len().max(1));
    let lanes = on_threads(0..threads, |lane| -> Vec<R> {
        factors.iter().skip(lane).step_by(threads).map(|&m| work(m)).collect()
    });
    (0..factors.len()).map(|k| lanes[k % threads][k / threads]).collect()
}
