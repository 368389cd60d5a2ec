//! The limits for the module in the socket: a plan may have others for each part number.

use std::time::Duration;

use gnc_board::{BoardError, BoardLease};
use gnc_executive::event::EventKind;
use gnc_executive::part::{LimitsChosen, PartName};
use gnc_executive::plan::Plan;
use gnc_protocol::FaultCode;
use gnc_protocol::message::{Identity, IdentityReply};
use gnc_records::store::StoreError;
use tokio::time::{sleep, timeout};

use super::Run;
use super::connection::OWN_CALL;
use crate::fixture::Fixture;

/// Board time within which a module must say who it is (interface document, section 8), and the pause between two requests.
const STARTS_WITHIN: Duration = Duration::from_secs(10);
const ASK_EVERY: Duration = Duration::from_millis(20);

/// What to do if nobody says which limits count.
const SAY_PART: &str = "look whether the module starts; with --part and --revision its limits are known beforehand";

impl Run<'_> {
    /// What the module says of itself; `None` if it says nothing. Where limits depend on the answer, a module that starts slowly
    /// is waited for.
    pub(super) async fn identity(&self, lease: &BoardLease<'_>) -> Option<IdentityReply> {
        let matters = self.job().plan().has_parts() || self.order.header.part.is_some();
        let mut waited = Duration::ZERO;
        loop {
            let silence = match timeout(OWN_CALL, lease.ask(&Identity {})).await.ok()? {
                Ok((identity, _)) => return Some(identity),
                Err(BoardError::Fault { code: FaultCode::DeviceTimeout, elapsed, .. }) if matters => elapsed,
                Err(_) => return None,
            };
            waited += silence + ASK_EVERY;
            if waited >= STARTS_WITHIN || self.control.asked().times > 0 {
                return None;
            }
            if !matches!(self.order.fixture, Fixture::Driven(_)) {
                // A simulated bench has a clock of its own.
                sleep(ASK_EVERY).await;
            }
        }
    }

    /// Chooses the limits by what the module says that it is, or by what was asked for if it says nothing: what it says later is
    /// compared with that. The inner error says why there are none.
    pub(super) async fn choose_limits(&self) -> Result<Result<(), String>, StoreError> {
        let job = self.job();
        if !job.plan().has_parts() || self.by_part.get().is_some() {
            return Ok(Ok(()));
        }
        let module = match self.module_part(job.plan()) {
            Ok(module) => module,
            Err(text) => return Ok(Err(text)),
        };
        let chosen = match job.plan().choose_limits(&module) {
            Ok(chosen) => chosen,
            Err(error) => return Ok(Err(format!("{error}; {}", error.try_this()))),
        };
        let plan = chosen.part.as_ref().and_then(|part| job.plan().with_limits_of(part));
        let judging = plan.map_or_else(|| job.clone(), |plan| job.judged_by(plan));
        self.journal.emit(EventKind::LimitsChosen(chosen.clone())).await?;
        if let Err(text) = self.are_resumed(&chosen) {
            return Ok(Err(text));
        }
        let judging = match self.board_can.get() {
            // The limits may ask for something that the board does not measure.
            Some(abilities) => judging.on_board(abilities),
            None => Ok(judging),
        };
        Ok(match judging {
            Ok(judging) => {
                let _ = self.by_part.set(judging);
                Ok(())
            }
            Err(lacks) => Err(format!("the limits {chosen} cannot be kept: {lacks}; {}", lacks.try_this())),
        })
    }

    /// The part of the module.
    fn module_part(&self, plan: &Plan) -> Result<PartName, String> {
        // One that says blanks says nothing.
        if let Some(module) = self.module.part().filter(|module| !module.is_blank()) {
            return Ok(module);
        }
        let why = match &self.order.header.part {
            Some(asked) if asked.revision.is_some() || !plan.has_revisions_of(asked) => return Ok(asked.clone()),
            Some(asked) => format!("the limits for part {asked} depend on its revision"),
            None => "the limits of the plan depend on the part number".to_owned(),
        };
        Err(format!("the module does not say what it is, and {why}; {SAY_PART}"))
    }

    /// Checks that captures which are taken over would be judged by the limits of their run.
    fn are_resumed(&self, chosen: &LimitsChosen) -> Result<(), String> {
        let Some(resumed) = &self.order.resumed else { return Ok(()) };
        resumed.fits_limits(chosen).map_err(|unlike| format!("{unlike}; {}", unlike.try_this()))
    }
}
