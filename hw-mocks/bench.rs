//! The simulated bench without its port: bytes and link time go in, bytes come out. It does no I/O and never asks for
//! the time.
//!
//! Link time is wall time since any fixed moment. Bench time follows it N times as fast, apart from the time in which
//! the computer stood still or the host took nothing, see `link_clock.rs`. At maximum speed bench time
//! moves only while a request, a stream, a restart or a bench sleep is pending, from event to event. It moves only
//! after all earlier output has left through the port. Samples are an exception: the bench makes 8 KiB of them before
//! it looks at the port again, since a system call costs as much as making a frame.

mod hands;
mod truth;
mod voice;

use std::time::Duration;

use gnc_protocol::can::CanFrame;
use gnc_protocol::serial::FrameDecoder;
use gnc_protocol::slave::Slave;
use gnc_protocol::timing::BITS_PER_BYTE;

use crate::board::{BoardPort, SimulatedBoard};
use crate::breaches::conversation::TalkFilter;
use crate::breaches::wire::ByteFilter;
use crate::can::{CanBus, HeardFrame};
use crate::line::ByteLine;
use crate::noise::{Dice, RandomStream};
use crate::operator::{SWITCHES, SimulatedOperator};
use crate::personality::Personality;
use crate::turntable::SimulatedTable;
use crate::wire_faults::FaultyWire;
use crate::world::{TrueSite, World};

/// Line time of the waiting samples beyond which the board drops new ones.
const SAMPLES_WAIT_S: f64 = 0.7;
/// Samples are handed to the line while it is busy for less than this. An ACCEPT waits this long behind them and for
/// one frame more; a host allows 50 ms and one frame.
const SAMPLES_AHEAD_S: f64 = 0.025;
/// Number of waiting bytes beyond which whole frames are lost: the host has not read for long.
const FRAMES_WAIT: usize = 256 * 1024;
/// Time of a memory test that is computed between two looks at the line. It is far below the 50 ms for an ACCEPT, so
/// that even a computer that takes twice as long keeps them.
const COMPUTED_AT_ONCE: Duration = Duration::from_millis(10);
/// Bytes taken from the host ahead of the line's pace.
const INPUT_WAIT: usize = 4096;

/// Bytes of samples that are made at maximum speed before the port takes them: 16 full frames, 0.95 s at 200 Hz. The
/// port holds eight times as many.
const AT_ONCE: usize = 8 * 1024;
/// Most bench time that may pass for these bytes.
const AT_ONCE_NS: u64 = 1_000_000_000;

/// At maximum speed bench time stands still for this long after a loss on the line. The host waits in link time before
/// it asks again, and minutes of board time would pass meanwhile.
const REPAIR: Duration = Duration::from_millis(125);

/// The same on CAN, where an answer may take 85 ms on the bus.
const CAN_REPAIR: Duration = Duration::from_millis(250);

pub use truth::{LineTruth, Truth};

/// How fast bench time runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// This many times as fast as wall time; 1 is true time.
    Times(f64),
    /// As fast as possible.
    Max,
}

/// The properties of a bench.
#[derive(Debug, Clone)]
pub struct BenchOptions {
    /// Board, module and faults.
    pub personality: Personality,
    /// The serial number that the module reports, unless the personality fixes one.
    pub serial_number: Option<String>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// How fast bench time runs.
    pub speed: Speed,
    /// Rate of the link.
    pub rate_baud: u32,
    /// UTC at the start since 1970. It is not the wall clock, so that a run can be repeated.
    pub utc_start: Duration,
    /// Where the bench stands.
    pub site: TrueSite,
    /// Temperature of the room.
    pub ambient_c: f64,
}

impl Default for BenchOptions {
    /// A good module at true speed and 921600 baud, on 2026-11-22 at 06:30:15 UTC.
    fn default() -> Self {
        Self {
            personality: Personality::good(),
            serial_number: None,
            seed: 1,
            speed: Speed::Times(1.0),
            rate_baud: 921_600,
            utc_start: Duration::from_secs(1_795_329_015),
            site: TrueSite::default(),
            ambient_c: 23.0,
        }
    }
}

