//! The fixture of a bench turns the module and flips the DIP switches: a person at a terminal or at the screen, or a
//! device.

mod ask;

use std::io::BufRead as _;
use std::sync::Arc;

use gnc_records::store::StoreError;
use gnc_rig::{DriverError, Rig};
use tokio::sync::mpsc::{self, error::TrySendError};
use tokio::sync::{Mutex, oneshot};

use crate::recorder::Recorder;
pub use ask::{Ask, SwitchReading, TakenOver, about_axis, turn_rates};

/// Bound on the lines typed ahead that are kept. More lines mean that a key is held down.
const TYPED_AHEAD: usize = 16;

/// Why the module was not turned or a switch not flipped.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FixtureError {
    /// The plan needs a person, and the bench has no operator.
    #[error("there is no operator who could do this: {what}")]
    Nobody {
        /// What was to be done.
        what: String,
    },
    /// The operator answered no.
    #[error("the operator could not do this: {what}")]
    Refused {
        /// What was to be done.
        what: String,
    },
    /// The terminal or screen that showed the question is closed.
    #[error("the terminal was closed before the operator did this: {what}")]
    TerminalClosed {
        /// What was to be done.
        what: String,
    },
    /// The fixture failed to do it.
    #[error("{name} could not do this: {what}")]
    Fixture {
        /// The fixture.
        name: String,
        /// What was to be done.
        what: String,
        /// Why, in its own words.
        source: DriverError,
    },
    /// The turntable failed to do it.
    #[error("the turntable could not {what}")]
    Table {
        /// What was to be done.
        what: &'static str,
        /// Why, in its own words.
        source: DriverError,
    },
    /// A question or an answer could not be written to the record.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl FixtureError {
    /// What the operator can try.
    #[must_use]
    pub(crate) fn try_this(&self) -> &'static str {
        match self {
            Self::Nobody { .. } | Self::TerminalClosed { .. } => "run the plan on a terminal with an operator",
            Self::Refused { .. } => "repair the fixture and run the item again",
            Self::Fixture { .. } => "check the fixture and its cables; start the bench again",
            Self::Table { .. } => "check the motion in the plan, and the turntable's cables; start the bench again",
            Self::Store(error) => error.try_this(),
        }
    }
}

/// A question to a person at a screen.
#[derive(Debug)]
pub struct OperatorQuestion {
    /// The item that needs it.
    pub item: String,
    /// What to do.
    pub ask: Ask,
    /// Takes the answer: `false` means not possible. It is closed when the answer is no longer awaited.
    pub answer: oneshot::Sender<bool>,
}

/// The fixture of a bench.
#[derive(Debug)]
pub enum Fixture {
    /// No person and no device.
    Absent,
    /// A person who presses Enter.
    Operator(Operator),
    /// A person at the operator's screen.
    Screen(mpsc::Sender<OperatorQuestion>),
    /// A turntable with a fixture on it, which needs no person.
    Driven(Arc<dyn Rig>),
}

impl Fixture {
    /// Whether the bench has a fixture or an operator.
    #[must_use]
    pub fn is_there(&self) -> bool {
        !matches!(self, Self::Absent)
    }

    /// Sets one DIP switch (1 to 5) on and all others off, or all off.
    ///
    /// # Errors
    /// [`FixtureError`], or the record that could not be written.
    pub(crate) async fn only_switch(&self, on: Option<u8>, recorder: &Recorder<'_>) -> Result<(), FixtureError> {
        self.ask(&Ask::Switches(on), recorder, |rig| rig.only_switch(on)).await
    }

    /// Sets the switches once more, after they read otherwise than they were asked for.
    ///
    /// # Errors
    /// As [`Fixture::only_switch`].
    pub(crate) async fn only_switch_again(
        &self,
        on: Option<u8>,
        still: Vec<SwitchReading>,
        recorder: &Recorder<'_>,
    ) -> Result<(), FixtureError> {
        self.ask(&Ask::SwitchesAgain { on, still }, recorder, |rig| rig.only_switch(on)).await
    }

