//! Sends test frames and hears what comes back, on a bus that others may use, keep full, or hold frames back on for
//! seconds.
//!
//! The module sends frames back in the order in which they came, and a fence goes behind all other test frames. So when a fence is
//! back, nothing that was sent before it is still on its way: what is missing is lost, and what comes belongs to what
//! is sent from then on.

use std::io;
use std::time::Duration;

use gnc_link::can::{Tap, Traffic};
use gnc_protocol::can::id::is_echo;
use gnc_protocol::can::{BIT_RATE, CanFrame};
use gnc_protocol::message::CanCountersReply;
use tokio::time::{Instant, timeout_at};

use super::frames::{Mark, Phase};
use super::ledger::{Ledger, Seen};

/// Frames under way: the oldest controllers hold 64 bytes, which are four frames, and a host that is late loses a fifth.
const IN_FLIGHT: usize = 4;
/// What is not back by then does not come: a frame takes 0.3 ms each way, an adapter and a busy computer some 20 ms.
const QUIET: Duration = Duration::from_millis(250);
/// Waits in vain after which no more frames are sent: nothing new would be learnt of a bus like this.
const IN_VAIN: usize = 8;
/// Fences that are sent before it is given up.
const FENCES: usize = 4;
/// Between two fences.
const FENCE: Duration = Duration::from_millis(500);
/// Longest wait for a fence while other test frames come.
const SETTLE: Duration = Duration::from_secs(5);
/// Looks at counters that do not agree, until they stand still.
const LOOKS: usize = 3;
/// Share of the bus above which its other frames can keep test frames back: they go first.
const BUSY: f64 = 0.1;

/// What was seen of an exchange.
#[derive(Debug, Clone, Default)]
pub(super) struct Observed {
    pub(super) seen: Seen,
    /// Nothing of before was on its way when it began; else the test frames were not sent at all.
    pub(super) settled: bool,
    /// Nothing was on its way any more when it ended.
    pub(super) through: bool,
    pub(super) before: CanCountersReply,
    pub(super) after: CanCountersReply,
    /// The module's controller received more or fewer frames than it sent back, and that does not change.
    pub(super) keeps_back: bool,
    /// What came of frames that were sent one by one, where the others leave a question open.
    pub(super) alone: Alone,
    /// Frames under test ids that came although nothing but fences was sent.
    pub(super) stale: u64,
    /// All other frames on the bus meanwhile.
    pub(super) others: Traffic,
    pub(super) span: Duration,
}

/// What came of frames of which the next one was sent when the last one was back, or did not come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Alone {
    pub(super) out_of_order: u64,
    /// They had the mark of this exchange, and their id, length or content was another one.
    pub(super) altered: u64,
}

impl Observed {
    /// Test frames that the module received.
    pub(super) fn received(&self) -> u32 {
        self.after.received.wrapping_sub(self.before.received)
    }

    /// Whether the module's controller received more frames than it sent back, or sent others beside those.
    fn is_unbalanced(&self) -> bool {
        let echoed = self.after.echoed.wrapping_sub(self.before.echoed);
        // What waited in the module when the exchange began is in its whole numbers alone.
        let waits = self.after.received != self.after.echoed;
        waits && (!self.settled || self.received() != echoed)
    }

    /// Share of the bus that the other frames took, at most 1.
    pub(super) fn busy_share(&self) -> f64 {
        let bits = self.span.as_secs_f64() * f64::from(BIT_RATE);
        if bits > 0.0 { (self.others.bits as f64 / bits).min(1.0) } else { 0.0 }
    }

    /// Whether the other frames can have kept test frames back.
    pub(super) fn is_busy(&self) -> bool {
        !self.through && self.busy_share() > BUSY
    }
}

/// Sends the test frames; `counters` asks for those of the module's controller.
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
        // What came up to now was of before.
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
        // What the module received just now it may be about to send.
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

/// The bus, and what came of the frames of one exchange.
struct BusExchange<'a> {
    tap: &'a Tap,
    mark: Mark,
    ledger: Ledger,
    /// Frames with the mark of this exchange that are none of its frames, nor one of them once more.
    marked: u64,
}

impl BusExchange<'_> {
    /// Sends fences until one is back, and waits for what a module may have kept back behind it. While other test
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

    /// Sends all frames, so many at a time.
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
                    // All of them are lost, or late: the next ones must not wait for them too.
                    None => {
                        self.ledger.give_up();
                        in_vain += 1;
                    }
                }
            }
        }
        Ok(())
    }

    /// Hears what comes until nothing of this exchange has come for so long.
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

    /// Sends marked frames one by one: an adapter or a driver that lets one frame pass another does so for
    /// milliseconds, and only this station sends frames with the mark.
    async fn single_file(&mut self) -> io::Result<Alone> {
        let frames = self.mark.single_frames();
        let mut alone = BusExchange { tap: self.tap, mark: self.mark, ledger: Ledger::new(&frames), marked: 0 };
        alone.exchange(1).await?;
        alone.listen(QUIET).await?;
        let Seen { out_of_order, altered, .. } = alone.ledger.seen();
        Ok(Alone { out_of_order, altered: altered + alone.marked })
    }

    /// Files a frame. Whether it is one of this exchange that was waited for.
    fn note(&mut self, frame: &CanFrame) -> bool {
        if Phase::ALL.iter().any(|phase| self.mark.is_fence(*phase, frame)) {
            return false;
        }
        let is_waited_for = self.ledger.note(frame);
        // An adapter may tell of a frame twice, and the second one is as good as the first.
        let is_altered = !is_waited_for && is_echo(frame.id()) && !self.ledger.holds(frame);
        self.marked += u64::from(is_altered && self.mark.is_single(frame));
        is_waited_for
    }

    /// The next frame, up to a moment.
    async fn next(&self, until: Instant) -> io::Result<Option<CanFrame>> {
        // A bus that never falls silent does not hold the time up.
        if Instant::now() >= until {
            return Ok(None);
        }
        timeout_at(until, self.tap.receive()).await.ok().transpose()
    }
}
