//! The session with the board: the runner finds the board, switches the module on, and makes both safe at the end.

use std::time::Duration;

use chrono::Utc;
use gnc_board::rule;
use gnc_board::{BoardClient, BoardError, BoardLease, Readings};
use gnc_executive::event::{BoardInfo as BoardEvent, EventKind, NoteLevel, Power};
use gnc_executive::job::{BoardAbilities, BoardLacks};
use gnc_link::{Doubt, Link, LinkError, Target};
use gnc_protocol::calibration::{CalibrationRead, CalibrationState};
use gnc_protocol::message::{Call, Flash, FlashId, Identity, MakeSafe, ModulePower, PowerReply, capability};
use gnc_protocol::{NakCode, PROTOCOL_VERSION};
use gnc_records::resume::ResumeError;
use gnc_records::store::StoreError;
use gnc_text::with_causes;
use tokio::sync::watch;
use tokio::time::error::Elapsed;
use tokio::time::{Instant, timeout};

use super::Run;
use crate::procedure::ProcedureError;

/// Longest wait for the board to make itself safe over a live link. If the board does not answer, its watchdog acts.
pub(super) const SAFE_WITHIN: Duration = Duration::from_millis(250);
/// What a slow line and an adapter may add to that, and the time after which an answer may be one that was lost.
const LINE_ADDS: Duration = Duration::from_millis(125);
const REPLAYED_AFTER: Duration = Duration::from_millis(750);
/// Longest wait after that for a board that is late. Its watchdog acts within two seconds.
const SAFE_LATE: Duration = Duration::from_millis(1500);

/// Longest wait for a request of the runner itself. All of them take milliseconds; a board that says for ever that one
/// goes on must not hold the run up.
pub(super) const OWN_CALL: Duration = Duration::from_secs(10);
/// Sections of the interface document whose breaches make the station ask again.
const ASKED_AGAIN: [u8; 4] = [3, 4, 6, 7];

/// What to look at if the module cannot be switched on.
const SHORTED: &str = "look for a short between the module's supply and ground, and at the module in the socket";

/// Why the runner cannot work with a board.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    #[error(transparent)]
    Open(#[from] LinkError),
    #[error(transparent)]
    Board(#[from] BoardError),
    /// What is open now is something else than what was there when the run began, and the head of the record is written.
    #[error("{doubt}; that was not so when the run began")]
    Swapped { doubt: Doubt },
}

impl ConnectError {
    pub(super) fn try_this(&self) -> &'static str {
        match self {
            Self::Open(error) => error.try_this(),
            Self::Board(error) => error.try_this(),
            Self::Swapped { .. } => "look where the port of the bench file leads, and start again",
        }
    }
}

/// Opens the link and meets the board. `is_real`: the record says that the bench is real, so the open link must prove it.
pub(super) async fn connect(
    target: &Target,
    is_real: bool,
    nonce: u32,
    readings: &watch::Sender<Readings>,
) -> Result<BoardClient, ConnectError> {
    let link = Link::open(target)?;
    if let Some(doubt) = link.doubt().filter(|_| is_real) {
        return Err(ConnectError::Swapped { doubt: doubt.clone() });
    }
    Ok(BoardClient::connect(link, nonce, readings.clone()).await?)
}

/// A random number each time, so that a board never takes a new session for the old one.
pub(super) fn by_chance() -> u32 {
    let now = Utc::now();
    now.timestamp().cast_unsigned() as u32 ^ now.timestamp_subsec_nanos().rotate_left(2) ^ std::process::id() << 16
}

