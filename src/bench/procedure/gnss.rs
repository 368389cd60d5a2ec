//! The GNSS receiver: its raw sentences and 1PPS edges come through the board. This module reads and weighs them.

mod figures;

use std::time::Duration;

use gnc_board::stream::{Closed, Stream};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_nmea::{DIMENSIONS_AFTER, Epoch, Fix, Sentences};
use gnc_protocol::message::{GnssRestart, GnssStart, StreamStart};
use gnc_protocol::stream::{PpsCapture, StreamId};
use gnc_protocol::wire::{FieldReader, Wire as _};
use tokio::time::Instant;

use super::{ProcedureContext, ProcedureError, Recorder};

/// Longest time beyond the window for a GSA sentence, which some receivers send with about every fifth epoch.
const DIMENSIONS_WITHIN_S: f64 = 10.0;

/// The slowest interval of a receiver's sentences.
const RECEIVER_SPEAKS_EVERY: Duration = Duration::from_secs(1);

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let window_s = params.quantity("window", Unit::Second)?;
    let timeout_s = params.quantity("timeout", Unit::Second)?;
    let restarted = match params.choice("start")? {
        "hot" => Some(GnssStart::Hot),
        "warm" => Some(GnssStart::Warm),
        "cold" => Some(GnssStart::Cold),
        _ => None,
    };
    let mut pulses = bench.board.listen(StreamId::Pps).await?;
    let mut bytes = bench.board.listen(StreamId::Gnss).await?;
    if let Some(start) = restarted {
        bench.board.call(&GnssRestart { start: start as u8 }).await?;
    }
    // Start both at once, so that no time passes between them, even if simulated time does not wait.
    let [start_pulses, start_bytes] =
        [StreamId::Pps, StreamId::Gnss].map(|stream| StreamStart { stream: stream as u8, ..StreamStart::default() });
    tokio::try_join!(bench.board.call(&start_pulses), bench.board.call(&start_bytes))?;
    let asked = Instant::now();
    let heard = listen(&mut bytes, &mut pulses, window_s, timeout_s).await?;
    bench.board.spent(heard.listened + heard.waited(asked));
    let in_window = bytes.losses();
    let (bytes, pulses) = tokio::try_join!(bench.board.stop_stream(bytes), bench.board.stop_stream(pulses))?;
    // If the line lost bytes or pulses, the receiver is not called mute and a pulse not missing. For a receiver with a
    // fix, data after the window is not used.
    let said = if heard.fixes.is_empty() { bytes } else { Closed { losses: in_window, ..bytes } };
    for Closed { produced, losses } in [said, pulses] {
        if losses.any() {
            return Err(ProcedureError::SamplesLost { wanted: produced, losses });
        }
    }
    figures::file(&heard, restarted.is_some(), bench.site, recorder).await
}

/// What the receiver said.
#[derive(Debug, Default)]
struct Heard {
    /// Time from the first sentence after the restart to the first fix. The board does not tell when it restarted the
    /// receiver.
    time_to_fix_s: Option<f64>,
    /// Board time of the first fix.
    fixed_us: Option<u64>,
    /// Epochs after the first fix.
    fixes: Vec<Epoch>,
    /// The last epoch without a fix.
    without_fix: Option<Epoch>,
    /// Epochs without a fix after the first fix.
    fixes_lost: u32,
    /// Counts of everything beside the epochs: the receiver's own errors and other protocols.
    sentences: Sentences,
    pulses_ns: Vec<u64>,
    /// When the first sentence came, by link time.
    first: Option<Instant>,
    /// Board time from the first sentence to the last.
    listened: Duration,
}

impl Heard {
    fn add(&mut self, epochs: Vec<Epoch>, now_us: u64) {
        for epoch in epochs {
            if epoch.has_fix() {
                self.fixed_us.get_or_insert(now_us);
                self.fixes.push(epoch);
            } else {
                self.fixes_lost += u32::from(self.fixed_us.is_some());
                self.without_fix = Some(epoch);
            }
        }
    }

    /// Whether the number of dimensions is not known yet and may still come.
    fn may_tell_dimensions(&self) -> bool {
        self.fixes.len() <= DIMENSIONS_AFTER && self.fixes.iter().all(|epoch| epoch.fix == Fix::DimensionsUnknown)
    }

    /// Board time from the start of the stream to the first sentence. No frame tells it. So it is link time, scaled by
    /// the pace of board time after that sentence. A running receiver speaks at least once a second.
    fn waited(&self, asked: Instant) -> Duration {
        let Some(first) = self.first else { return Duration::ZERO };
        let pace = self.listened.as_secs_f64() / first.elapsed().as_secs_f64().max(1e-6);
        let waited_s = (first - asked).as_secs_f64() * pace;
        Duration::from_secs_f64(waited_s).min(RECEIVER_SPEAKS_EVERY)
    }
}

/// Listens until the window after the fix is over or the time limit for a fix is. Both go by the board's clock.
async fn listen(
    bytes: &mut Stream,
    pulses: &mut Stream,
    window_s: f64,
    timeout_s: f64,
) -> Result<Heard, ProcedureError> {
    let mut heard = Heard::default();
    let mut began_us = None;
    let mut now_us = 0;
    loop {
        tokio::select! {
            // Pulses first: at full speed the simulated bench sends seconds of data at once, and the window ends with
            // the sentences.
            biased;
            frame = pulses.next() => {
                let Some(frame) = frame? else { continue };
                let mut reader = FieldReader::new(&frame.samples);
                for _ in 0..frame.head.count {
                    let capture = PpsCapture::get(&mut reader)
                        .map_err(|error| ProcedureError::Nonsense { what: "the PPS stream", why: error.to_string() })?;
                    heard.pulses_ns.push(capture.board_time_ns);
                }
            }
            frame = bytes.next() => match frame? {
                Some(frame) => {
                    now_us = frame.head.board_time_us;
                    began_us.get_or_insert(now_us);
                    heard.first.get_or_insert_with(Instant::now);
                    let ended = heard.sentences.push(&frame.samples);
                    heard.add(ended, now_us);
                }
                // The receiver is mute, while the board's clock goes on.
                None => {
                    now_us = bytes.board_time_us();
                    began_us.get_or_insert(bytes.began_us().unwrap_or(now_us));
                }
            }
        }
        let Some(began_us) = began_us else { continue };
        let waited_s = |since: u64| now_us.saturating_sub(since) as f64 * 1e-6;
        let over =
            |fixed| waited_s(fixed) > window_s + if heard.may_tell_dimensions() { DIMENSIONS_WITHIN_S } else { 0.0 };
        if heard.fixed_us.map_or(waited_s(began_us) > timeout_s, over) {
            let ended = heard.sentences.finish();
            heard.add(ended, now_us);
            heard.time_to_fix_s = heard.fixed_us.map(|fixed| fixed.saturating_sub(began_us) as f64 * 1e-6);
            heard.listened = Duration::from_secs_f64(waited_s(began_us));
            return Ok(heard);
        }
    }
}