    /// Turns the level module to a heading, clockwise seen from above, from the mark on the table.
    ///
    /// # Errors
    /// As [`Fixture::only_switch`].
    pub(crate) async fn turn_to(&self, heading_deg: f64, recorder: &Recorder<'_>) -> Result<(), FixtureError> {
        self.ask(&Ask::Heading { deg: heading_deg }, recorder, |rig| rig.turn_to(heading_deg)).await
    }

    /// Asks for something in the words of the plan.
    ///
    /// # Errors
    /// As [`Fixture::only_switch`].
    pub(crate) async fn prompt(&self, what: &str, recorder: &Recorder<'_>) -> Result<(), FixtureError> {
        self.request(&Ask::Words(what.to_owned()), recorder).await
    }

    /// Asks for something that the bench cannot do by itself.
    ///
    /// # Errors
    /// As [`Fixture::only_switch`].
    pub(crate) async fn request(&self, ask: &Ask, recorder: &Recorder<'_>) -> Result<(), FixtureError> {
        self.ask(ask, recorder, |_| Ok(())).await
    }

    async fn ask(
        &self,
        ask: &Ask,
        recorder: &Recorder<'_>,
        drive: impl FnOnce(&dyn Rig) -> Result<(), DriverError>,
    ) -> Result<(), FixtureError> {
        let what = ask.action();
        recorder.prompted(&ask.to_string()).await?;
        let answer = match self {
            Self::Absent => return Err(FixtureError::Nobody { what }),
            Self::Operator(operator) => operator.wait(ask, recorder).await?,
            Self::Screen(screen) => at_the_screen(screen, recorder.item(), ask).await?,
            Self::Driven(rig) => {
                let failed = |source| FixtureError::Fixture { name: rig.name().to_owned(), what, source };
                drive(rig.as_ref()).map_err(failed)?;
                format!("done by {}", rig.name())
            }
        };
        Ok(recorder.answered(&answer).await?)
    }
}

async fn at_the_screen(screen: &mpsc::Sender<OperatorQuestion>, item: &str, ask: &Ask) -> Result<String, FixtureError> {
    let (answer, answered) = oneshot::channel();
    let closed = || FixtureError::TerminalClosed { what: ask.action() };
    screen.send(OperatorQuestion { item: item.to_owned(), ask: ask.clone(), answer }).await.map_err(|_| closed())?;
    match answered.await {
        Ok(true) => Ok(String::new()),
        Ok(false) => Err(FixtureError::Refused { what: ask.action() }),
        Err(_) => Err(closed()),
    }
}

/// A person at the terminal who answers with Enter, or with `n` for no.
#[derive(Debug)]
pub struct Operator {
    lines: Mutex<mpsc::Receiver<String>>,
}

impl Operator {
    /// Reads answers from standard input, on a thread that lives as long as the program.
    ///
    /// # Errors
    /// The thread could not be started.
    pub fn at_the_terminal() -> std::io::Result<Self> {
        let (sender, lines) = mpsc::channel(TYPED_AHEAD);
        std::thread::Builder::new().name("operator".into()).spawn(move || {
            for line in std::io::stdin().lock().lines() {
                let Ok(line) = line else { break };
                // Throw away a line that no question waits for: kept back, it would answer a later question.
                if let Err(TrySendError::Closed(_)) = sender.try_send(line) {
                    break;
                }
            }
        })?;
        Ok(Self { lines: Mutex::new(lines) })
    }

    /// Waits for an empty line or a no. Any other line, such as a scan, asks again.
    async fn wait(&self, ask: &Ask, recorder: &Recorder<'_>) -> Result<String, FixtureError> {
        let mut lines = self.lines.lock().await;
        // A line that was typed before the question does not answer it.
        while lines.try_recv().is_ok() {}
        loop {
            let Some(line) = lines.recv().await else {
                return Err(FixtureError::TerminalClosed { what: ask.action() });
            };
            match line.trim() {
                "" => return Ok(String::new()),
                "n" | "N" => return Err(FixtureError::Refused { what: ask.action() }),
                _ => recorder.prompted(&ask.to_string()).await?,
            }
        }
    }
}
