//! The scanner at a serial port, beside one that types as a keyboard does.

use std::future::pending;
use std::path::PathBuf;
use std::time::Duration;

use gnc_executive::bench::ScannerSettings;
use gnc_link::serial::{Heard, Listener};
use gnc_text::with_causes;
use tokio::time::{Instant, sleep_until};

use crate::tui::framing::ScannerLines;
use crate::tui::update::Msg;

/// Listens to the scanner of the bench, if it has one.
#[derive(Debug)]
pub(super) struct ScannerPort {
    settings: Option<ScannerSettings>,
    listener: Option<Listener>,
    lines: ScannerLines,
    began: Instant,
    /// Scans that came together.
    waiting: std::collections::VecDeque<Msg>,
}

impl ScannerPort {
    pub(super) fn none() -> Self {
        let (lines, waiting) = (ScannerLines::default(), std::collections::VecDeque::new());
        Self { settings: None, listener: None, lines, began: Instant::now(), waiting }
    }

    /// Listens to this scanner from now on. One that was there before stays open.
    pub(super) fn set(&mut self, settings: Option<&ScannerSettings>) {
        if self.settings.as_ref() != settings {
            let listener = |scanner: &ScannerSettings| Listener::new(PathBuf::from(&scanner.port), scanner.rate_bps);
            *self = Self { settings: settings.cloned(), listener: settings.map(listener), ..Self::none() };
        }
    }

    /// Waits for the next scan, or for what happened to the scanner. A caller that drops this wait half way loses nothing.
    pub(super) async fn next(&mut self) -> Msg {
        let Self { settings: Some(settings), listener: Some(listener), lines, began, waiting } = self else {
            return pending().await;
        };
        loop {
            if let Some(msg) = waiting.pop_front() {
                return msg;
            }
            let due_at = lines.due_at().map(|due_at| *began + due_at);
            tokio::select! {
                biased;
                heard = listener.next() => match heard {
                    Heard::Bytes(bytes) => waiting.extend(lines.feed(since(*began), &bytes).into_iter().map(Msg::Scan)),
                    Heard::Away(error) => {
                        lines.cut();
                        let why = format!("{}; {}", with_causes(&error), error.try_this());
                        return Msg::ScannerLost { why };
                    }
                    Heard::Back => return Msg::ScannerBack { port: settings.port.clone() },
                },
                () = sleep_until(due_at.unwrap_or(*began)), if due_at.is_some() => {
                    waiting.extend(lines.rest().map(Msg::Scan));
                }
            }
        }
    }
}

fn since(began: Instant) -> Duration {
    Instant::now().saturating_duration_since(began)
}
