//! What people and signals ask of a run while it is under way: to stop, to pause, to give up one item.
//!
//! A [`RunControl`] is a handle that may be copied. Each holder can ask, and the runner listens.

use gnc_board::latest::Latest;
use tokio::signal::unix::{SignalKind, signal};

/// How often a stop was asked for, and who asked last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Asked {
    /// 0: not at all; 1: stop in order; 2 and more: stop at once.
    pub times: u32,
    /// Who asked: "ctrl-C", "SIGTERM", "SIGHUP" or "the operator".
    pub by: &'static str,
}

/// Passes requests of people and signals to the runner.
#[derive(Debug, Clone)]
pub struct RunControl {
    wanted: Latest<Wanted>,
}

#[derive(Debug, Clone, Default)]
struct Wanted {
    stop: Asked,
    paused: bool,
    /// Names of items that the operator gave up.
    given_up: Vec<String>,
}

impl Default for RunControl {
    /// Nothing is asked.
    fn default() -> Self {
        Self { wanted: Latest::new(Wanted::default()) }
    }
}

impl RunControl {
    /// Takes over ctrl-C, SIGTERM and SIGHUP for the rest of the program: each asks for a stop. SIGHUP never asks for one at
    /// once.
    ///
    /// # Errors
    /// The system does not allow it.
    pub fn from_signals() -> std::io::Result<Self> {
        let control = Self::default();
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let mut hangup = signal(SignalKind::hangup())?;
        let asks = control.clone();
        tokio::spawn(async move {
            loop {
                tokio::select! {
                    _ = interrupt.recv() => asks.stop("ctrl-C"),
                    _ = terminate.recv() => asks.stop("SIGTERM"),
                    _ = hangup.recv() => asks.stop_in_order("SIGHUP"),
                }
            }
        });
        Ok(control)
    }

    /// Asks for a stop: the first time in order, then at once.
    pub fn stop(&self, by: &'static str) {
        self.wanted.change(|wanted| wanted.stop = Asked { times: wanted.stop.times + 1, by });
    }

    /// Asks for a stop in order, unless a stop was asked for. A terminal that hangs up tells it more than once: by signals,
    /// and by the end of its input. That is no hurry.
    pub fn stop_in_order(&self, by: &'static str) {
        self.wanted.change(|wanted| {
            if wanted.stop.times == 0 {
                wanted.stop = Asked { times: 1, by };
            }
        });
    }

    /// How often a stop was asked for, and by whom.
    #[must_use]
    pub fn asked(&self) -> Asked {
        self.wanted.look(|wanted| wanted.stop)
    }

    /// Waits until a stop was asked for so many times.
    pub async fn asked_times(&self, times: u32) -> Asked {
        self.wanted.until(|wanted| wanted.stop.times >= times).await.stop
    }

    /// Pauses a run or resumes it. A pause lets nothing new begin; what runs goes on.
    pub fn pause(&self, paused: bool) {
        self.wanted.change(|wanted| wanted.paused = paused);
    }

    /// Whether a pause holds new items back. A stop ends a pause.
    #[must_use]
    pub(crate) fn is_paused(&self) -> bool {
        self.wanted.look(|wanted| wanted.paused && wanted.stop.times == 0)
    }

    /// Waits until the pause is over or a stop is asked for.
    pub(crate) async fn resumed(&self) {
        self.wanted.until(|wanted| !wanted.paused || wanted.stop.times > 0).await;
    }

    /// Gives up the attempt of this item that is under way; the run goes on.
    pub fn give_up(&self, item: &str) {
        self.wanted.change(|wanted| {
            if !wanted.given_up.iter().any(|name| name == item) {
                wanted.given_up.push(item.to_owned());
            }
        });
    }

    /// Begins a new attempt of this item: earlier requests to give the item up do not apply to it.
    pub(crate) fn begin(&self, item: &str) {
        self.wanted.change(|wanted| wanted.given_up.retain(|name| name != item));
    }

    /// Waits until this item is given up.
    pub(crate) async fn given_up(&self, item: &str) {
        self.wanted.until(|wanted| wanted.given_up.iter().any(|name| name == item)).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_ends_a_pause() {
        let control = RunControl::default();
        control.pause(true);
        assert!(control.is_paused());
        control.stop("SIGTERM");
        assert!(!control.is_paused());
        assert_eq!(control.asked(), Asked { times: 1, by: "SIGTERM" });
    }

    /// A hang-up comes by signals and by the end of the input, in any order.
    #[test]
    fn a_terminal_that_hangs_up_is_one_stop() {
        let control = RunControl::default();
        control.stop_in_order("SIGHUP");
        control.stop_in_order("the end of the terminal");
        control.stop_in_order("SIGHUP");
        assert_eq!(control.asked(), Asked { times: 1, by: "SIGHUP" });
        control.stop("SIGTERM");
        control.stop_in_order("SIGHUP");
        assert_eq!(control.asked(), Asked { times: 2, by: "SIGTERM" });
    }

    #[tokio::test]
    async fn what_was_asked_before_is_not_meant_for_the_next_attempt() {
        let control = RunControl::default();
        control.give_up("imu");
        control.given_up("imu").await;
        control.begin("imu");
        let waits = tokio::time::timeout(std::time::Duration::ZERO, control.given_up("imu")).await;
        assert!(waits.is_err(), "the new attempt is given up too");
    }
}
