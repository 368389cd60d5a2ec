//! Sends test frames and receives the echoes. Other nodes may use the bus or keep it full, and it may hold frames back
//! for seconds.
//!
//! The module sends frames back in the order in which they came, and a fence is sent behind all other test frames. So
//! when a fence is back, all frames that were sent before it have left the line. What is missing then is lost, and what
//! comes later belongs to frames that are sent later.

use std::io;
use std::time::Duration;

use gnc_link::can::{Tap, Traffic};
use gnc_protocol::can::id::is_echo;
use gnc_protocol::can::{BIT_RATE, CanFrame};
use gnc_protocol::message::CanCountersReply;
use tokio::time::{Instant, timeout_at};

use super::frames::{Mark, Phase};
use super::ledger::{Ledger, Seen};

/// Frames under way. The oldest controllers hold 64 bytes, which are four frames; with five, a late host loses one.
const IN_FLIGHT: usize = 4;
/// A frame that is not back after this time is lost. A frame takes 0.3 ms each way, an adapter and a busy computer some
/// 20 ms.
const QUIET: Duration = Duration::from_millis(250);
/// Waits in vain after which no more frames are sent: more frames on such a bus would show nothing new.
const IN_VAIN: usize = 8;
/// Fences that are sent before the exchange is given up.
const FENCES: usize = 4;
/// Time between two fences.
const FENCE: Duration = Duration::from_millis(500);
/// Longest wait for a fence while other test frames come.
const SETTLE: Duration = Duration::from_secs(5);
/// Number of looks at counters that disagree, to see whether they still change.
const LOOKS: usize = 3;
/// Share of the bus above which other frames can keep test frames back, since other frames may have priority.
const BUSY: f64 = 0.1;

/// Observations of an exchange.
#[derive(Debug, Clone, Default)]
pub(super) struct Observed {
    pub(super) seen: Seen,
    /// The line was free of earlier frames when the exchange began; otherwise the test frames were not sent at all.
    pub(super) settled: bool,
    /// The line was free of test frames when the exchange ended.
    pub(super) through: bool,
    pub(super) before: CanCountersReply,
    pub(super) after: CanCountersReply,
    /// The module's controller received more or fewer frames than it sent back, and the counts no longer change.
    pub(super) keeps_back: bool,
    /// Results of frames that were sent one by one, if the others leave a question open.
    pub(super) alone: Alone,
    /// Frames under test ids that came although only fences were sent.
    pub(super) stale: u64,
    /// All other frames on the bus meanwhile.
    pub(super) others: Traffic,
    pub(super) span: Duration,
}

/// Results of frames sent one by one: the next frame was sent when the last one was back or was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Alone {
    pub(super) out_of_order: u64,
    /// Frames with the mark of this exchange whose id, length or content is different.
    pub(super) altered: u64,
}

impl Observed {
    /// Test frames that the module received.
    pub(super) fn received(&self) -> u32 {
        self.after.received.wrapping_sub(self.before.received)
    }

    /// Whether the module's controller received more frames than it sent back, or sent additional frames.
    fn is_unbalanced(&self) -> bool {
        let echoed = self.after.echoed.wrapping_sub(self.before.echoed);
        // Frames that waited in the module when the exchange began show only in the total counts.
        let waits = self.after.received != self.after.echoed;
        waits && (!self.settled || self.received() != echoed)
    }

    /// Share of the bus that the other frames took, at most 1.
    pub(super) fn busy_share(&self) -> f64 {
        let bits = self.span.as_secs_f64() * f64::from(BIT_RATE);
        if bits > 0.0 { (self.others.bits as f64 / bits).min(1.0) } else { 0.0 }
    }

    /// Whether the other frames may have kept test frames back.
    pub(super) fn is_busy(&self) -> bool {
        !self.through && self.busy_share() > BUSY
    }
}

/// Sends the test frames; `counters` reads the counters of the module's controller.
pub(super) async fn observe<E: From<io::Error>>(
    tap: &Tap,
    mark: Mark,
    counters: impl AsyncFn() -> Result<CanCountersReply, E>,
) -> Result<Observed, E> {
    let (began, traffic) = (Instant::now(), tap.traffic());
    tap.drain().await;
    let mut seen = Observed::default();
    let mut line = BusExchange { tap, mark, ledger: Ledger::new(&mark.test_frames()), marked: 0 };
    seen.before = counters().await?;
    let fences = line.settle(Phase::Before).await?;
    seen.settled = fences.is_back;
    if seen.settled {
        // Frames up to now belong to an earlier exchange.
        line.ledger = Ledger::new(&mark.test_frames());
        seen.before = counters().await?;
        line.exchange(IN_FLIGHT).await?;
        seen.through = line.settle(Phase::Behind).await?.is_back;
    }
    seen.after = counters().await?;
    for _ in 0..LOOKS {
        if seen.keeps_back || !seen.is_unbalanced() {
            break;
        }
        // The module may still have to send back what it received just now.
        line.listen(QUIET).await?;
        let before = std::mem::replace(&mut seen.after, counters().await?);
        let moved = (before.received, before.echoed) != (seen.after.received, seen.after.echoed);
        seen.keeps_back = !moved && seen.is_unbalanced();
    }
    seen.seen = line.ledger.seen();
    if !seen.settled {
        let (sent, stale) = (fences.sent as u64, seen.seen.strange + seen.seen.foreign);
        (seen.seen, seen.stale) = (Seen { sent, lost: sent, ..Seen::default() }, stale);
    }
    let Seen { lost, strange, out_of_order, .. } = seen.seen;
    if out_of_order > 0 || (strange > 0 && lost > 0) {
        seen.alone = line.single_file().await?;
    }
    (seen.others, seen.span) = (tap.traffic().since(traffic), began.elapsed());
    Ok(seen)
}