/// The simulated bench as a state machine.
#[derive(Debug)]
pub struct SimulatedBench {
    /// The board's end of the conversation on RS-422.
    slave: Slave,
    /// The same on CAN. A HELLO on one link ends the session on the other.
    can_slave: Slave,
    /// The link of the last HELLO.
    session_on: BoardPort,
    can: CanBus,
    /// Breaches of the interface document on RS-422 and on CAN.
    talk: TalkFilter,
    can_talk: TalkFilter,
    bytes: ByteFilter,
    /// Whether the board speaks and hears on CAN.
    has_can: bool,
    /// Whether the host's CAN adapter holds frames that it could not hand on yet.
    pub(crate) can_held: bool,
    board: SimulatedBoard,
    table: SimulatedTable,
    operator: SimulatedOperator,
    decoder: FrameDecoder,
    incoming: ByteLine,
    outgoing: ByteLine,
    /// Faults of the line: between the host and `incoming`, and between the board and `outgoing`.
    wire_to_board: FaultyWire,
    wire_to_host: FaultyWire,
    /// Whether `outgoing` holds other frames than samples.
    said_more: bool,
    /// Link time at which the host has noticed a loss on the line. Until then bench time stands still at maximum speed.
    repaired_at: Duration,
    sleepers: Vec<hands::Sleeper>,
    /// Rate of the line; `None` for a line without pace.
    pace: Option<f64>,
    speed: Speed,
    /// Link time in which bench time did not pass.
    held: Duration,
}

impl SimulatedBench {
    /// A bench at link time 0.
    #[must_use]
    pub fn new(options: &BenchOptions) -> Self {
        let table = options.personality.model.turntable;
        let heat = options.personality.model.heat;
        let room_c = heat.room_c.unwrap_or(options.ambient_c);
        let mut world = World::new(options.site, options.utc_start, room_c);
        (world.rise_k, world.warm_up_s) = (heat.rise_k, heat.warm_up_s);
        world.fixture_field_gauss = table.field_mgauss.map(|field| field * 1e-3).into();
        world.field_swing = table.field_swing_ppm * 1e-6;
        let serial_number = options.serial_number.as_deref().unwrap_or("SIM-0001");
        // The line of a bench that runs N times as fast carries N times as much; otherwise its streams would not fit.
        let (pace, can_pace) = match options.speed {
            Speed::Times(times) => (Some(f64::from(options.rate_baud) * times.max(1.0)), Some(times)),
            Speed::Max => (None, None),
        };
        let wire = options.personality.model.wire;
        let breaches = &options.personality.model.breaches;
        let operator = options.personality.model.operator;
        let mut bench = Self {
            slave: Slave::default(),
            can_slave: Slave::default(),
            session_on: BoardPort::Serial,
            can_held: false,
            can: CanBus::new(can_pace, &options.personality.model, options.seed),
            talk: TalkFilter::new(breaches),
            can_talk: TalkFilter::new(breaches),
            bytes: ByteFilter::new(&breaches.frames),
            has_can: !breaches.hello.no_can,
            board: SimulatedBoard::new(&options.personality, serial_number, world, options.rate_baud, options.seed),
            table: SimulatedTable::new(options.personality.model.turntable, options.seed),
            operator: SimulatedOperator::new(operator),
            decoder: FrameDecoder::default(),
            incoming: ByteLine::new(pace),
            outgoing: ByteLine::new(pace),
            wire_to_board: FaultyWire::new(wire.to_board, Dice::new(options.seed, RandomStream::LineToBoard)),
            wire_to_host: FaultyWire::new(wire.to_host, Dice::new(options.seed, RandomStream::Line)),
            said_more: false,
            repaired_at: Duration::ZERO,
            sleepers: Vec::new(),
            pace,
            speed: options.speed,
            held: Duration::ZERO,
        };
        for (number, on) in (1..=SWITCHES).zip(operator.switches_on) {
            bench.set_switch(number, on);
        }
        bench
    }

