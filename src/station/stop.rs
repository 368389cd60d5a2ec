//! Requests to stop: the first ends the run in order, the second at once.

use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

/// How often somebody asked, and who was the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Asked {
    /// 0: nobody; 1: in order; 2 and more: at once.
    pub times: u32,
    /// "ctrl-C", "SIGTERM", "SIGHUP".
    pub by: &'static str,
}

/// Listens for requests to stop.
#[derive(Debug, Clone)]
pub struct Stop {
    asked: watch::Receiver<Asked>,
}

impl Stop {
    /// Takes over ctrl-C, SIGTERM and SIGHUP for the rest of the program.
    ///
    /// # Errors
    /// The system does not let it.
    pub fn from_signals() -> std::io::Result<Self> {
        let (sender, asked) = watch::channel(Asked::default());
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let mut hangup = signal(SignalKind::hangup())?;
        tokio::spawn(async move {
            loop {
                let by = tokio::select! {
                    _ = interrupt.recv() => "ctrl-C",
                    _ = terminate.recv() => "SIGTERM",
                    _ = hangup.recv() => "SIGHUP",
                };
                sender.send_modify(|asked| {
                    asked.times += 1;
                    asked.by = by;
                });
            }
        });
        Ok(Self { asked })
    }

    /// Whether somebody asked.
    #[must_use]
    pub fn asked(&self) -> Asked {
        *self.asked.borrow()
    }

    /// Waits until somebody has asked so many times.
    pub async fn asked_times(&self, times: u32) -> Asked {
        let mut asked = self.asked.clone();
        match asked.wait_for(|asked| asked.times >= times).await {
            Ok(asked) => *asked,
            // Nobody can ask any more.
            Err(_) => std::future::pending().await,
        }
    }
}
