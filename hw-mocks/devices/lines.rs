//! The four IO lines between the module's pins and the slave board, and the SPI on the same wires.
//!
//! A line is a pin of the module, a wire and a pad of the board. The netlist says what is connected; the level of a net
//! follows from what drives it.
//!
//! # Electrical facts
//! - A net driven both ways is low: the outputs sink more than they source.
//! - A driver is stronger than a pull (100 kOhm); a net without either keeps its last level, here low.
//! - IO test: the module drives one pin; the board joins the pads of driver and reader; the module pulls every
//!   pin that it does not drive to the level opposite to the driven one. All pins are read 1 ms later.
//! - SPI: line 0 is CS (low while a block is sent), 1 CLK, 2 SDI (into the module), 3 SDO (out of it); mode 0, most
//!   significant bit first. The module is master and drives CS, CLK and SDO; the board drives SDI. The data
//!   line of the side that listens is driven low. Unconnected, the board sees CS high and the others low, the
//!   module SDI low. A byte counts for the listener when all of its eight clock edges came while CS was low.

use gnc_protocol::message::{IoTest, SpiDirection};
use gnc_protocol::wire::List;

/// Lines.
pub(crate) const LINES: usize = 4;
const CS: usize = 0;
const CLK: usize = 1;
const SDI: usize = 2;
const SDO: usize = 3;

/// Faults of the wires.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LineFaults {
    /// Two lines in contact, at the module's pins.
    pub shorted: Vec<(u8, u8)>,
    /// Lines broken between pin and pad.
    pub open: Vec<u8>,
    /// Lines in contact with ground (false) or supply (true), at the module's pins.
    pub stuck: Vec<(u8, bool)>,
    /// One of this many bits on the data lines of the SPI is inverted; 0: none.
    pub flip_every_bits: u32,
}

/// The sources at a node beside the wires.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Source {
    drive: Option<bool>,
    pull: Option<bool>,
}

/// The wires.
#[derive(Debug, Clone)]
pub struct Lines {
    faults: LineFaults,
    bits: u32,
}

impl Lines {
    /// Wires with their faults.
    #[must_use]
    pub fn new(faults: LineFaults) -> Self {
        Self { faults, bits: 0 }
    }

    /// Levels of all nodes: pins 0 to 3, then pads 0 to 3.
    fn levels(&self, sources: &[Source; 2 * LINES], joined: Option<(usize, usize)>) -> [bool; 2 * LINES] {
        let mut net: [usize; 2 * LINES] = core::array::from_fn(|node| node);
        let mut join = |a: usize, b: usize| {
            let (from, to) = (net[a], net[b]);
            for node in &mut net {
                if *node == from {
                    *node = to;
                }
            }
        };
        for line in 0..LINES {
            if !self.faults.open.contains(&(line as u8)) {
                join(line, LINES + line);
            }
        }
        for &(a, b) in &self.faults.shorted {
            join(usize::from(a), usize::from(b));
        }
        if let Some((a, b)) = joined {
            join(LINES + a, LINES + b);
        }
        core::array::from_fn(|node| {
            let members = || (0..2 * LINES).filter(|other| net[*other] == net[node]);
            let stuck = self
                .faults
                .stuck
                .iter()
                .find(|(line, _)| net[usize::from(*line)] == net[node])
                .map(|&(_, level)| level);
            let lowest = |pick: fn(&Source) -> Option<bool>| members().filter_map(|m| pick(&sources[m])).min();
            stuck.or_else(|| lowest(|s| s.drive)).or_else(|| lowest(|s| s.pull)).unwrap_or(false)
        })
    }

    /// The IO test: levels of the four pins, line n in bit n.
    #[must_use]
    pub fn io_test(&self, request: &IoTest) -> u8 {
        let (driver, reader, level) = (usize::from(request.driver), usize::from(request.reader), request.level != 0);
        let mut sources = [Source::default(); 2 * LINES];
        for (pin, source) in sources.iter_mut().take(LINES).enumerate() {
            if pin == driver {
                source.drive = Some(level);
            } else {
                source.pull = Some(!level);
            }
        }
        let levels = self.levels(&sources, Some((driver, reader)));
        (0..LINES).fold(0, |bits, line| bits | u8::from(levels[line]) << line)
    }