    /// How many bytes [`SimulatedBench::receive`] takes now; other bytes stay in the host's port.
    #[must_use]
    pub fn room(&self) -> usize {
        INPUT_WAIT.saturating_sub(self.incoming.len() + self.wire_to_board.len())
    }

    /// Bytes from the host.
    pub fn receive(&mut self, bytes: &[u8], now: Duration) {
        self.wire_to_board.push(bytes, now);
        let echo = self.wire_to_board.take_echo();
        self.outgoing.push(&echo, now);
        self.carry(now);
    }

    /// Bytes for the host that have passed the line by `now`.
    pub fn output(&mut self, now: Duration) -> &[u8] {
        self.outgoing.ready(now)
    }

    /// Removes bytes that the port took.
    pub fn consume(&mut self, count: usize) {
        self.outgoing.consume(count);
        self.said_more &= !self.outgoing.is_empty();
    }

    /// Gives the CAN bus a pace: a bus of the kernel has one at any speed.
    pub(crate) fn pace_can(&mut self) {
        self.can.pace();
    }

    /// How many frames [`SimulatedBench::receive_can`] takes now.
    #[must_use]
    pub fn can_room(&self) -> usize {
        self.can.room()
    }

    /// A frame from the host's CAN adapter.
    pub fn receive_can(&mut self, frame: CanFrame, now: Duration) {
        self.can.push(frame, now);
    }

    /// The next frame that the host's CAN adapter took off the bus.
    pub fn output_can(&mut self) -> Option<CanFrame> {
        self.can.pop()
    }

    /// The watchdogs do not count `span` before `now`, since the host could not send then. Bench time does not pass in
    /// it.
    pub(crate) fn excuse(&mut self, span: Duration, now: Duration) {
        self.slave.excuse(span, now);
        self.can_slave.excuse(span, now);
        self.talk.excuse(span, now);
        self.can_talk.excuse(span, now);
        self.hold(span);
    }

    /// The port of the newest session.
    pub(crate) fn session_port(&self) -> BoardPort {
        self.session_on
    }

    /// Bench time does not pass in the last `span` of link time. [`SimulatedBench::advance`] has not seen it yet.
    pub(crate) fn hold(&mut self, span: Duration) {
        self.held += span;
    }

    /// Lets link time pass up to `now`.
    pub fn advance(&mut self, now: Duration) {
        self.carry(now);
        // Time first: a request that starts something starts it now and not at the last look.
        self.pass_time(now);
        self.hear(now);
        self.run_bus(now);
        if self.can_step(now) {
            self.step();
        }
        self.speak(now);
        self.run_bus(now);
        let until_ns = self.board.now_ns() + AT_ONCE_NS;
        while self.goes_on_with_samples() && self.board.now_ns() < until_ns {
            self.step();
            self.speak(now);
        }
        self.wake_sleepers();
    }

    /// Moves time to the next event, at maximum speed.
    fn step(&mut self) {
        if let Some(next_ns) = self.next_ns() {
            self.board.advance(next_ns);
            self.after_time();
        }
    }

    /// Whether time may move at maximum speed although output is still waiting: the output is only samples, and no
    /// other event is awaited.
    fn goes_on_with_samples(&self) -> bool {
        let said = self.outgoing.len();
        let quiet = self.incoming.is_empty() && self.wire_to_board.is_clean() && self.wire_to_host.is_clean();
        let first = self.board.next_event_ns() < self.sleeper_due_ns().or(Some(u64::MAX));
        self.speed == Speed::Max
            && self.session_on == BoardPort::Serial
            && (1..AT_ONCE).contains(&said)
            && !self.said_more
            && self.talk.is_empty()
            && quiet
            && self.board.only_streams()
            && first
    }

