//! Tests the exchange on a bus in memory: others send too, frames are held back, and modules have faults.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::ops::Range;
use std::time::Duration;

use gnc_link::can::{CanLink, MemoryEnd};
use gnc_protocol::can::id::echo_of;
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::message::{CanCountersReply, CanState};
use tokio::time::{Instant, sleep};

use super::drive;
use super::exchange::{Observed, observe};
use super::frames::Mark;
use crate::procedure::ProcedureError;

/// Frames of eight bytes that a bus of 500 kbit/s carries in a tick, the shortest time that a paused clock knows.
const SLOTS: usize = 4;
const TICK: Duration = Duration::from_millis(1);
/// Time from the first attempt to the second one, as a station begins it.
const BETWEEN: Duration = Duration::from_millis(50);
const FOREVER: Range<u64> = 0..u64::MAX;

/// What is unusual about the bus and the module. A field `*_every` is a number of frames between two events; 0: never.
#[derive(Debug, Clone, Default)]
struct Unusual {
    /// A node with this id fills the bus with frames during this range of milliseconds.
    flood: Option<(u16, Range<u64>)>,
    /// Frames of the module reach the host so many milliseconds late, during this range of milliseconds.
    late: Option<(u64, Range<u64>)>,
    /// A node sends this frame every ten milliseconds. The module answers if it is a test frame.
    intruder: Option<CanFrame>,
    /// The adapter repeats to its computer the frames that the computer sends.
    adapter_repeats: bool,
    line_loses_every: u32,
    /// The adapter reports a frame to its computer twice.
    line_doubles_every: u32,
    /// The adapter lets a frame pass the one before it.
    line_swaps_every: u32,
    module_flips_every: u32,
    /// The module sends a frame back under the next id.
    module_shifts_every: u32,
    module_cuts_every: u32,
    module_loses_every: u32,
    module_doubles_every: u32,
    module_swaps_every: u32,
    /// The module's controller counts an error.
    module_counts: bool,
}

/// The module and the bus. The bus carries one frame in each slot: the lowest id of those that wait.
#[derive(Debug, Default)]
struct World {
    unusual: Unusual,
    from_host: VecDeque<CanFrame>,
    from_module: VecDeque<CanFrame>,
    from_intruder: VecDeque<CanFrame>,
    to_host: VecDeque<(Duration, CanFrame)>,
    held: Option<CanFrame>,
    counters: CanCountersReply,
    carried: u32,
    slots: u64,
}

impl World {
    fn step(&mut self, now: Duration) {
        let Unusual { flood, late, .. } = self.unusual.clone();
        let ms = u64::try_from(now.as_millis()).unwrap();
        self.slots += 1;
        if self.slots.is_multiple_of(40) {
            self.from_intruder.extend(self.unusual.intruder);
        }
        let flood = flood.filter(|(_, when)| when.contains(&ms)).map(|(id, _)| frame(CanId::Standard(id), &[0; 8]));
        let rank = |frame: Option<&CanFrame>| frame.map_or(u32::MAX, |frame| rank(frame.id()));
        let ranks = [
            rank(flood.as_ref()),
            rank(self.from_host.front()),
            rank(self.from_module.front()),
            rank(self.from_intruder.front()),
        ];
        let (winner, least) = ranks.iter().enumerate().min_by_key(|(_, rank)| **rank).unwrap();
        if *least == u32::MAX {
            return;
        }
        let frame = match winner {
            0 => flood,
            1 => self.from_host.pop_front(),
            2 => self.from_module.pop_front(),
            _ => self.from_intruder.pop_front(),
        }
        .unwrap();
        if winner == 2 {
            self.counters.echoed += 1;
        }
        if winner != 2 {
            self.module_hears(&frame);
        }
        if winner != 1 || self.unusual.adapter_repeats {
            self.carried += 1;
            let delay = late.filter(|(_, when)| winner == 2 && when.contains(&ms)).map_or(0, |(delay, _)| delay);
            let due = self.to_host.back().map_or(Duration::ZERO, |(due, _)| *due);
            if winner == 2 && every(self.carried, self.unusual.line_loses_every) {
                return;
            }
            let came = (due.max(now + Duration::from_millis(delay)), frame);
            self.to_host.push_back(came);
            let last = self.to_host.len() - 1;
            if winner == 2 && last > 0 && every(self.carried, self.unusual.line_swaps_every) {
                self.to_host.swap(last - 1, last);
            }
            if winner == 2 && every(self.carried, self.unusual.line_doubles_every) {
                self.to_host.push_back(came);
            }
        }
    }

