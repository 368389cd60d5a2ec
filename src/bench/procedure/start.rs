//! How a module starts after a power-on, and whether it is still the module of the run.

use std::cell::RefCell;
use std::time::Duration;

use gnc_board::BoardError;
use gnc_executive::event::OtherModule;
use gnc_executive::part::PartName;
use gnc_protocol::FaultCode;
use gnc_protocol::message::{Identity, IdentityReply};

use super::{ProcedureContext, ProcedureError};
use crate::turntable::Turntable;

/// Pause between two requests to a module that does not answer yet: a request that is refused at once is not repeated at once.
const ASK_EVERY: Duration = Duration::from_millis(20);

/// The module that answered first in this run. Samples and figures of a run are of one module.
#[derive(Debug)]
pub(crate) struct ModuleSeen {
    /// The number that was scanned.
    scanned: String,
    /// The part that was asked for.
    part: Option<PartName>,
    first: RefCell<Option<IdentityReply>>,
}

impl ModuleSeen {
    /// Whether the scanned module has said who it is.
    pub(crate) fn is_known(&self) -> bool {
        self.first.borrow().is_some()
    }

    /// No module has said who it is yet.
    pub(crate) fn asked(serial_number: &str, part: Option<&PartName>) -> Self {
        Self { scanned: serial_number.to_owned(), part: part.cloned(), first: RefCell::default() }
    }

    /// What the module says that it is, if it has said so.
    pub(crate) fn part(&self) -> Option<PartName> {
        self.first.borrow().as_ref().map(part)
    }

    /// Holds the first identity of the run against the scanned number and the part that was asked for, remembers it, and compares every later one with it.
    /// `when` tells people when it came.
    ///
    /// # Errors
    /// [`ProcedureError::OtherModule`]: this module was not scanned. [`ProcedureError::OtherPart`]: it is another part. [`ProcedureError::ModuleChanged`]: another module answers
    /// than before.
    pub(crate) fn compare(&self, identity: &IdentityReply, when: impl Into<String>) -> Result<(), ProcedureError> {
        let mut first = self.first.borrow_mut();
        let found = identity.serial_number.as_str();
        let exchanged = first.is_some();
        let other = (found != self.scanned).then(|| OtherModule {
            scanned: self.scanned.clone(),
            found: found.to_owned(),
            exchanged,
        });
        let other = match other {
            Some(other) if first.is_none() => return Err(ProcedureError::OtherModule(other)),
            other => other,
        };
        let found = part(identity);
        // A module that is exchanged later is told below, with both numbers.
        if first.is_none()
            && let Some(asked) = self.part.as_ref().filter(|asked| found.contradicts(asked))
        {
            return Err(ProcedureError::OtherPart { asked: asked.clone(), found });
        }
        let first = first.get_or_insert_with(|| identity.clone());
        if first == identity {
            return Ok(());
        }
        Err(ProcedureError::ModuleChanged { when: when.into(), was: name(first), is: name(identity), other })
    }
}

fn part(identity: &IdentityReply) -> PartName {
    PartName::new(identity.part.as_str(), Some(identity.hardware.as_str()))
}

fn name(identity: &IdentityReply) -> String {
    let IdentityReply { serial_number, part, hardware, firmware, .. } = identity;
    format!("{serial_number} ({part}, hardware {hardware}, firmware {firmware})")
}

/// What a module did after a power-on.
#[derive(Debug)]
pub(super) enum Start {
    /// It said who it is, so many seconds of board time after the request for power.
    Answered { identity: IdentityReply, after_s: f64 },
    /// It did not say who it is in time: its last silence, and how long the board asked.
    Silent { silence: BoardError, asked_s: f64 },
}

/// Asks who the module is until it answers or `timeout_s` is over. `switching` is the board time of the request for power.
///
/// # Errors
/// The board or the line fails.
pub(super) async fn first_identity(
    bench: &ProcedureContext<'_>,
    table: &dyn Turntable,
    switching: Duration,
    timeout_s: f64,
) -> Result<Start, ProcedureError> {
    let mut since_on = switching;
    loop {
        let silence = match bench.board.ask(&Identity {}).await {
            Ok((identity, answer)) => {
                since_on += answer.elapsed;
                return Ok(Start::Answered { identity, after_s: since_on.as_secs_f64() });
            }
            Err(silence @ BoardError::Fault { code: FaultCode::DeviceTimeout, elapsed, .. }) => {
                since_on += elapsed;
                silence
            }
            Err(error) => return Err(error.into()),
        };
        if since_on.as_secs_f64() >= timeout_s {
            return Ok(Start::Silent { silence, asked_s: since_on.as_secs_f64() });
        }
        table.pause(ASK_EVERY).await?;
        since_on += ASK_EVERY;
    }
}