/// An error with what people can try.
fn told(error: &(dyn std::error::Error + 'static), try_this: &str) -> String {
    format!("{}; {try_this}", with_causes(error))
}

/// The calibration that the module stores. A board without one, or one that cannot tell, is not at fault.
async fn calibration(lease: &BoardLease<'_>) -> Option<String> {
    let reply = timeout(OWN_CALL, lease.call(&CalibrationRead {})).await.ok()?.ok()?;
    let state = CalibrationState::from_number(reply.state)?;
    Some(match state {
        CalibrationState::None => "none".to_owned(),
        CalibrationState::Valid => format!("{:08x}", reply.checksum),
        CalibrationState::Damaged => "damaged".to_owned(),
    })
}

impl Run<'_> {
    /// The number of the next session.
    pub(super) fn nonce(&self) -> u32 {
        let begun = self.sessions.replace(self.sessions.get().wrapping_add(1));
        self.order.nonce.map_or_else(by_chance, |first| first.wrapping_add(begun))
    }

    pub(super) async fn found(&self, board: &BoardClient) -> Result<(), StoreError> {
        let hello = board.hello();
        let link = self.order.target.to_string();
        self.journal
            .emit(EventKind::BoardFound(BoardEvent {
                board_serial: hello.serial.as_str().to_owned(),
                firmware: hello.firmware.as_str().to_owned(),
                protocol: u16::from(PROTOCOL_VERSION),
                boot_id: format!("{:08x}", hello.boot_id),
                link,
            }))
            .await?;
        if hello.capabilities & capability::REPEATED_READINGS == 0 {
            return Ok(());
        }
        let text = "the board says that its sensors have an oscillator of their own: some readings come twice or are missing, and \
                    the figures of noise contain that (interface document, section 10)";
        self.note(NoteLevel::Warning, text.into(), None).await
    }

    /// Holds the plan against what the board says that it can do.
    pub(super) fn fit(&self, board: &BoardClient) -> Result<(), BoardLacks> {
        let has = |bit: u32| board.hello().capabilities & bit != 0;
        let abilities = BoardAbilities {
            supply: has(capability::POWER),
            can: has(capability::CAN),
            calibration: has(capability::CALIBRATION),
        };
        let job = self.order.job.on_board(abilities)?;
        self.board_can.set(Some(abilities));
        let _ = self.on_board.set(job);
        Ok(())
    }

    pub(super) async fn power_on(&self, board: &BoardClient, item: Option<&str>) -> Result<bool, StoreError> {
        let lease = self.own_desk(board);
        if !lease.switches_supply() {
            return self.is_on(&lease, "the board does not switch it", None, item).await;
        }
        let switched = tokio::select! {
            biased;
            asked = self.control.asked_times(1), if self.control.asked().times == 0 => Err(asked),
            switched = lease.call(&ModulePower { on: 1 }) => Ok(switched),
        };
        match switched {
            Err(asked) => {
                self.stop_in_order(asked).await?;
                Ok(false)
            }
            Ok(Ok(supply)) => self.is_on(&lease, "slave board", Some(supply), item).await,
            Ok(Err(error)) => {
                // A module that draws too much, or pulls the board down with it, is a bad module and not a bad bench.
                let module = matches!(error, BoardError::Fault { .. } | BoardError::Restarted { .. });
                let hint = if module { SHORTED } else { error.try_this() };
                let text = format!("the module cannot be switched on: {}; {hint}", with_causes(&error));
                self.note(NoteLevel::Error, text, item).await?;
                if module {
                    self.cannot_be_powered.set(true);
                    self.note_error_records(&lease, item).await?;
                }
                Ok(false)
            }
        }
    }

    /// Files that the module is under power. `false`: it is not the module that the run must have.
    async fn is_on(
        &self,
        lease: &BoardLease<'_>,
        supply: &str,
        measured: Option<PowerReply>,
        item: Option<&str>,
    ) -> Result<bool, StoreError> {
        let power = Power {
            on: true,
            supply: supply.to_owned(),
            voltage_v: measured.as_ref().map(|reply| f64::from(reply.supply_uv) * 1e-6),
            current_a: measured.as_ref().map(|reply| f64::from(reply.supply_ua) * 1e-6),
            calibration: calibration(lease).await,
        };
        let fits = self.takes_up(&power).map_err(|unlike| told(&unlike, unlike.try_this()));
        self.journal.emit(EventKind::Power(power)).await?;
        // Whose run it is comes before what is left of an earlier run of it.
        let same = self.is_same(lease).await;
        if let Err(error) = &same {
            self.file_other_module(error).await?;
        }
        if let Err(ProcedureError::OtherPart { .. }) = &same {
            self.is_other_part.set(true);
        }
        let known = if same.is_ok() { self.choose_limits().await? } else { Ok(()) };
        let same = same.map_err(|other| told(&other, other.try_this()));
        let Err(text) = same.and(known).and(fits) else { return Ok(true) };
        self.note(NoteLevel::Error, text, item).await?;
        Ok(false)
    }

    /// Checks that the module in the socket is the one that was scanned, and that of earlier sessions of the run. If the module does not answer, the items
    /// find that.
    async fn is_same(&self, lease: &BoardLease<'_>) -> Result<(), ProcedureError> {
        match self.identity(lease).await {
            Some(identity) => self.module.compare(&identity, "after the power-on"),
            None => Ok(()),
        }
    }

    /// Checks that board and module are those of the run that is taken up again.
    fn takes_up(&self, power: &Power) -> Result<(), ResumeError> {
        let Some(resumed) = &self.order.resumed else { return Ok(()) };
        let firmware = self.journal.look(|state| state.board().map(|board| board.firmware.clone()));
        resumed.fits(firmware.as_deref(), power.calibration.as_deref())
    }

    /// Asks something that needs the module's power, and changes nothing. A board whose module has no power refuses it. `None`: the answer does not tell.
    async fn is_powered<C: Call>(&self, board: &BoardClient, question: &C) -> Option<bool> {
        let lease = self.own_desk(board);
        match timeout(SAFE_WITHIN, lease.call(question)).await.ok()? {
            Ok(_) | Err(BoardError::Fault { .. }) => Some(true),
            Err(BoardError::Refused { code: NakCode::NotPowered, .. }) => Some(false),
            Err(_) => None,
        }
    }

    /// Whether the module is still under power although the board has made itself safe.
    async fn stays_powered(&self, board: &BoardClient) -> bool {
        let stays = self.is_powered(board, &FlashId { flash: Flash::Spi as u8 }).await == Some(true);
        if stays {
            board.broke(&rule::STAYS_POWERED);
        }
        stays
    }

    /// Whether the module lost the power that it was given.
    pub(super) async fn lost_power(&self, board: &BoardClient) -> bool {
        // Other items may use the flash meanwhile.
        self.own_desk(board).switches_supply() && self.is_powered(board, &Identity {}).await == Some(false)
    }

    /// Asks the board to make itself safe. One that is late is waited for and named.
    async fn made_safe(&self, board: &BoardClient) -> Result<Result<(), BoardError>, Elapsed> {
        let lease = self.own_desk(board);
        let safe = lease.call(&MakeSafe {});
        tokio::pin!(safe);
        match timeout(SAFE_WITHIN, &mut safe).await {
            Ok(safe) => Ok(safe),
            Err(_) => {
                let asked = Instant::now();
                let safe = timeout(SAFE_LATE, &mut safe).await;
                // The line and the adapter take some time, and a lost answer comes again much later.
                if safe == Ok(Ok(())) && (LINE_ADDS..REPLAYED_AFTER).contains(&asked.elapsed()) {
                    board.broke(&rule::SAFE_LATE);
                }
                safe
            }
        }
    }

    /// Switches the module off, stops streams, releases lines.
    pub(super) async fn make_safe(&self, board: BoardClient) -> Result<(), StoreError> {
        let safe = if self.link_lost.get() {
            Ok(Err(BoardError::Gone { reason: "the link was lost".into() }))
        } else {
            self.made_safe(&board).await
        };
        let switches = board.hello().capabilities & capability::POWER != 0;
        let stays_powered = switches && matches!(safe, Ok(Ok(()))) && self.stays_powered(&board).await;
        self.tell_absences(&board).await?;
        self.all_breaches(&board.breaches()).await?;
        let report = timeout(SAFE_WITHIN, board.close()).await.unwrap_or_default();
        self.all_breaches(&report.breaches).await?;
        match safe {
            Ok(Ok(())) if stays_powered => {
                let text = "DANGER: the board says that it is safe, and the module is still under power: switch the bench's supply off \
                            before you touch the module";
                self.note(NoteLevel::Error, text.into(), None).await?;
            }
            Ok(Ok(())) if !switches => {}
            Ok(Ok(())) => {
                let power = Power {
                    on: false,
                    supply: "slave board".into(),
                    voltage_v: None,
                    current_a: None,
                    calibration: None,
                };
                self.journal.emit(EventKind::Power(power)).await?;
            }
            Ok(Err(_)) | Err(_) => {
                let text = "the board did not confirm that it is safe; its watchdog makes it safe within 2 s";
                self.note(NoteLevel::Warning, text.into(), None).await?;
            }
        }
        let received = &report.received;
        let damaged = received.bad_checksum + received.malformed;
        // A board that answers late or not at all makes the station ask again; the line is not to blame then.
        let board = report.breaches.iter().any(|breach| ASKED_AGAIN.contains(&breach.rule.section));
        let resent = if board { 0 } else { report.resent };
        // A clock that goes back makes frames look late.
        let back = report.breaches.iter().any(|breach| breach.rule == &rule::CLOCK_BACK);
        let stale = if back { 0 } else { report.stale };
        if damaged + received.missing + resent + stale + report.echoed > 0 {
            let (missing, echo) = match report.echoed {
                0 => (received.missing.to_string(), String::new()),
                echoed => (
                    "an unknown number".to_owned(),
                    format!("; {echoed} of the station's own frames came back: the line echoes"),
                ),
            };
            let text = format!(
                "the line was not clean: {} frames received, {damaged} damaged, {missing} missing, {} late or received twice; {} \
                 requests sent again{echo}",
                received.frames, report.stale, report.resent
            );
            self.note(NoteLevel::Warning, text, None).await?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The head of the record says what the port was when the run began. What is there now must be that.
    #[tokio::test]
    async fn a_port_that_turns_into_a_pseudo_terminal_is_not_used() {
        let pty = nix::pty::openpty(None, None).unwrap();
        let target = Target::Serial { port: nix::unistd::ttyname(&pty.slave).unwrap(), rate_baud: 921_600 };
        let (readings, _) = watch::channel(Readings::default());
        let connected = connect(&target, true, 1, &readings).await;
        let Err(ConnectError::Swapped { doubt }) = connected else { panic!("{connected:?}") };
        assert_eq!(Some(doubt), target.doubt());
    }
}