    /// Lets bench time follow link time, so that the next action of an operator or a fixture happens now and not at the
    /// last look. At maximum speed bench time does not follow link time.
    pub fn pass_time(&mut self, now: Duration) {
        if let Speed::Times(times) = self.speed {
            self.board.line_full = match self.session_on {
                BoardPort::Serial => self.board.samples_waiting() > self.line_bytes(SAMPLES_WAIT_S),
                BoardPort::Can => self.can.is_full(),
            };
            // The board's clock goes by its oscillator. True time is link time times the speed.
            let now_ns = self.board.bench_ns(now.saturating_sub(self.held).as_secs_f64() * times) as u64;
            // If a computer is too slow to run a memory test at this speed, the bench still hears the host and answers
            // in link time: the board's clock falls behind instead, until the test has ended.
            let reach_ns = self.board.now_ns().saturating_add((COMPUTED_AT_ONCE.as_nanos() as f64 * times) as u64);
            self.board.advance(if self.board.is_computing() { now_ns.min(reach_ns) } else { now_ns });
            self.after_time();
        }
    }

    /// The next link time at which [`SimulatedBench::advance`] or [`SimulatedBench::output`] has something to do; it
    /// may lie in the past.
    #[must_use]
    pub fn next_due(&self, now: Duration) -> Duration {
        let events = match self.speed {
            // Add a nanosecond, so that lost digits on the way back do not leave it a moment short.
            Speed::Times(times) => {
                let due =
                    |ns: u64| self.held + Duration::from_nanos((self.board.true_s(ns) * 1e9 / times).ceil() as u64 + 1);
                self.next_ns().map(due)
            }
            Speed::Max => (self.can_step(now) && self.next_ns().is_some()).then_some(now),
        };
        let talk = (!self.board.is_booting()).then(|| self.talk_due());
        let wires = [self.wire_to_board.next_due(), self.wire_to_host.next_due()];
        let repaired = (self.repaired_at > now).then_some(self.repaired_at);
        let idle = now + Duration::from_secs(1);
        [events, talk, repaired, self.incoming.next_due(), self.outgoing.next_due(), self.can.next_due()]
            .into_iter()
            .chain(wires)
            .flatten()
            .fold(idle, Duration::min)
    }

    /// Bench time in ns.
    #[must_use]
    pub fn bench_time_ns(&self) -> u64 {
        self.board.now_ns()
    }

    /// Whether time may move, at maximum speed.
    fn can_step(&self, now: Duration) -> bool {
        if self.speed != Speed::Max {
            return false;
        }
        let pending = self.board.has_work() || !self.sleepers.is_empty();
        let said = match self.session_on {
            BoardPort::Serial => {
                let lines_empty = self.outgoing.is_empty() && self.incoming.is_empty();
                lines_empty && self.wire_to_host.is_empty() && self.wire_to_board.is_empty()
            }
            BoardPort::Can => self.can.is_quiet() && !self.can_held,
        };
        let held = !self.talk.is_empty() || !self.can_talk.is_empty();
        pending && said && !held && now >= self.repaired_at
    }

    /// Passes on what the faults of the wire let through, and notes what they spoil.
    fn carry(&mut self, now: Duration) {
        let to_board = self.wire_to_board.ready(now);
        self.incoming.push(&to_board, now);
        let to_host = self.wire_to_host.ready(now);
        if self.outgoing.len() + to_host.len() <= FRAMES_WAIT {
            self.outgoing.push(&to_host, now);
        }
        if self.wire_to_board.take_harmed() | self.wire_to_host.take_harmed() {
            self.repaired_at = now + REPAIR;
        }
        if self.can.take_harmed() {
            self.repaired_at = now + CAN_REPAIR;
        }
    }

    /// The next event in bench time.
    fn next_ns(&self) -> Option<u64> {
        [self.board.next_event_ns(), self.sleeper_due_ns()].into_iter().flatten().min()
    }

