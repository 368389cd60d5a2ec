//! The fixture of a bench turns the module and flips the DIP switches: a person at a terminal or at the screen, or a
//! device.

mod ask;
mod lines;

use std::io::BufRead as _;
use std::sync::Arc;

use gnc_records::store::StoreError;
use gnc_rig::{DriverError, Rig};
use tokio::sync::mpsc::{self, error::TrySendError};
use tokio::sync::{Mutex, oneshot};

use crate::recorder::Recorder;
pub use ask::{Ask, QuestionAsked, SwitchReading, TakenOver, about_axis, numbered, turn_rates};
pub(crate) use lines::YES;

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
    /// The operator said that a question of the plan cannot be answered.
    #[error("the operator could not do this: {what}")]
    NotAnswered {
        /// The question, in its own words.
        what: String,
    },
    /// Nobody can answer a question of the plan.
    #[error("the question {question} cannot be answered: no person is at a terminal or at the screen")]
    NobodyAnswers {
        /// Its name and its words.
        question: String,
    },
    /// The answer on the command line is none.
    #[error("the answer on the command line to {question} is none: {why}")]
    NoAnswer {
        /// Name of the question.
        question: String,
        /// Why.
        why: String,
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
            Self::NobodyAnswers { .. } | Self::NoAnswer { .. } => {
                "answer it with --answer NAME=VALUE, or run the plan on a terminal or on the screen"
            }
            Self::Refused { .. } => "repair the fixture and run the item again",
            Self::NotAnswered { .. } => "find out why it was not possible, and run the item again",
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
    /// Takes the answer. It is closed when the answer is no longer awaited.
    pub answer: oneshot::Sender<Reply>,
}

/// What a person answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reply {
    /// It is done.
    Done,
    /// It is not possible.
    NotPossible,
    /// The answer to a question of the plan, as typed or scanned.
    Text(String),
    /// The question before is to be answered again.
    Back,
}

/// The fixture of a bench.
#[derive(Debug)]
pub enum Fixture {
    /// No person and no device.
    Absent,
    /// A person at the terminal.
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
        if let Self::Operator(operator) = self {
            operator.forget().await;
        }
        recorder.prompted(&ask.to_string()).await?;
        let answer = match self {
            Self::Absent => return Err(FixtureError::Nobody { what }),
            Self::Operator(operator) => operator.wait(ask, recorder).await?,
            Self::Screen(screen) => match at_the_screen(screen, recorder.item(), ask).await? {
                Reply::NotPossible => return Err(FixtureError::Refused { what }),
                Reply::Done | Reply::Text(_) | Reply::Back => String::new(),
            },
            Self::Driven(rig) => {
                let failed = |source| FixtureError::Fixture { name: rig.name().to_owned(), what, source };
                drive(rig.as_ref()).map_err(failed)?;
                format!("done by {}", rig.name())
            }
        };
        Ok(recorder.answered(&answer).await?)
    }
}

/// Asks at the screen, and waits for the answer.
pub(crate) async fn at_the_screen(
    screen: &mpsc::Sender<OperatorQuestion>,
    item: &str,
    ask: &Ask,
) -> Result<Reply, FixtureError> {
    let (answer, answered) = oneshot::channel();
    let closed = || FixtureError::TerminalClosed { what: ask.action() };
    screen.send(OperatorQuestion { item: item.to_owned(), ask: ask.clone(), answer }).await.map_err(|_| closed())?;
    answered.await.map_err(|_| closed())
}

/// A person at the terminal who answers with a line: `y` for done, `n` for no, or what a question of the plan asks for.
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

    /// Forgets the lines so far: a line that was typed before a question does not answer it. The caller shows the question after
    /// this, so that no line that answers it is lost.
    pub(crate) async fn forget(&self) {
        let mut lines = self.lines.lock().await;
        while lines.try_recv().is_ok() {}
    }

    /// Waits for a line that answers.
    pub(crate) async fn reply(&self, ask: &Ask) -> Result<Reply, FixtureError> {
        let mut lines = self.lines.lock().await;
        let line = lines.recv().await.ok_or_else(|| FixtureError::TerminalClosed { what: ask.action() })?;
        Ok(ask.reply(line))
    }

    /// Waits for a yes or a no. Any other line, such as a scan or a line end behind it, asks again.
    async fn wait(&self, ask: &Ask, recorder: &Recorder<'_>) -> Result<String, FixtureError> {
        loop {
            match self.reply(ask).await? {
                Reply::Done => return Ok(String::new()),
                Reply::NotPossible => return Err(FixtureError::Refused { what: ask.action() }),
                Reply::Text(_) | Reply::Back => recorder.prompted(&ask.to_string()).await?,
            }
        }
    }
}