/// The fences of a phase.
struct Fences {
    sent: usize,
    is_back: bool,
}

/// The bus, and the results of the frames of one exchange.
struct BusExchange<'a> {
    tap: &'a Tap,
    mark: Mark,
    ledger: Ledger,
    /// Frames with the mark of this exchange that are neither its frames nor repetitions of them.
    marked: u64,
}

impl BusExchange<'_> {
    /// Sends fences until one is back. Then waits for frames that the module may send behind it. While other test
    /// frames come, the fence may still be behind them.
    async fn settle(&mut self, phase: Phase) -> io::Result<Fences> {
        let mut fences = Fences { sent: 0, is_back: false };
        let (Some(fence), began) = (self.mark.fence(phase), Instant::now()) else { return Ok(fences) };
        let mut until = began;
        while !fences.is_back {
            match self.next(until.min(began + SETTLE)).await? {
                Some(frame) if self.mark.is_fence(phase, &frame) => fences.is_back = true,
                Some(frame) => {
                    self.note(&frame);
                    if fences.sent == FENCES {
                        until = Instant::now() + FENCE;
                    }
                }
                None if fences.sent < FENCES => {
                    self.tap.send(fence).await?;
                    fences.sent += 1;
                    until = Instant::now() + FENCE;
                }
                None => break,
            }
        }
        if fences.is_back && (fences.sent > 1 || !self.ledger.is_complete()) {
            self.listen(QUIET).await?;
        }
        Ok(fences)
    }

    /// Sends all frames and keeps at most `in_flight` of them under way.
    async fn exchange(&mut self, in_flight: usize) -> io::Result<()> {
        let mut in_vain = 0;
        while in_vain < IN_VAIN
            && let Some(frame) = self.ledger.send_next()
        {
            self.tap.send(frame).await?;
            let mut until = Instant::now() + QUIET;
            while self.ledger.under_way() >= in_flight {
                match self.next(until).await? {
                    Some(frame) if self.note(&frame) => (in_vain, until) = (0, Instant::now() + QUIET),
                    Some(_) => {}
                    // All frames under way are lost or late: the next ones must not wait for them too.
                    None => {
                        self.ledger.give_up();
                        in_vain += 1;
                    }
                }
            }
        }
        Ok(())
    }

    /// Receives frames until no frame of this exchange has come for this time.
    async fn listen(&mut self, quiet: Duration) -> io::Result<()> {
        let latest = Instant::now() + SETTLE;
        let mut until = Instant::now() + quiet;
        while let Some(frame) = self.next(until.min(latest)).await? {
            if self.note(&frame) {
                until = Instant::now() + quiet;
            }
        }
        Ok(())
    }

    /// Sends marked frames one by one. An adapter or a driver that lets one frame pass another does so only within
    /// milliseconds, and only this station sends frames with the mark.
    async fn single_file(&mut self) -> io::Result<Alone> {
        let frames = self.mark.single_frames();
        let mut alone = BusExchange { tap: self.tap, mark: self.mark, ledger: Ledger::new(&frames), marked: 0 };
        alone.exchange(1).await?;
        alone.listen(QUIET).await?;
        let Seen { out_of_order, altered, .. } = alone.ledger.seen();
        Ok(Alone { out_of_order, altered: altered + alone.marked })
    }

    /// Files a frame. Returns whether it is an awaited frame of this exchange.
    fn note(&mut self, frame: &CanFrame) -> bool {
        if Phase::ALL.iter().any(|phase| self.mark.is_fence(*phase, frame)) {
            return false;
        }
        let is_waited_for = self.ledger.note(frame);
        // An adapter may report a frame twice; the second report is not an altered frame.
        let is_altered = !is_waited_for && is_echo(frame.id()) && !self.ledger.holds(frame);
        self.marked += u64::from(is_altered && self.mark.is_single(frame));
        is_waited_for
    }

    /// The next frame, or `None` at this time.
    async fn next(&self, until: Instant) -> io::Result<Option<CanFrame>> {
        // A bus that is never silent must not delay the end of the wait.
        if Instant::now() >= until {
            return Ok(None);
        }
        timeout_at(until, self.tap.receive()).await.ok().transpose()
    }
}
