//! Shows raw values without a run: without a plan, a verdict or a record.

use std::time::Duration;

use gnc_board::{Advance, BoardClient, BoardError, BoardLease, Readings};
use gnc_link::Target;
use gnc_protocol::calibration::{CalibrationRead, CalibrationState};
use gnc_protocol::message::{AdRead, GnssRestart, GnssStart, MakeSafe, ModulePower, StreamStart};
use gnc_protocol::stream::StreamId;
use tokio::sync::watch;
use tokio::time::{interval, timeout};

use super::connection::{ConnectError, SAFE_WITHIN, by_chance, connect};
use crate::control::RunControl;

/// Samples a second of the IMU: an eye can follow them, and a slow line can carry them.
const IMU_RATE_HZ: u16 = 50;
/// Time between two readings of the AD channels.
const AD_EVERY: Duration = Duration::from_millis(500);
/// Samples of each AD channel.
const AD_SAMPLES: u16 = 16;

/// Why raw values cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum LookError {
    /// No board was found.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// The board refused or failed a request.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The board has not answered that the module is off.
    #[error("the board did not confirm that it is safe; its watchdog makes it safe within 2 s")]
    NotSafe,
}

impl LookError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Connect(error) => error.try_this(),
            Self::Board(error) => error.try_this(),
            Self::NotSafe => "wait before you take the module out, and check the line to the board",
        }
    }
}

/// Switches the module on and shows its raw values until a stop is asked for; then switches the module off.
///
/// # Errors
/// [`LookError`]: the board is not there, or went away, or did not confirm at the end that the module is off.
pub async fn look(target: &Target, control: &RunControl, readings: &watch::Sender<Readings>) -> Result<(), LookError> {
    let board = tokio::select! {
        biased;
        _ = control.asked_times(1) => return Ok(()),
        board = connect(target, false, by_chance(), readings) => board?,
    };
    let lease = BoardLease::new(&board, watch::channel(Advance::default()).0);
    let looked = tokio::select! {
        biased;
        _ = control.asked_times(1) => Ok(()),
        ended = show(&lease) => ended,
    };
    let safe = make_safe(&lease).await;
    drop(lease);
    let _ = timeout(SAFE_WITHIN, BoardClient::close(board)).await;
    looked?;
    if safe { Ok(()) } else { Err(LookError::NotSafe) }
}

/// Ends only with an error of the board.
async fn show(lease: &BoardLease<'_>) -> Result<(), BoardError> {
    if lease.switches_supply() {
        lease.call(&ModulePower { on: 1 }).await?;
    }
    let mut imu = lease.listen(StreamId::Imu).await?;
    let mut gnss = lease.listen(StreamId::Gnss).await?;
    let mut pulses = lease.listen(StreamId::Pps).await?;
    let mut compensated = lease.listen(StreamId::Compensated).await?;
    lease.call(&GnssRestart { start: GnssStart::Hot as u8 }).await?;
    // One sample a frame, so that the screen is not late.
    let streams = [(StreamId::Imu, IMU_RATE_HZ, 1), (StreamId::Gnss, 0, 0), (StreamId::Pps, 0, 0)];
    for (stream, rate_hz, samples_per_frame) in streams {
        lease.call(&StreamStart { stream: stream as u8, rate_hz, count: 0, samples_per_frame }).await?;
    }
    compensate(lease).await?;
    let mut ad_due = interval(AD_EVERY);
    loop {
        // Values are shown on their way here.
        tokio::select! {
            frame = imu.next() => drop(frame?),
            frame = gnss.next() => drop(frame?),
            frame = pulses.next() => drop(frame?),
            frame = compensated.next() => drop(frame?),
            _ = ad_due.tick() => drop(lease.call(&AdRead { channels: 0xff, samples: AD_SAMPLES }).await?),
        }
    }
}

/// Asks for compensated samples too. A module that was never calibrated has none, and a slow line has no room for them:
/// then they are not shown.
async fn compensate(lease: &BoardLease<'_>) -> Result<(), BoardError> {
    let started = async {
        if lease.call(&CalibrationRead {}).await?.state == CalibrationState::Valid as u8 {
            let stream = StreamId::Compensated as u8;
            lease.call(&StreamStart { stream, rate_hz: IMU_RATE_HZ, count: 0, samples_per_frame: 1 }).await?;
        }
        Ok(())
    };
    match started.await {
        Err(BoardError::Refused { .. } | BoardError::RefusedUnknown { .. }) => Ok(()),
        started => started,
    }
}

/// Makes the board safe, and says whether it confirmed that. If it does not answer, its watchdog acts.
async fn make_safe(lease: &BoardLease<'_>) -> bool {
    matches!(timeout(SAFE_WITHIN, lease.call(&MakeSafe {})).await, Ok(Ok(_)))
}
