//! Work that is divided among threads, with results in the order of the work.

use std::thread;

/// Runs `work` on each part, on a thread of its own, and returns the results in order.
pub(super) fn on_threads<T: Send, R: Send>(parts: impl IntoIterator<Item = T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    let work = &work;
    thread::scope(|scope| {
        let handles: Vec<_> = parts.into_iter().map(|part| scope.spawn(move || work(part))).collect();
        let joined = handles.into_iter().map(thread::ScopedJoinHandle::join);
        joined.map(|result| result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
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