    /// Sends bytes over the SPI, edge by edge; returns the bytes that the far side received.
    pub fn spi(&mut self, direction: SpiDirection, data: &[u8]) -> List<u8, 256> {
        let mut listener = Listener::default();
        let mut sender_clock = Clock::default();
        let mut sent = 0_usize;
        // The block begins and ends with CS high; every bit has one low and one high half of the clock.
        let total_bits = data.len() * 8;
        self.half(direction, true, false, bit(data, 0), &mut listener, &mut sender_clock);
        for _ in 0..total_bits {
            for clock in [false, true] {
                let value = bit(data, sent);
                let edges = sender_clock.falling;
                self.half(direction, false, clock, value, &mut listener, &mut sender_clock);
                // The board shifts on the falling edges that it receives, the module on those that it makes.
                if direction == SpiDirection::ToModule && sender_clock.falling != edges {
                    sent += 1;
                    self.half(direction, false, clock, bit(data, sent), &mut listener, &mut sender_clock);
                }
            }
            if direction == SpiDirection::FromModule {
                sent += 1;
            }
        }
        self.half(direction, true, false, bit(data, sent), &mut listener, &mut sender_clock);
        listener.bytes
    }

    /// One half period: sets the levels and lets both sides sample.
    fn half(
        &mut self,
        direction: SpiDirection,
        cs: bool,
        clock: bool,
        value: bool,
        listener: &mut Listener,
        sender_clock: &mut Clock,
    ) {
        let from_module = direction == SpiDirection::FromModule;
        let mut sources = [Source::default(); 2 * LINES];
        sources[CS].drive = Some(cs);
        sources[CLK].drive = Some(clock);
        sources[SDO].drive = Some(from_module && value);
        sources[LINES + SDI].drive = Some(!from_module && value);
        for (line, level) in [(CS, true), (CLK, false), (SDO, false)] {
            sources[LINES + line].pull = Some(level);
        }
        sources[SDI].pull = Some(false);
        let levels = self.levels(&sources, None);
        let (seen_cs, seen_clock, seen_data) = if from_module {
            (levels[LINES + CS], levels[LINES + CLK], levels[LINES + SDO])
        } else {
            // The module knows its own select and clock, whatever happens on the wires.
            (cs, clock, levels[SDI])
        };
        sender_clock.look(levels[LINES + CLK] && !levels[LINES + CS]);
        if listener.is_edge(seen_cs, seen_clock) {
            self.bits = self.bits.wrapping_add(1);
            let flip = self.faults.flip_every_bits != 0 && self.bits.is_multiple_of(self.faults.flip_every_bits);
            listener.take(seen_data != flip);
        }
    }
}

/// Bit `index` of a block, most significant first; low after its end.
fn bit(data: &[u8], index: usize) -> bool {
    data.get(index / 8).is_some_and(|byte| byte >> (7 - index % 8) & 1 == 1)
}

/// The clock that the sending board receives.
#[derive(Debug, Default)]
struct Clock {
    high: bool,
    falling: u32,
}

impl Clock {
    fn look(&mut self, high: bool) {
        if self.high && !high {
            self.falling += 1;
        }
        self.high = high;
    }
}

/// The side that shifts bits in on rising edges.
#[derive(Debug, Default)]
struct Listener {
    clock: bool,
    shift: u8,
    count: u8,
    bytes: List<u8, 256>,
}

impl Listener {
    fn is_edge(&mut self, cs: bool, clock: bool) -> bool {
        let rising = clock && !self.clock;
        self.clock = clock;
        if cs {
            self.count = 0;
        }
        rising && !cs
    }

    fn take(&mut self, level: bool) {
        self.shift = self.shift << 1 | u8::from(level);
        self.count += 1;
        if self.count == 8 {
            self.count = 0;
            // A block has at most 256 bytes; further bytes would be lost as on the board.
            let _ = self.bytes.push(self.shift);
        }
    }
}