    fn module_hears(&mut self, heard: &CanFrame) {
        let Some(id) = echo_of(heard.id()) else { return };
        self.counters.received += 1;
        let unusual = &self.unusual;
        let (count, mut data) = (self.counters.received, heard.data().to_vec());
        if every(count, unusual.module_loses_every) {
            return;
        }
        if every(count, unusual.module_flips_every) {
            data.iter_mut().take(1).for_each(|byte| *byte ^= 1);
        }
        if every(count, unusual.module_cuts_every) {
            data.pop();
        }
        let shifted = match id {
            CanId::Standard(id) => CanId::Standard(id & !0xf | (id + 1) & 0xf),
            CanId::Extended(id) => CanId::Extended(id & !0xffff | (id + 1) & 0xffff),
        };
        let echo = frame(if every(count, unusual.module_shifts_every) { shifted } else { id }, &data);
        let held = self.held.take();
        if held.is_none() && every(count, unusual.module_swaps_every) {
            self.held = Some(echo);
            return;
        }
        self.from_module.push_back(echo);
        self.from_module.extend(held);
        if every(count, unusual.module_doubles_every) {
            self.from_module.push_back(echo);
        }
    }
}

fn every(count: u32, period: u32) -> bool {
    period != 0 && count.is_multiple_of(period)
}

fn frame(id: CanId, data: &[u8]) -> CanFrame {
    CanFrame::new(id, data).unwrap()
}

/// The priority of an id: a lower rank is sent first.
fn rank(id: CanId) -> u32 {
    match id {
        CanId::Standard(id) => u32::from(id) << 19,
        CanId::Extended(id) => (id >> 18) << 19 | 1 << 18 | id & 0x3_ffff,
    }
}

async fn live(world: &RefCell<World>, mut end: MemoryEnd) -> io::Error {
    let began = Instant::now();
    loop {
        {
            let mut world = world.borrow_mut();
            let now = began.elapsed();
            world.from_host.extend(std::iter::from_fn(|| end.from_host.try_recv().ok()));
            (0..SLOTS).for_each(|_| world.step(now));
            while let Some((_, frame)) = world.to_host.pop_front_if(|(due, _)| *due <= now) {
                // A frame that the adapter cannot hold is lost.
                let _ = end.to_host.try_send(frame);
            }
        }
        sleep(TICK).await;
    }
}

/// How an attempt ends by the plan's limits, and its message.
#[derive(Debug)]
struct Ended {
    outcome: &'static str,
    observed: Observed,
    doubt: Option<ProcedureError>,
}

fn ended(observed: Observed) -> Ended {
    let at_fault = observed.is_module_at_fault(0);
    let doubt = observed.doubt(0).filter(|_| !at_fault);
    let outcome = if at_fault {
        "failed"
    } else if doubt.is_some() {
        "errored"
    } else {
        "passed"
    };
    Ended { outcome, observed, doubt }
}

/// Two attempts on one bus.
async fn attempts(unusual: Unusual) -> [Ended; 2] {
    let (mut link, end) = CanLink::in_memory();
    let tap = link.tap().unwrap();
    let counters = CanCountersReply { tx_errors: 9 * u16::from(unusual.module_counts), ..Default::default() };
    let world = RefCell::new(World { unusual, counters, ..World::default() });
    let ask = async || Ok::<_, io::Error>(world.borrow().counters.clone());
    let both = async {
        let first = observe(&tap, Mark(0x1234_5678), ask).await.unwrap();
        sleep(BETWEEN).await;
        let second = observe(&tap, Mark(0x89ab_cdef), ask).await.unwrap();
        [ended(first), ended(second)]
    };
    tokio::select! {
        both = both => both,
        error = drive(&mut link) => panic!("{error}"),
        error = live(&world, end) => panic!("{error}"),
    }
}

async fn check(unusual: Unusual, expected: [&str; 2]) -> [Ended; 2] {
    let ended = attempts(unusual.clone()).await;
    assert_eq!([ended[0].outcome, ended[1].outcome], expected, "{unusual:#?}\n{ended:#?}");
    ended
}

/// Faults of the module are found on a quiet bus, in the first attempt and in the second one.
#[tokio::test(start_paused = true)]
async fn faults_of_the_module_fail() {
    check(Unusual::default(), ["passed"; 2]).await;
    check(Unusual { adapter_repeats: true, ..Unusual::default() }, ["passed"; 2]).await;
    for period in [1, 7, 40] {
        let fail = ["failed"; 2];
        check(Unusual { module_flips_every: period, ..Unusual::default() }, fail).await;
        check(Unusual { module_loses_every: period, ..Unusual::default() }, fail).await;
        check(Unusual { module_doubles_every: period, ..Unusual::default() }, fail).await;
    }
    for period in [7, 40] {
        check(Unusual { module_swaps_every: period, ..Unusual::default() }, ["failed"; 2]).await;
        check(Unusual { module_shifts_every: period, ..Unusual::default() }, ["failed"; 2]).await;
        check(Unusual { module_cuts_every: period, ..Unusual::default() }, ["failed"; 2]).await;
    }
    check(Unusual { module_counts: true, ..Unusual::default() }, ["failed"; 2]).await;
    let off = CanCountersReply { state: CanState::BusOff as u8, ..Default::default() };
    assert!(Observed { after: off, ..Observed::default() }.is_module_at_fault(0));
}