    /// Gives the board the frames that have arrived.
    fn hear(&mut self, now: Duration) {
        let bytes = self.incoming.ready(now).to_vec();
        self.incoming.consume(bytes.len());
        if self.board.is_booting() {
            return;
        }
        let mut rest = bytes.as_slice();
        while let Some(outcome) = self.decoder.next(&mut rest) {
            let Ok(frame) = outcome else { continue };
            if frame.header.kind == gnc_protocol::Kind::Hello {
                self.decoder.restart_sequence();
            }
            self.take(BoardPort::Serial, &frame, now);
        }
    }

    /// Lets frames pass on the CAN bus: the module sends test frames back, the board receives the rest.
    fn run_bus(&mut self, now: Duration) {
        while let Some(heard) = self.can.step(now) {
            let HeardFrame::FromHost(frame) = heard else { continue };
            if self.board.is_powered() {
                self.board.module.can.echo(&frame).for_each(|echo| self.can.echo(echo));
            }
            if self.board.is_booting() || !self.has_can {
                continue;
            }
            if let Some(Ok(frame)) = self.can.understand(&frame, now) {
                self.take(BoardPort::Can, &frame, now);
            }
        }
    }

    fn after_time(&mut self) {
        if self.board.take_restarted() {
            // A reset cuts frames under way in the middle.
            self.slave = Slave::default();
            self.can_slave = Slave::default();
            self.can.restart();
            self.talk.restart();
            self.can_talk.restart();
            self.decoder = FrameDecoder::default();
            self.outgoing.clear();
            self.incoming.clear();
        }
    }

    /// Bytes that the line carries in this time; without pace there is no bound.
    fn line_bytes(&self, span_s: f64) -> usize {
        let bytes = |rate_baud: f64| (rate_baud / f64::from(BITS_PER_BYTE) * span_s) as usize;
        self.pace.map_or(usize::MAX, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bench_time_does_not_pass_while_the_computer_stands_still_or_a_port_is_full() {
        let seconds = Duration::from_secs;
        let mut bench = SimulatedBench::new(&BenchOptions { speed: Speed::Times(10.0), ..BenchOptions::default() });
        let clock = &bench.board;
        let at = |true_s: f64| clock.bench_ns(true_s) as u64;
        let (ten, twenty) = (at(10.0), at(20.0));
        bench.advance(seconds(1));
        assert_eq!(bench.bench_time_ns(), ten);
        bench.excuse(seconds(3), seconds(4));
        bench.advance(seconds(4));
        assert_eq!(bench.bench_time_ns(), ten);
        bench.hold(seconds(1));
        bench.advance(seconds(5));
        assert_eq!(bench.bench_time_ns(), ten);
        bench.advance(seconds(6));
        assert_eq!(bench.bench_time_ns(), twenty);
    }

    /// The bench looks again when its next event is due, not earlier and not later.
    #[test]
    fn an_event_is_due_later_by_the_time_that_was_held() {
        let mut bench = SimulatedBench::new(&BenchOptions { speed: Speed::Times(10.0), ..BenchOptions::default() });
        let (done, awake) = std::sync::mpsc::channel();
        bench.sleep(Duration::from_secs(2), done);
        bench.hold(Duration::from_millis(100));
        let due = Duration::from_millis(300);
        // The first heartbeats pass on both links, so that only the sleep is due.
        let mut now = Duration::ZERO;
        while now < due - Duration::from_millis(50) {
            now += Duration::from_millis(10);
            bench.advance(now);
            let said = bench.output(now).len();
            bench.consume(said);
            while bench.output_can().is_some() {}
        }
        let soon = bench.next_due(now);
        // The board's oscillator is off by some ppm.
        assert!(soon.abs_diff(due) < Duration::from_micros(20), "{soon:?}");
        bench.advance(due - Duration::from_millis(1));
        assert!(awake.try_recv().is_err());
        bench.advance(due + Duration::from_micros(1));
        assert!(awake.try_recv().is_ok());
    }
}