/// A good module never fails, whatever keeps its frames back and however long.
#[tokio::test(start_paused = true)]
async fn a_full_bus_is_not_the_modules_fault() {
    // Beside 0x6ff extended test frames pass and standard ones wait; beside 0x100 all test frames wait.
    for id in [0x100, 0x6ff] {
        let [first, second] = check(Unusual { flood: Some((id, FOREVER)), ..Unusual::default() }, ["errored"; 2]).await;
        let text = first.doubt.map(|doubt| doubt.to_string()).unwrap_or_default();
        assert!(text.contains("100 % of what the bus carries"), "{text}");
        assert!(second.observed.seen.altered == 0);
        for begins_ms in [0, 20] {
            for lasts_ms in (100..6000).step_by(590) {
                let when = begins_ms..begins_ms + lasts_ms;
                let ended = attempts(Unusual { flood: Some((id, when.clone())), ..Unusual::default() }).await;
                let outcomes = [ended[0].outcome, ended[1].outcome];
                assert!(!outcomes.contains(&"failed"), "{id:x} {when:?}: {ended:#?}");
            }
        }
    }
}

/// Frames of the first attempt that come in the second one do not count as altered and do not replace lost frames
/// there.
#[tokio::test(start_paused = true)]
async fn frames_that_come_seconds_late_are_no_alteration() {
    for begins_ms in [0, 40] {
        for delay_ms in (300..8000).step_by(770) {
            let late = Some((delay_ms, begins_ms..begins_ms + 2000));
            let ended = attempts(Unusual { late: late.clone(), ..Unusual::default() }).await;
            let outcomes = [ended[0].outcome, ended[1].outcome];
            assert!(!outcomes.contains(&"failed"), "{late:?}: {ended:#?}");
            // In addition the line loses one frame of the second attempt.
            let ended = attempts(Unusual { late, line_loses_every: 211, ..Unusual::default() }).await;
            let [_, second] = &ended;
            assert!(second.outcome != "failed" && (second.outcome == "errored" || second.observed.seen.lost == 0));
        }
    }
}

/// A bus stands still until the exchange is given up, and then moves again. Fewer frames are tested, so a module that
/// alters a later frame does not pass.
#[tokio::test(start_paused = true)]
async fn an_exchange_that_was_given_up_is_no_pass() {
    let mut given_up = 0;
    for begins_ms in (4..60).step_by(5) {
        for delay_ms in (1700..4000).step_by(370) {
            let late = Some((delay_ms, begins_ms..begins_ms + 2500));
            let ended = attempts(Unusual { late: late.clone(), module_flips_every: 40, ..Unusual::default() }).await;
            assert!(ended.iter().all(|attempt| attempt.outcome != "passed"), "{late:?}: {ended:#?}");
            given_up += usize::from(ended[0].observed.seen.unsent > 0 && ended[0].observed.seen.lost == 0);
        }
    }
    assert!(given_up > 0, "no exchange was given up without a loss");
}

/// Other stations and modules on the same bus: their frames are not faults of this module and not its frames.
#[tokio::test(start_paused = true)]
async fn what_others_send_under_test_ids_is_told() {
    let strangers = [
        frame(CanId::Standard(0x705), &[1, 2, 3]),
        frame(CanId::Standard(0x70f), &[0; 8]),
        frame(CanId::Extended(0x1abc_1234), &[]),
        frame(CanId::Standard(0x715), &[1, 2, 3]),
        frame(CanId::Standard(0x713), &[0xaa; 8]),
        frame(CanId::Extended(0x1abd_4321), &[9]),
    ];
    for intruder in strangers {
        for line_loses_every in [0, 40] {
            let unusual = Unusual { intruder: Some(intruder), line_loses_every, ..Unusual::default() };
            let [first, _] = check(unusual, ["errored"; 2]).await;
            assert!(matches!(first.doubt, Some(ProcedureError::TestIdsShared { .. })), "{first:?}");
        }
        // Faults of this module are still found.
        for module_flips_every in [7, 40] {
            let unusual = Unusual { intruder: Some(intruder), module_flips_every, ..Unusual::default() };
            check(unusual, ["failed"; 2]).await;
        }
    }
}

#[tokio::test(start_paused = true)]
async fn what_the_line_loses_is_errored() {
    for line_loses_every in [1, 2, 10, 50, 200] {
        let [first, _] = check(Unusual { line_loses_every, ..Unusual::default() }, ["errored"; 2]).await;
        assert!(matches!(first.doubt, Some(ProcedureError::FramesLost { lost: 1.., .. })), "{first:?}");
    }
}

/// An adapter or its driver reports frames twice and in another order. It does so for the frames that are sent one by
/// one as well: they do not count as altered.
#[tokio::test(start_paused = true)]
async fn what_the_line_doubles_and_swaps_is_errored() {
    for line_doubles_every in [0, 2, 10, 50] {
        for line_swaps_every in [3, 11, 40] {
            let unusual = Unusual { line_doubles_every, line_swaps_every, ..Unusual::default() };
            let ended = attempts(unusual.clone()).await;
            assert!(ended.iter().all(|attempt| attempt.outcome != "failed"), "{unusual:?}\n{ended:#?}");
            let [first, _] = ended;
            assert!(first.outcome == "errored" && first.observed.seen.out_of_order > 0, "{unusual:?}\n{first:?}");
        }
    }
}
